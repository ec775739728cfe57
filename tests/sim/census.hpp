#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace gimnet::sim {

/// The faults and collisions that a world brings about. A run of many seeds in which one of them
/// never came proves nothing about it, and fails.
enum class Happening : std::uint8_t {
  joined,
  name_collision,
  name_taken_over,
  name_changed,
  bad_name,
  wrong_role,
  came_back,
  came_back_replacing,
  token_altered,
  token_of_the_past,
  token_shown_twice,
  token_expired,
  token_of_another_identity,
  restored_after_grace,
  restored_after_restart,
  last_goodbye_told,
  grace_expired,
  grace_put_off,
  goodbye,
  crash,
  vanished,
  short_hang,
  silent,
  hello_of_the_dead,
  frames_lost_with_connection,
  misconduct_named,
  misconduct_nameless,
  gone_with_connection,
  hub_full,
  crowd_full,
  crowd_made_room,
  room_made,
  declarer_made_room,
  services_limit,
  subscriptions_limit,
  requests_limit,
  page_continued,
  refused_request,
  unknown_operation,
  garbled_request,
  slot_reused,
  index_near_the_end,
  ids_forgotten,
  group_given_back,
  waits_for_returns,
  state_kept,
  state_not_kept,
  service_moved,
  provider_changed,
  service_withdrawn,
  service_away,
  subscribed_before_service,
  undeclared_dropped,
  name_registered,
  name_unregistered,
  watch_snapshot,
  watch_snapshot_by_pattern,
  watch_change,
  watch_began_again,
  watch_went_on,
  watches_limit,
  event_skipped_away,
  request_of_replaced_connection,
  names_rate,
  services_rate,
  subscriptions_rate,
  rate_over,
  asked_too_often_in_vain,
  change_denied,
  kicked,
  kicked_away,
  kicked_token_refused,
  renumbered,
  renumbered_away,
  renumbered_came_back,
  renumbered_to_taken,
  renumbered_to_awaited,
  renumbering_not_kept,
  renumbered_while_awaiting,
  named_by_former_id,
  configuration_changed,
  configuration_refused,
  service_latest,
  service_sync,
  service_retained,
  delivery_refused,
  pace_taken_up,
  pace_changed,
  pace_given_up,
  window_full,
  not_due,
  held_replaced,
  latest_replaced,
  oldest_dropped,
  paced_message_lost,
  paced_message_missed,
  counted_anew,
  moves_told_again,
  told_later,
  event_missed,
  missed_told_again,
  credited,
  credit_delayed,
  credit_too_late,
  last_message_first,
  start_across_shards,
  unicast_delivered,
  unicast_across_shards,
  unicast_to_departed,
  unicast_waited_for_return,
  unicast_dropped_away,
  group_delivered,
  group_of_another,
  group_of_nobody,
  service_frame_delivered,
  service_frame_refused,
  frame_stalled,
  connection_clogged,
  shard_paused,
  conductor_paused,
  slow_reader,
  hub_killed,
  drain_asked_for,
  drain_by_signal,
  refused_draining,
  told_draining,
  drained_in_life,
  drained,
  garbage_freed,
  count
};
inline constexpr std::size_t kHappenings = static_cast<std::size_t>(Happening::count);

/// Counts each thing that happened. Thread safety: none.
class Census {
 public:
  void add(Happening happening) { ++counts_[static_cast<std::size_t>(happening)]; }
  void add(const Census& other) {
    for (std::size_t i = 0; i < kHappenings; ++i) counts_[i] += other.counts_[i];
  }
  [[nodiscard]] std::uint64_t of(Happening happening) const {
    return counts_[static_cast<std::size_t>(happening)];
  }
  /// One line each: the count and the name.
  [[nodiscard]] std::string table() const;
  /// The names of those that never happened.
  [[nodiscard]] std::vector<std::string> missing() const;

 private:
  std::array<std::uint64_t, kHappenings> counts_{};
};

}  // namespace gimnet::sim
