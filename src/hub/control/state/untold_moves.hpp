#pragma once

#include <cstdint>
#include <optional>
#include <unordered_map>
#include <vector>

#include "base/ids.hpp"

namespace gimnet::hub {

/// The moves of one service, from group to group, of which subscribers may not know: those told to
/// nobody, since the subscriber was away, and those whose SERVICE_MOVED may have been lost with a
/// connection. An entry ends when the subscriber has surely read the event. Thread safety: none.
/// Limits: one entry a subscriber; kBetweenMax groups.
class UntoldMoves {
 public:
  /// Groups between the one that a subscriber knows and the present one that are told: the latest.
  /// A provider may change its service as often as it likes while a subscriber is away, and all
  /// that is kept and told of it would grow by that. Messages of groups before these come untold; a
  /// subscriber drops what it was not told of, and counts it.
  static constexpr std::size_t kBetweenMax = 6;

  struct Untold {
    GroupIndex known;        ///< where the subscriber surely knows the service to have been
    std::uint64_t move = 0;  ///< the latest that it may not know of
    std::vector<GroupIndex>
        between;  ///< groups since `known` that ended, in order; at most kBetweenMax
  };

  /// The service left `old_group`; `move` counts up.
  void on_moved(const std::vector<NodeIndex>& subscribers, GroupIndex old_group,
                std::uint64_t move);
  /// The subscriber has read what it was told of that move, and so of those before it.
  void on_read(NodeIndex subscriber, std::uint64_t move);
  void forget(NodeIndex subscriber);
  void renumber(NodeIndex subscriber, NodeIndex new_index);
  /// Nothing: it knows.
  [[nodiscard]] std::optional<Untold> of(NodeIndex subscriber) const;
  [[nodiscard]] bool empty() const { return entries_.empty(); }

 private:
  struct Entry {
    GroupIndex known;
    std::uint32_t since = 0;  ///< groups that had ended then
    std::uint64_t move = 0;
  };
  void clear_if_empty();

  std::unordered_map<NodeIndex, Entry> entries_;  ///< by subscriber
  std::vector<GroupIndex> ended_;  ///< the latest groups that ended while there were entries
  std::uint32_t ended_count_ = 0;  ///< of all of those
};

}  // namespace gimnet::hub
