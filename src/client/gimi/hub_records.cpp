#include "client/gimi/hub_records.hpp"

#include <memory>
#include <span>
#include <utility>

#include "client/gimi/ending.hpp"
#include "client/gimi/uplink.hpp"
#include "client/nif/answer_status.hpp"
#include "client/nif/record_list.hpp"
#include "proto/control/ctrl_network.hpp"
#include "proto/control/ns.hpp"

namespace gimnet::gimi {
namespace {

template <class Request>
proto::bitestream::Writer body_of(const Request& request) {
  proto::bitestream::Writer body;
  request.write(body);
  return body;
}

/// Asks the hub and reads its answer.
template <class Answer, class Request>
Outcome<Answer> ask(Asking who, const Request& request, const std::string& doing, Timeout timeout,
                    std::uint8_t kind = NIF_CTRL) {
  const auto body = body_of(request);
  nif_reply* reply = nullptr;
  const nif_status status =
      nif_request_of_hub(who.node, who.hub_id, kind, Request::kOperation, body.bytes().data(),
                         body.size(), &reply, nif_timeout(timeout));
  if (status != NIF_OK) return failure_of(status, doing);
  const std::unique_ptr<nif_reply, void (*)(nif_reply*)> owner(reply, &nif_free_reply);
  if (reply->status != 0) {
    const auto wire = static_cast<proto::Status>(reply->status);
    return Failure{status_of(nif::status_of(wire)), "cannot " + doing + ": " + reply->sentence};
  }
  proto::Fields fields({static_cast<const std::byte*>(reply->content), reply->size}, Answer::kName);
  Answer answer = Answer::read(fields);
  if (fields.failed())
    return Failure{Status::protocol, "cannot " + doing + ": " + fields.error().sentence};
  return answer;
}

}  // namespace

namespace {

Delivery delivery_of(std::uint8_t delivery) {
  switch (delivery) {
    case NIF_LATEST_DELIVERY:
      return Delivery::latest;
    case NIF_SYNC_DELIVERY:
      return Delivery::sync;
    default:
      return Delivery::stream;
  }
}

}  // namespace

NodeRecord record_of(const nif_node_record& found) {
  return {Peer{found.id},    found.name,  found.hub_id,    found.hub_name, found.connected != 0,
          found.description, found.place, found.joined_ms, found.services};
}

ServiceRecord record_of(const nif_service_record& found) {
  return {found.name,
          Peer{found.node_id},
          {found.message_type, found.instance},
          found.direction == NIF_ACCEPTS ? Direction::accepts : Direction::provides,
          delivery_of(found.delivery),
          found.group,
          found.subscribers,
          found.metadata,
          found.hub_name,
          found.window,
          found.retain != 0,
          found.missed,
          Peer{found.missed_most}};
}

Outcome<std::vector<NodeRecord>> list_nodes(nif_node* node, const std::string& pattern,
                                            Timeout timeout) {
  nif_node_list* list = nullptr;
  const char* wanted = pattern.empty() ? nullptr : pattern.c_str();
  const nif_status status = nif_list_nodes(node, wanted, &list, nif_timeout(timeout));
  if (status != NIF_OK) return failure_of(status, "list the nodes");
  const std::unique_ptr<nif_node_list, void (*)(nif_node_list*)> owner(list, &nif_free_nodes);
  std::vector<NodeRecord> records;
  for (const nif_node_record& found : std::span(list->records, list->count))
    records.push_back(record_of(found));
  return records;
}

Outcome<std::vector<ServiceRecord>> list_services(nif_node* node, const std::string& pattern,
                                                  Timeout timeout, const std::string& doing) {
  nif_service_list* list = nullptr;
  const char* wanted = pattern.empty() ? nullptr : pattern.c_str();
  const nif_status status = nif_list_services(node, wanted, &list, nif_timeout(timeout));
  if (status != NIF_OK) return failure_of(status, doing);
  const std::unique_ptr<nif_service_list, void (*)(nif_service_list*)> owner(list,
                                                                             &nif_free_services);
  std::vector<ServiceRecord> records;
  for (const nif_service_record& found : std::span(list->records, list->count))
    records.push_back(record_of(found));
  return records;
}

bool may_come(nif_node* node, const std::string& name, Timeout timeout) {
  const auto body = body_of(proto::ns::Resolve{name});
  nif_reply* reply = nullptr;
  const nif_status status =
      nif_request(node, NIF_NS, proto::ns::Resolve::kOperation, body.bytes().data(), body.size(),
                  &reply, nif_timeout(timeout));
  if (status != NIF_OK) return true;
  const std::unique_ptr<nif_reply, void (*)(nif_reply*)> owner(reply, &nif_free_reply);
  const std::span content(static_cast<const std::byte*>(reply->content), reply->size);
  if (reply->status != 0) return proto::read_status(content).learning;
  proto::Fields fields(content, proto::ns::ResolveAnswer::kName);
  const auto answer = proto::ns::ResolveAnswer::read(fields);
  return fields.failed() || answer.learning || answer.standing != proto::ns::NameStanding::held;
}

Outcome<HubRecord> ask_hub(Asking who, Timeout timeout) {
  const auto answer = ask<proto::ctrl::HubInfoAnswer>(who, proto::ctrl::HubInfo{},
                                                      "ask the hub who it is", timeout);
  if (!answer) return answer.failure();
  return HubRecord{answer->hub.value(), answer->hub_name, answer->version, answer->shards,
                   answer->uptime_ms,   answer->nodes,    answer->services};
}

Outcome<std::vector<ShardCounts>> ask_counters(Asking who, Timeout timeout) {
  auto answer = ask<proto::ctrl::StatisticsAnswer>(who, proto::ctrl::Statistics{},
                                                   "ask the hub for its counters", timeout);
  if (!answer) return answer.failure();
  std::vector<ShardCounts> shards;
  for (const auto& shard : answer->shards) {
    ShardCounts& counts = shards.emplace_back();
    counts.shard = shard.shard;
    for (const auto& counter : shard.counters)
      counts.counters.emplace_back(counter.name, counter.value);
  }
  return shards;
}

Outcome<std::vector<ConnectionRecord>> ask_connections(Asking who, Timeout timeout) {
  const std::int64_t deadline = deadline_after(timeout);
  std::vector<ConnectionRecord> records;
  proto::ctrl::Connections request;
  for (;;) {
    const auto page = ask<proto::ctrl::ConnectionsAnswer>(
        who, request, "ask the hub for its connections", Timeout{nif_timeout_until(deadline)});
    if (!page) return page.failure();
    for (const auto& found : page->connections) {
      if (found.node <= request.after)
        return records;  // a hub that goes round in circles is not followed
      request.after = found.node;
      const proto::ctrl::ConnectionCounts& counts = found.counts;
      records.push_back({Peer{found.node.value()}, found.name, found.shard, found.transport,
                         found.peer, found.connected, counts.queued_bytes, counts.accepted,
                         counts.received_bytes, counts.delivered, counts.sent_bytes, counts.dropped,
                         counts.missed, counts.queue_full});
    }
    if (!page->more || page->connections.empty()) return records;
  }
}

Outcome<std::vector<NetworkHub>> ask_hubs(Asking who, Timeout timeout) {
  const std::int64_t deadline = deadline_after(timeout);
  std::vector<NetworkHub> records;
  proto::ctrl::Hubs request;
  for (;;) {
    const auto page = ask<proto::ctrl::HubsAnswer>(who, request, "ask the hub for those it knows",
                                                   Timeout{nif_timeout_until(deadline)});
    if (!page) return page.failure();
    for (const auto& found : page->hubs) {
      if (found.hub <= request.after) return records;  // as in ask_connections()
      request.after = found.hub;
      NetworkHub& hub = records.emplace_back();
      hub.hub_id = found.hub.value();
      hub.name = found.hub_name;
      hub.version = found.version;
      hub.distance = found.distance;
      hub.cost = found.cost;
      hub.next_hop = found.next_hop.value();
      hub.nodes = found.nodes;
      hub.services = found.services;
      hub.reachable = found.reachable;
      hub.too_far = found.too_far;
      for (const auto& edge : found.edges) hub.edges.push_back({edge.hub.value(), edge.cost});
    }
    if (!page->more || page->hubs.empty()) return records;
  }
}

Outcome<std::vector<LinkRecord>> ask_links(Asking who, Timeout timeout) {
  const std::int64_t deadline = deadline_after(timeout);
  std::vector<LinkRecord> records;
  for (;;) {
    const proto::ctrl::LinksRequest request{.skip = static_cast<std::uint32_t>(records.size())};
    const auto page = ask<proto::ctrl::LinksAnswer>(who, request, "ask the hub for its links",
                                                    Timeout{nif_timeout_until(deadline)});
    if (!page) return page.failure();
    for (const auto& link : page->links) {
      const proto::ctrl::LinkCounts& counts = link.counts;
      records.push_back(
          {link.name, link.hub.value(), link.peer, proto::ctrl::link_state_name(link.state),
           link.dialled, link.cost, link.rtt_us, link.clock_offset_ns, link.clock_error_ns,
           counts.queued_bytes, counts.sent_bytes, counts.received_bytes, counts.accepted,
           counts.delivered, counts.dropped, counts.unsure, link.last_error, counts.queue_full});
    }
    if (!page->more || page->links.empty()) return records;
  }
}

Outcome<std::vector<ServiceRecord>> ask_missed(Asking who, Timeout timeout) {
  const std::int64_t deadline = deadline_after(timeout);
  std::vector<ServiceRecord> records;
  proto::ns::ServicesRequest request;
  request.missed = true;
  for (;;) {
    const auto page =
        ask<proto::ns::ServicesAnswer>(who, request, "ask the hub for missed messages",
                                       Timeout{nif_timeout_until(deadline)}, NIF_NS);
    if (!page) return page.failure();
    for (const auto& found : page->services) records.push_back(record_of(nif::view_of(found)));
    if (!page->more || page->next <= request.after) return records;
    request.after = page->next;
  }
}

Outcome<std::string> kick(nif_node* node, Peer peer, std::string_view reason, Timeout timeout) {
  if (reason.size() > proto::kRemarkBytesMax) {
    return Failure{Status::bad_argument, "cannot kick " + peer.text() + ": the reason has " +
                                             std::to_string(reason.size()) + " bytes, and " +
                                             std::to_string(proto::kRemarkBytesMax) +
                                             " are the most; shorten it"};
  }
  const proto::ctrl::Kick request{NodeId{peer.id}, std::string(reason)};
  const auto answer = ask<proto::ctrl::KickAnswer>({node}, request, "kick " + peer.text(), timeout);
  if (!answer) return answer.failure();
  return answer->remark;
}

Outcome<void> reassign(nif_node* node, Peer peer, Peer new_id, Timeout timeout) {
  const proto::ctrl::Reassign request{NodeId{peer.id}, NodeId{new_id.id}};
  const std::string doing = "give " + peer.text() + " the id " + new_id.text();
  const auto answer = ask<proto::ctrl::ReassignAnswer>({node}, request, doing, timeout);
  if (!answer) return answer.failure();
  return {};
}

Outcome<void> drain_hub(nif_node* node, Timeout timeout) {
  const auto answer =
      ask<proto::ctrl::DrainAnswer>({node}, proto::ctrl::Drain{}, "drain the hub", timeout);
  if (!answer) return answer.failure();
  return {};
}

Outcome<std::vector<HubChange>> reload_hub(nif_node* node, Timeout timeout) {
  const std::string doing = "have the hub read its configuration again";
  auto answer = ask<proto::ctrl::ReloadAnswer>({node}, proto::ctrl::Reload{}, doing, timeout);
  if (!answer) return answer.failure();
  std::vector<HubChange> changes;
  for (auto& change : answer->changes) {
    changes.push_back({std::move(change.key), std::move(change.from), std::move(change.to),
                       change.needs_restart});
  }
  return changes;
}

Outcome<std::string> set_hub_log_level(nif_node* node, std::string_view level, Timeout timeout) {
  const proto::ctrl::SetLogLevel request{std::string(level)};
  const auto answer =
      ask<proto::ctrl::SetLogLevelAnswer>({node}, request, "set the hub's log level", timeout);
  if (!answer) return answer.failure();
  return answer->before;
}

namespace {

template <class Request>
Outcome<void> change_link(nif_node* node, const Request& request, const std::string& doing,
                          Timeout timeout) {
  const auto answer = ask<proto::ctrl::LinkChanged<Request>>({node}, request, doing, timeout);
  if (!answer) return answer.failure();
  return {};
}

}  // namespace

Outcome<void> add_link(nif_node* node, const proto::ctrl::LinkAdd& link, Timeout timeout) {
  return change_link(node, link, "add the link", timeout);
}

Outcome<void> remove_link(nif_node* node, std::string_view name, Timeout timeout) {
  return change_link(node, proto::ctrl::LinkRemove{std::string(name)}, "remove the link", timeout);
}

Outcome<void> set_link_cost(nif_node* node, std::string_view name, std::uint16_t cost,
                            Timeout timeout) {
  return change_link(node, proto::ctrl::SetLinkCost{std::string(name), cost},
                     "set the cost of the link", timeout);
}

}  // namespace gimnet::gimi
