#include "hub/control/handle/network.hpp"

#include <algorithm>
#include <tuple>

#include "net/proxy_address.hpp"
#include "proto/control/ctrl_network.hpp"

namespace gimnet::hub {
namespace {

namespace ctrl = proto::ctrl;
using proto::Refusal;
using proto::Status;

HubView own_view(const HandlerContext& context) {
  HubView own;
  own.hub = context.facts.id;
  own.name = context.facts.name;
  own.version = context.facts.version;
  own.reachable = true;
  return own;
}

ctrl::HubRecord record_of(const HandlerContext& context, const HubView& hub) {
  const bool own = hub.hub == context.facts.id && hub.distance == 0;
  ctrl::HubRecord record{.hub = hub.hub,
                         .hub_name = hub.name,
                         .next_hop = own ? hub.hub : hub.via,
                         .cost = hub.cost,
                         .nodes = hub.nodes,
                         .services = hub.services,
                         .distance = hub.distance,
                         .reachable = hub.reachable,
                         .too_far = hub.too_far,
                         .version = hub.version};
  const NameCopies* names = context.names != nullptr ? context.names->copies() : nullptr;
  if (names != nullptr) {
    const NameIndex::Counts counts = names->counts_of(hub.hub);
    record.nodes = counts.nodes;
    record.services = counts.services;
  }
  if (own) {
    record.nodes = static_cast<std::uint32_t>(context.membership.sessions().all().size());
    record.services = static_cast<std::uint32_t>(context.membership.topics().provided());
  }
  for (const HubView::Edge& edge : hub.neighbours) record.edges.push_back({edge.hub, edge.cost});
  return record;
}

ctrl::HubsAnswer hubs(const HandlerContext& context, const ctrl::Hubs& wanted) {
  std::vector<HubView> all{own_view(context)};
  if (context.network != nullptr) all = context.network->hubs();
  std::ranges::sort(all, {}, &HubView::hub);
  ctrl::HubsAnswer answer;
  PageBudget budget(context.limits, wanted.records_max);
  for (const HubView& hub : all) {
    if (hub.hub <= wanted.after) continue;
    ctrl::HubRecord record = record_of(context, hub);
    if (!budget.take(ctrl::page_bytes_max(record))) {
      answer.more = true;
      break;
    }
    answer.hubs.push_back(std::move(record));
  }
  return answer;
}

ctrl::LinkRecord record_of(const LinkView& link) {
  return {.name = link.name,
          .hub = link.hub,
          .peer = link.peer,
          .state = link.state,
          .dialled = link.dialled,
          .cost = link.cost,
          .rtt_us = link.rtt_us,
          .clock_offset_ns = link.clock_offset_ns,
          .clock_error_ns = static_cast<std::uint64_t>(link.clock_error_ns),
          .counts = {link.queued_bytes, link.sent_bytes, link.received_bytes, link.accepted,
                     link.delivered, link.dropped, link.unsure, link.queue_full},
          .last_error = link.last_error};
}

ctrl::LinksAnswer links(const HandlerContext& context, const ctrl::LinksRequest& wanted) {
  std::vector<LinkView> all;
  if (context.network != nullptr) all = context.network->links();
  std::ranges::sort(all, [](const LinkView& a, const LinkView& b) {
    return std::tie(a.name, a.hub, a.peer) < std::tie(b.name, b.hub, b.peer);
  });
  ctrl::LinksAnswer answer;
  PageBudget budget(context.limits, wanted.records_max);
  for (std::size_t i = wanted.skip; i < all.size(); ++i) {
    ctrl::LinkRecord record = record_of(all[i]);
    if (!budget.take(ctrl::page_bytes_max(record))) {
      answer.more = true;
      break;
    }
    answer.links.push_back(std::move(record));
  }
  return answer;
}

template <class Message>
using Changed = Result<ctrl::LinkChanged<Message>, Refusal>;

/// Of a change that failed for `why`, if it did.
template <class Message>
Changed<Message> changed(Status status, const std::string& why) {
  if (!why.empty()) return Refusal{status, why};
  return ctrl::LinkChanged<Message>{};
}

Refusal alone() { return {Status::not_supported, "this hub can have no links to other hubs"}; }

Changed<ctrl::LinkAdd> add(HandlerContext& context, const ctrl::LinkAdd& wanted) {
  if (context.network == nullptr) return alone();
  Result<DialledLink> link = make_link(wanted.url, wanted.name);
  if (!link) return Refusal{Status::bad_request, link.error().sentence};
  if (!context.facts.insecure && !is_local(link->address)) {
    return Refusal{
        Status::bad_request,
        not_encrypted(link->address, "insecure = true in the configuration and start it again")};
  }
  link->cost = wanted.cost;
  if (!wanted.proxy.empty()) {
    const Result<net::ProxyAddress> proxy = net::proxy_towards(link->address, wanted.proxy);
    if (!proxy) return Refusal{Status::bad_request, proxy.error().sentence};
  }
  link->proxy = wanted.proxy;
  return changed<ctrl::LinkAdd>(Status::bad_request, context.network->add_link(*link));
}

}  // namespace

proto::Payload handle_hubs(HandlerContext& context, const Request& request) {
  return answer_to<ctrl::Hubs>(request, [&](const ctrl::Hubs& wanted) {
    return Result<ctrl::HubsAnswer, Refusal>(hubs(context, wanted));
  });
}

proto::Payload handle_links(HandlerContext& context, const Request& request) {
  return answer_to<ctrl::LinksRequest>(request, [&](const ctrl::LinksRequest& wanted) {
    return Result<ctrl::LinksAnswer, Refusal>(links(context, wanted));
  });
}

proto::Payload handle_link_add(HandlerContext& context, const Request& request) {
  return answer_to<ctrl::LinkAdd>(
      request, [&](const ctrl::LinkAdd& wanted) { return add(context, wanted); });
}

proto::Payload handle_link_remove(HandlerContext& context, const Request& request) {
  return answer_to<ctrl::LinkRemove>(
      request, [&](const ctrl::LinkRemove& wanted) -> Changed<ctrl::LinkRemove> {
        if (context.network == nullptr) return alone();
        return changed<ctrl::LinkRemove>(Status::not_found,
                                         context.network->remove_link(wanted.name));
      });
}

proto::Payload handle_link_cost(HandlerContext& context, const Request& request) {
  return answer_to<ctrl::SetLinkCost>(
      request, [&](const ctrl::SetLinkCost& wanted) -> Changed<ctrl::SetLinkCost> {
        if (context.network == nullptr) return alone();
        return changed<ctrl::SetLinkCost>(Status::not_found,
                                          context.network->set_link_cost(wanted.name, wanted.cost));
      });
}

}  // namespace gimnet::hub
