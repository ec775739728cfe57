#include "hub/control/network_overview.hpp"

#include <algorithm>
#include <set>

namespace gimnet::hub {
namespace {

using proto::ctrl::LinkState;

std::vector<HubView::Edge> edges_of(const StoredRecord& record) {
  std::vector<HubView::Edge> edges;
  record.each_counting([&edges](const StoredPart& part) {
    for (const auto& neighbour : part.said.neighbours)
      edges.push_back({neighbour.hub.hub, neighbour.cost});
  });
  return edges;
}

}  // namespace

/// Its cost was neither configured nor measured yet.
bool NetworkOverview::is_unmeasured(LinkNumber number) const {
  const auto found = parts_.links.all().find(number);
  return found != parts_.links.all().end() && found->second->known_cost() == 0;
}

/// A link costs LinkCost::kUnmeasured until it was measured, which is no number for people.
void NetworkOverview::hide_unmeasured(std::vector<HubView::Edge>& own) const {
  for (const auto& [number, link] : parts_.links.all()) {
    if (!link->peer() || !is_unmeasured(number)) continue;
    for (HubView::Edge& edge : own)
      if (edge.hub == link->peer()->hub.hub && edge.cost == LinkCost::kUnmeasured) edge.cost = 0;
  }
}

std::vector<HubView> NetworkOverview::hubs() const {
  std::vector<HubView> hubs;
  const auto& store = parts_.links.network().store();
  const auto view = [&](const proto::HubKey& key) {
    HubView hub;
    hub.hub = key.hub;
    if (const StoredRecord* record = store.find(key); record != nullptr) {
      if (const auto* head = record->head(); head != nullptr) {
        hub.name = head->name;
        hub.version = head->version;
      }
      hub.neighbours = edges_of(*record);
    }
    return hub;
  };
  HubView self = view(parts_.links.network().self().key);
  self.name = parts_.facts.name;
  self.version = parts_.facts.version;
  self.reachable = true;
  hide_unmeasured(self.neighbours);
  hubs.push_back(std::move(self));
  for (const Way& way : parts_.links.network().map().ways()) {
    HubView hub = view(way.hub);
    hub.distance = way.hops;
    hub.cost = is_unmeasured(way.link) ? 0 : way.cost;
    hub.reachable = way.link != LinkNumber{};
    hub.too_far = !hub.reachable;
    hub.via = parts_.links.next_hops().find(way.hub.hub).neighbour;
    hubs.push_back(std::move(hub));
  }
  const auto& reachable = parts_.links.network().map().reachable();
  std::set<HubId> shown;
  for (const HubView& hub : hubs) shown.insert(hub.hub);
  for (const auto& [key, record] : store.records()) {
    // A hub that may link can invent others. One that lost its state, or its id, leaves a record
    // behind: each id is shown once.
    if (record.head() == nullptr || !record.was_reached) continue;
    if (std::ranges::binary_search(reachable, key)) continue;
    if (shown.insert(key.hub).second) hubs.push_back(view(key));
  }
  std::sort(hubs.begin() + 1, hubs.end(),
            [](const HubView& a, const HubView& b) { return a.hub < b.hub; });
  return hubs;
}

std::vector<LinkView> NetworkOverview::links() const {
  std::vector<LinkView> links;
  for (const auto& [number, link] : parts_.links.all()) links.push_back(view_of(*link));
  return links;
}

std::vector<NetworkView::Count> NetworkOverview::not_taken() const {
  const NameCopies* names = parts_.names.copies();
  return {{"links.malformed", parts_.links.malformed()},
          {"links.records_refused", parts_.links.network().hearsay()},
          {"links.joins_refused", parts_.groups.refused()},
          {"links.names_refused", names == nullptr ? 0 : names->refused()}};
}

LinkState NetworkOverview::state_of(const HubLink& link) const {
  if (link.is_over()) return LinkState::ended;
  if (!link.connected()) return link.resume_until() ? LinkState::away : LinkState::dialling;
  if (!parts_.links.network().is_up(link.number())) return LinkState::learning;
  if (link.damped_until()) return LinkState::damped;
  const auto& next = parts_.links.next_hops().find(link.peer()->hub.hub);
  if (!next.exists()) return LinkState::learning;
  const bool carries =
      next.neighbour != link.peer()->hub.hub || next.link.generation == link.place->generation;
  return carries ? LinkState::up : LinkState::standby;
}

LinkView NetworkOverview::view_of(const HubLink& link) const {
  LinkView view;
  view.name = link.name();
  view.peer = link.address;
  view.dialled = link.is_dialled();
  view.state = state_of(link);
  view.last_error = link.last_error;
  view.cost = link.known_cost();
  if (link.peer()) view.hub = link.peer()->hub.hub;
  const LinkClock& clock = link.clock();
  view.rtt_us = static_cast<std::uint32_t>(
      std::chrono::ceil<std::chrono::microseconds>(clock.round_trip_least).count());
  view.clock_offset_ns = clock.ahead.count();
  view.clock_error_ns = clock.error.count();
  SessionCounts counts = parts_.links.totals().of(link.number());
  if (link.place && link.place->shard.value() < parts_.sessions.size()) {
    counts += parts_.sessions[link.place->shard.value()]->counts(link.place->slot,
                                                                 link.place->generation);
  }
  view.queued_bytes = counts.queued_bytes;
  view.sent_bytes = counts.sent_bytes;
  view.received_bytes = counts.received_bytes;
  view.accepted = counts.accepted;
  view.delivered = counts.delivered;
  view.dropped = counts.dropped;
  view.unsure = counts.unsure;
  view.queue_full = counts.queue_full;
  return view;
}

}  // namespace gimnet::hub
