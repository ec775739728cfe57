#pragma once

#include <cstdint>
#include <optional>
#include <unordered_map>
#include <vector>

namespace gimnet::hub {

/// The moves of one service, from group to group, of which subscribers may not know: those told to
/// nobody, since the subscriber was away, and those whose SERVICE_MOVED may have been lost with a
/// connection. An entry ends when the subscriber has surely read the event. Groups and nodes are
/// named by index; 0: no group. Thread safety: none. Limits: one entry a subscriber; kBetweenMax
/// groups.
class UntoldMoves {
 public:
  /// Groups between the one that a subscriber knows and the present one that are told: the latest.
  /// A provider may change its service as often as it likes while a subscriber is away, and all
  /// that is kept and told of it would grow by that. Messages of groups before these come untold; a
  /// subscriber drops what it was not told of, and counts it.
  static constexpr std::size_t kBetweenMax = 6;

  struct Untold {
    std::uint32_t known = 0;  ///< where the subscriber surely knows the service to have been
    std::uint64_t move = 0;   ///< the latest that it may not know of
    std::vector<std::uint32_t>
        between;  ///< groups since `known` that ended, in order; at most kBetweenMax
  };

  /// The service left `old_group`; `move` counts up.
  void on_moved(const std::vector<std::uint32_t>& subscribers, std::uint32_t old_group,
                std::uint64_t move);
  /// The subscriber has read what it was told of that move, and so of those before it.
  void on_read(std::uint32_t subscriber, std::uint64_t move);
  void forget(std::uint32_t subscriber);
  void renumber(std::uint32_t subscriber, std::uint32_t new_index);
  /// Nothing: it knows.
  [[nodiscard]] std::optional<Untold> of(std::uint32_t subscriber) const;
  [[nodiscard]] bool empty() const { return entries_.empty(); }

 private:
  struct Entry {
    std::uint32_t known = 0;
    std::uint32_t since = 0;  ///< groups that had ended then
    std::uint64_t move = 0;
  };
  void clear_if_empty();

  std::unordered_map<std::uint32_t, Entry> entries_;  ///< by subscriber
  std::vector<std::uint32_t> ended_;  ///< the latest groups that ended while there were entries
  std::uint32_t ended_count_ = 0;     ///< of all of those
};

}  // namespace gimnet::hub
