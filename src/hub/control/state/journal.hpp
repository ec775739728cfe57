#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <string>
#include <variant>
#include <vector>

#include "base/ids.hpp"
#include "hub/limits.hpp"
#include "proto/control/ns_watch.hpp"

namespace gimnet::hub {

/// The latest changes of names and services, numbered without gaps: what those who watch have yet
/// to hear. It is one for all of them, so that who is slow keeps nothing for himself. Until
/// somebody watches it only counts: nobody could come back for what was before. Thread safety:
/// none. Limits: watch_changes and watch_bytes; the oldest go.
class Journal {
 public:
  /// A change as it travels, and what decides who hears of it.
  struct Note {
    std::variant<NodeId, GroupId> subject;
    std::string name;  ///< "" for a node without one
    std::string former_name;
    std::vector<std::byte> bytes;  ///< a value of WATCH_EVENTS
  };

  /// `epoch` is not 0 and differs from that of every earlier start of the hub.
  Journal(std::uint64_t epoch, const Limits& limits) : limits_(limits), epoch_(epoch) {}

  /// Somebody watches: changes are kept from here on.
  void begin() { keeps_ = true; }
  /// Are changes kept? If not, pass() is all that one of them needs.
  [[nodiscard]] bool keeps() const { return keeps_; }

  /// Keeps the change under the next version. REQUIRES: keeps(); it has a node or a service.
  void add(proto::ns::Change change);
  /// Counts a change that is not kept. REQUIRES: !keeps().
  void pass() { ++version_; }

  /// More changed than can be told: all that is kept goes, and everybody begins anew.
  void begin_again() {
    ++version_;
    notes_.clear();
    bytes_ = 0;
  }

  [[nodiscard]] std::uint64_t epoch() const { return epoch_; }
  /// Of the last change; 0: there was none.
  [[nodiscard]] std::uint64_t version() const { return version_; }
  /// Are all changes behind this version still there?
  [[nodiscard]] bool reaches(std::uint64_t version) const {
    return version <= version_ && version_ - version <= notes_.size();
  }
  /// The change that led to this version. REQUIRES: reaches(version - 1), version <= version().
  [[nodiscard]] const Note& at(std::uint64_t version) const {
    return notes_[notes_.size() - (version_ - version) - 1];
  }

 private:
  [[nodiscard]] static std::size_t size_of(const Note& note);

  const Limits& limits_;
  const std::uint64_t epoch_;
  bool keeps_ = false;
  std::uint64_t version_ = 0;
  std::deque<Note> notes_;  ///< Limit: watch_changes and watch_bytes
  std::size_t bytes_ = 0;
};

}  // namespace gimnet::hub
