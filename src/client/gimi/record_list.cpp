#include "client/gimi/record_list.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>
#include <memory>

#include "client/gimi/failure.hpp"
#include "client/nif/sized_struct.hpp"

namespace gimnet::gimi {

gimi_node_record record_of(const NodeRecord& of) {
  gimi_node_record record{};
  record.id = of.node.id;
  record.hub_id = of.hub_id;
  record.name = of.name.c_str();
  record.hub_name = of.hub_name.c_str();
  record.description = of.description.c_str();
  record.place = of.place.c_str();
  record.joined_ms = of.joined_ms;
  record.services = of.services;
  record.connected = of.connected ? 1 : 0;
  return record;
}

gimi_service_record record_of(const ServiceRecord& of) {
  gimi_service_record record{};
  record.name = of.name.c_str();
  record.hub_name = of.hub_name.c_str();
  record.metadata = of.metadata.c_str();
  record.node = of.node.id;
  record.group_id = of.group_id;
  record.key = {of.key.type, of.key.instance};
  record.direction = static_cast<gimi_direction>(of.direction);
  record.delivery = static_cast<gimi_delivery>(of.delivery);
  record.subscribers = of.subscribers;
  record.window = of.window;
  record.missed = of.missed;
  record.missed_most = of.missed_most.id;
  record.retain = of.retain ? 1 : 0;
  return record;
}

gimi_hub_record record_of(const HubRecord& of) {
  return {of.name.c_str(), of.version.c_str(), of.uptime_ms, of.hub_id,
          of.shards,       of.nodes,           of.services};
}

gimi_connection_record record_of(const ConnectionRecord& of) {
  gimi_connection_record record{};
  record.name = of.name.c_str();
  record.transport = of.transport.c_str();
  record.peer = of.peer.c_str();
  record.node = of.node.id;
  record.shard = of.shard;
  record.queued_bytes = of.queued_bytes;
  record.accepted = of.accepted;
  record.received_bytes = of.received_bytes;
  record.delivered = of.delivered;
  record.sent_bytes = of.sent_bytes;
  record.dropped = of.dropped;
  record.missed = of.missed;
  record.connected = of.connected ? 1 : 0;
  record.queue_full = of.queue_full;
  return record;
}

gimi_link_record record_of(const LinkRecord& of) {
  return {of.name.c_str(),    of.peer.c_str(),   of.state.c_str(), of.last_error.c_str(),
          of.hub_id,          of.cost,           of.rtt_us,        of.dialled ? 1u : 0u,
          of.clock_offset_ns, of.clock_error_ns, of.queued_bytes,  of.sent_bytes,
          of.received_bytes,  of.accepted,       of.delivered,     of.dropped,
          of.unsure,          of.queue_full};
}

gimi_hub_change_record record_of(const HubChange& of) {
  return {of.key.c_str(), of.from.c_str(), of.to.c_str(), of.needs_restart ? 1u : 0u, 0};
}

gimi_trace_hop_record record_of(const TraceHop& of) {
  return {of.arrival_ns, of.departure_ns, of.hub_id, 0};
}

namespace {

class CounterList final : public RecordList {
 public:
  explicit CounterList(std::vector<ShardCounts> shards) : shards_(std::move(shards)) {
    for (const ShardCounts& shard : shards_) {
      for (const auto& [name, value] : shard.counters)
        records_.push_back({name.c_str(), value, shard.shard, 0});
    }
  }
  [[nodiscard]] gimi_list list() {
    return {records_.size(), sizeof(gimi_counter_record), records_.data(),
            static_cast<RecordList*>(this)};
  }

 private:
  std::vector<ShardCounts> shards_;
  std::vector<gimi_counter_record> records_;
};

class NetworkList final : public RecordList {
 public:
  explicit NetworkList(std::vector<NetworkHub> hubs) : hubs_(std::move(hubs)) {
    edges_.reserve(hubs_.size());
    for (const NetworkHub& hub : hubs_) {
      auto& edges = edges_.emplace_back();
      for (const auto& edge : hub.edges) edges.push_back({edge.hub_id, edge.cost});
      gimi_network_hub_record& record = records_.emplace_back();
      record = {};
      record.name = hub.name.c_str();
      record.version = hub.version.c_str();
      record.edges = edges.data();
      record.edge_count = edges.size();
      record.hub_id = hub.hub_id;
      record.distance = hub.distance;
      record.cost = hub.cost;
      record.next_hop = hub.next_hop;
      record.nodes = hub.nodes;
      record.services = hub.services;
      record.reachable = hub.reachable ? 1 : 0;
      record.too_far = hub.too_far ? 1 : 0;
    }
  }
  [[nodiscard]] gimi_list list() {
    return {records_.size(), sizeof(gimi_network_hub_record), records_.data(),
            static_cast<RecordList*>(this)};
  }

 private:
  std::vector<NetworkHub> hubs_;
  std::vector<std::vector<gimi_edge>> edges_;
  std::vector<gimi_network_hub_record> records_;
};

/// A record that programs read by a pointer. One with a newer header reads zeros behind it.
template <class Record>
struct RoomyRecord {
  Record record{};
  std::array<std::byte, GIMI_RECORD_ROOM_BYTES> room{};
};

/// The memory of a gimi_watch_event.
struct EventStorage {
  explicit EventStorage(WatchEvent of) : event(std::move(of)) {
    if (event.node) node.record = record_of(*event.node);
    if (event.service) service.record = record_of(*event.service);
  }
  WatchEvent event;
  RoomyRecord<gimi_node_record> node;
  RoomyRecord<gimi_service_record> service;
};

}  // namespace

gimi_list list_of(std::vector<ShardCounts> shards) {
  return (new CounterList(std::move(shards)))->list();
}

gimi_list list_of(std::vector<NetworkHub> hubs) {
  return (new NetworkList(std::move(hubs)))->list();
}

gimi_watch_event event_of(WatchEvent event) {
  auto storage = std::make_unique<EventStorage>(std::move(event));
  gimi_watch_event told{};
  told.change = static_cast<gimi_change>(storage->event.change);
  told.hub_id = storage->event.hub_id;
  told.epoch = storage->event.epoch;
  told.version = storage->event.version;
  if (storage->event.node) told.node = &storage->node.record;
  if (storage->event.service) told.service = &storage->service.record;
  told.former_name = storage->event.former_name.c_str();
  told.why = storage->event.why.c_str();
  told.storage = storage.release();
  return told;
}

}  // namespace gimnet::gimi

extern "C" {

gimi_status gimi_list_get(const gimi_list* list, size_t index, void* record, size_t record_size) {
  if (list == nullptr || record == nullptr)
    return gimnet::gimi::fail(GIMI_BAD_ARGUMENT, "gimi_list_get(): list or record is NULL");
  if (index >= list->count)
    return gimnet::gimi::fail(GIMI_BAD_ARGUMENT, "gimi_list_get(): the list has no such index");
  if (record_size > gimnet::nif::kStructSizeMax)
    return gimnet::gimi::fail(GIMI_BAD_ARGUMENT, "gimi_list_get(): record_size is no record's");
  std::memset(record, 0, record_size);
  std::memcpy(record, static_cast<const char*>(list->records) + index * list->record_size,
              std::min(record_size, list->record_size));
  return GIMI_OK;
}

void gimi_list_release(gimi_list* list) {
  if (list == nullptr) return;
  delete static_cast<gimnet::gimi::RecordList*>(list->storage);
  *list = {};
}

void gimi_watch_event_release(gimi_watch_event* event) {
  if (event == nullptr) return;
  delete static_cast<gimnet::gimi::EventStorage*>(event->storage);
  *event = {};
}

}  // extern "C"
