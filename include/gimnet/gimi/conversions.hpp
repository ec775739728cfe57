#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "gimnet/gimi.h"
#include "gimnet/gimi/namespace.hpp"
#include "gimnet/gimi/node_state.hpp"
#include "gimnet/gimi/options.hpp"
#include "gimnet/gimi/outcome.hpp"
#include "gimnet/gimi/records.hpp"
#include "gimnet/gimi/shared_handle.hpp"

// From the C structures to those of C++, and back. Part of gimnet/gimi.hpp.

namespace gimnet::inline GIMNET_GIMI_NAMESPACE::detail {

[[nodiscard]] inline Outcome<void> outcome_of(gimi_status status) {
  if (status == GIMI_OK) return {};
  return failure_of(status);
}

/// Text for C, which a NUL would end: U+FFFD stands in its place. No name has that, so that it is
/// refused; other text shows it.
[[nodiscard]] inline std::string c_text(std::string_view text) {
  std::string whole(text);
  for (std::size_t at = 0; (at = whole.find('\0', at)) != std::string::npos;)
    whole.replace(at, 1, "\xEF\xBF\xBD");
  return whole;
}

[[nodiscard]] inline gimi_key key_of(MessageKey key) { return {key.type, key.instance}; }

[[nodiscard]] inline gimi_node_options options_of(const NodeOptions& options) {
  gimi_node_options how{};
  how.struct_size = sizeof how;
  how.name = options.name.c_str();
  how.hub = options.hub.c_str();
  how.description = options.description.c_str();
  how.proxy = options.proxy.c_str();
  how.timeout_ms = milliseconds_in_options(options.timeout);
  how.wait_for_hub = options.wait_for_hub ? 1 : 0;
  how.no_reconnect = options.reconnect ? 0 : 1;
  if (options.resume) how.resume = *options.resume ? 2 : 1;
  how.no_token_file = options.keep_token ? 0 : 1;
  if (options.shard) how.shard_plus_one = static_cast<std::uint8_t>(*options.shard + 1);
  how.administrator = options.administrator ? 1 : 0;
  how.number_if_taken = options.number_if_taken ? 1 : 0;
  how.socket_receive_bytes = options.socket_receive_bytes;
  how.last_message_bytes = options.last_message_bytes;
  how.message_bytes_max = options.message_bytes_max;
  how.receive_bytes = options.receive_bytes;
  how.queue_messages = options.queue_messages;
  return how;
}

[[nodiscard]] inline gimi_queue_options options_of(const QueueOptions& options) {
  gimi_queue_options how{};
  how.struct_size = sizeof how;
  how.messages = options.messages;
  how.at_full = static_cast<gimi_at_full_queue>(options.at_full);
  return how;
}

[[nodiscard]] inline gimi_subscribe_options options_of(const SubscribeOptions& options) {
  gimi_subscribe_options how{};
  how.struct_size = sizeof how;
  how.rate_hz = options.rate_hz;
  how.queue = options.queue;
  how.at_full = static_cast<gimi_at_full_queue>(options.at_full);
  how.timeout_ms = milliseconds_in_options(options.timeout);
  how.newest_only = options.newest_only ? 1 : 0;
  how.silence_ms = milliseconds_of(options.silence);
  how.window = options.window;
  how.depth = options.depth;
  return how;
}

[[nodiscard]] inline gimi_send_options options_of(const SendOptions& options) {
  gimi_send_options how{};
  how.struct_size = sizeof how;
  how.key = key_of(options.key);
  how.lane = lane_number(options.lane);
  how.window =
      options.window < UINT32_MAX ? static_cast<std::uint32_t>(options.window) : UINT32_MAX;
  how.at_full = static_cast<gimi_at_full_window>(options.at_full);
  how.age_ms_max = options.age_ms_max;
  how.timestamp = options.timestamp ? 1 : 0;
  how.end_at_loss = options.end_at_loss ? 1 : 0;
  how.wait_if_away = options.wait_if_away ? 1 : 0;
  return how;
}

[[nodiscard]] inline gimi_publish_options options_of(const PublishOptions& options,
                                                     Timeout timeout) {
  gimi_publish_options how{};
  how.struct_size = sizeof how;
  how.key = key_of(options.key);
  how.lane = lane_number(options.lane);
  how.delivery = static_cast<gimi_delivery>(options.delivery);
  how.window = options.window;
  how.retain = options.retain ? 1 : 0;
  how.no_timestamp = options.timestamp ? 0 : 1;
  how.metadata = options.metadata.c_str();
  how.timeout_ms = milliseconds_in_options(timeout);
  how.age_ms_max = options.age_ms_max;
  return how;
}

[[nodiscard]] inline gimi_accept_options options_of(const AcceptOptions& options, Timeout timeout) {
  gimi_accept_options how{};
  how.struct_size = sizeof how;
  how.key = key_of(options.key);
  how.messages = options.queue.messages;
  how.at_full = static_cast<gimi_at_full_queue>(options.queue.at_full);
  how.metadata = options.metadata.c_str();
  how.timeout_ms = milliseconds_in_options(timeout);
  return how;
}

[[nodiscard]] inline NodeRecord record_of(const gimi_node_record& found) {
  return {Peer{found.id},    found.name,  found.hub_id,    found.hub_name, found.connected != 0,
          found.description, found.place, found.joined_ms, found.services};
}

[[nodiscard]] inline ServiceRecord record_of(const gimi_service_record& found) {
  return {found.name,
          Peer{found.node},
          {found.key.type, found.key.instance},
          static_cast<Direction>(found.direction),
          static_cast<Delivery>(found.delivery),
          found.group_id,
          found.subscribers,
          found.metadata,
          found.hub_name,
          found.window,
          found.retain != 0,
          found.missed,
          Peer{found.missed_most}};
}

[[nodiscard]] inline HubRecord record_of(const gimi_hub_record& found) {
  return {found.hub_id,    found.name,  found.version, found.shards,
          found.uptime_ms, found.nodes, found.services};
}

[[nodiscard]] inline ConnectionRecord record_of(const gimi_connection_record& found) {
  return {Peer{found.node},     found.name,           found.shard,        found.transport,
          found.peer,           found.connected != 0, found.queued_bytes, found.accepted,
          found.received_bytes, found.delivered,      found.sent_bytes,   found.dropped,
          found.missed,         found.queue_full};
}

[[nodiscard]] inline NetworkHub record_of(const gimi_network_hub_record& found) {
  NetworkHub hub{found.hub_id,
                 found.name,
                 found.version,
                 found.distance,
                 found.cost,
                 found.next_hop,
                 found.nodes,
                 found.services,
                 found.reachable != 0,
                 found.too_far != 0,
                 {}};
  for (std::size_t i = 0; i < found.edge_count; ++i)
    hub.edges.push_back({found.edges[i].hub_id, found.edges[i].cost});
  return hub;
}

[[nodiscard]] inline LinkRecord record_of(const gimi_link_record& found) {
  return {found.name,           found.hub_id,       found.peer,       found.state,
          found.dialled != 0,   found.cost,         found.rtt_us,     found.clock_offset_ns,
          found.clock_error_ns, found.queued_bytes, found.sent_bytes, found.received_bytes,
          found.accepted,       found.delivered,    found.dropped,    found.unsure,
          found.last_error,     found.queue_full};
}

[[nodiscard]] inline HubChange record_of(const gimi_hub_change_record& found) {
  return {found.key, found.from, found.to, found.needs_restart != 0};
}

[[nodiscard]] inline TraceHop record_of(const gimi_trace_hop_record& found) {
  return {found.hub_id, found.arrival_ns, found.departure_ns};
}

/// The records of a list, which is released.
template <class CRecord>
[[nodiscard]] auto records_of(gimi_list& list) {
  std::vector<decltype(record_of(CRecord{}))> records;
  records.reserve(list.count);
  for (std::size_t i = 0; i < list.count; ++i) {
    CRecord record{};
    if (gimi_list_get(&list, i, &record, sizeof record) == GIMI_OK)
      records.push_back(record_of(record));
  }
  gimi_list_release(&list);
  return records;
}

// The answer of a call, with the handle, the list or the text that it made.

template <class Made>
[[nodiscard]] Outcome<Made> made(gimi_status status, gimi_handle handle) {
  if (status != GIMI_OK) return failure_of(status);
  return Made(SharedHandle(handle));
}

template <class CRecord>
[[nodiscard]] Outcome<std::vector<decltype(record_of(CRecord{}))>> listed(gimi_status status,
                                                                          gimi_list& list) {
  if (status != GIMI_OK) return failure_of(status);
  return records_of<CRecord>(list);
}

struct Words {
  char text[GIMI_SENTENCE_BYTES_MAX + 1] = "";
};
[[nodiscard]] inline Outcome<std::string> text(gimi_status status, const Words& words) {
  if (status != GIMI_OK) return failure_of(status);
  return std::string(words.text);
}

/// The counters of each io thread of the hub.
[[nodiscard]] inline std::vector<ShardCounts> counts_of(gimi_list& list) {
  std::vector<ShardCounts> shards;
  for (std::size_t i = 0; i < list.count; ++i) {
    gimi_counter_record record{};
    if (gimi_list_get(&list, i, &record, sizeof record) != GIMI_OK) continue;
    if (shards.empty() || shards.back().shard != record.shard) shards.push_back({record.shard, {}});
    shards.back().counters.emplace_back(record.name, record.value);
  }
  gimi_list_release(&list);
  return shards;
}

[[nodiscard]] inline WatchEvent event_of(gimi_watch_event& told) {
  WatchEvent event;
  event.change = static_cast<Change>(told.change);
  if (told.node != nullptr) event.node = record_of(*told.node);
  if (told.service != nullptr) event.service = record_of(*told.service);
  event.former_name = told.former_name;
  event.hub_id = told.hub_id;
  event.epoch = told.epoch;
  event.version = told.version;
  event.why = told.why;
  gimi_watch_event_release(&told);
  return event;
}

[[nodiscard]] inline gimi_lost_counts lost_counts(gimi_handle node) {
  gimi_lost_counts counts{};
  counts.struct_size = sizeof counts;
  static_cast<void>(gimi_lost(node, &counts));
  return counts;
}

[[nodiscard]] inline NodeState state_of(const gimi_node_state& now) {
  return {Peer{now.id},
          now.name,
          now.hub_name,
          now.hub_id,
          now.connected != 0,
          now.ended != 0,
          now.reconnects,
          now.hub_round_trip_ns,
          now.hub_clock_offset_ns,
          now.trouble,
          now.last_messages_not_kept};
}

}  // namespace gimnet::inline GIMNET_GIMI_NAMESPACE::detail
