#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <string>
#include <string_view>

namespace gimnet::hub {

/// Counts the sessions of each crowd: those that come from one address, or are of one user. Thread
/// safety: none. Ownership: an Entry is good until its last session has left. Limits: one entry for
/// each session at most.
class Crowds {
 public:
  using Entries = std::map<std::string, std::size_t, std::less<>>;  ///< sessions by crowd
  using Entry = Entries::value_type;

  /// One session more; null for "", which is no crowd.
  [[nodiscard]] Entry* join(std::string_view crowd) {
    if (crowd.empty()) return nullptr;
    Entry& entry = *entries_.try_emplace(std::string{crowd}).first;
    ++entry.second;
    return &entry;
  }
  /// One session less. Null: it counted in no crowd.
  void leave(Entry* entry) {
    if (entry != nullptr && --entry->second == 0) entries_.erase(entries_.find(entry->first));
  }
  [[nodiscard]] std::size_t size_of(std::string_view crowd) const {
    const auto found = entries_.find(crowd);
    return found == entries_.end() ? 0 : found->second;
  }

 private:
  Entries entries_;  ///< Limit: the sessions
};

}  // namespace gimnet::hub
