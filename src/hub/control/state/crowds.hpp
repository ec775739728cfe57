#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <string_view>

#include "base/ids.hpp"
#include "hub/control/state/due_list.hpp"

namespace gimnet::hub {

/// A note that a session's grace time began. It is void once the session came back or ended.
struct Absence {
  std::chrono::milliseconds until;
  NodeIndex index;
  std::uint32_t generation;
  std::uint32_t attachment;
};

/// The sessions that come from one address, or are of one user.
struct Crowd {
  std::size_t sessions = 0;
  std::size_t away = 0;       ///< of these, within their grace time
  DueList<Absence> absences;  ///< in the order in which they began; some are void
};

/// Counts the sessions of each crowd. Thread safety: none. Ownership: an Entry is good until its
/// last session has left. Limits: one entry for each session at most.
class Crowds {
 public:
  using Entries = std::map<std::string, Crowd, std::less<>>;
  using Entry = Entries::value_type;

  /// One session more; null for "", which is no crowd.
  [[nodiscard]] Entry* join(std::string_view crowd) {
    if (crowd.empty()) return nullptr;
    Entry& entry = *entries_.try_emplace(std::string{crowd}).first;
    ++entry.second.sessions;
    return &entry;
  }
  /// One session less. Null: it counted in no crowd.
  void leave(Entry* entry, bool away) {
    if (entry == nullptr) return;
    if (away) --entry->second.away;
    if (--entry->second.sessions == 0) entries_.erase(entries_.find(entry->first));
  }
  /// Null: nobody is in it.
  [[nodiscard]] Crowd* find(std::string_view crowd) {
    const auto found = entries_.find(crowd);
    return found == entries_.end() ? nullptr : &found->second;
  }

 private:
  Entries entries_;  ///< Limit: the sessions
};

}  // namespace gimnet::hub
