#include "hub/network/state/network_map.hpp"

#include <algorithm>
#include <compare>
#include <tuple>

namespace gimnet::hub {
namespace {

using proto::HubKey;
using proto::route::Neighbour;

using Place = std::uint32_t;  ///< of a hub in the graph
constexpr std::uint32_t kNobody = UINT32_MAX;

struct Edge {
  Place to = 0;
  std::uint32_t cost = 0;
};

/// A way to compare: the lower one is better. The neighbours of this hub are numbered by hub id.
struct Label {
  std::uint32_t cost = UINT32_MAX;
  std::uint32_t hops = 0;
  std::uint32_t neighbour = kNobody;
  friend auto operator<=>(const Label&, const Label&) = default;
};

/// The edges that hubs report.
class Graph {
 public:
  Graph(const HubKey& self, const RecordStore& store, std::span<const CarryingLink> neighbours) {
    for (const auto& [hub, record] : store.records()) hubs_.push_back(hub);
    if (!std::ranges::binary_search(hubs_, self)) {
      hubs_.insert(std::ranges::lower_bound(hubs_, self), self);
    }
    reported_.resize(hubs_.size());
    for (const auto& [hub, record] : store.records()) {
      if (hub == self) continue;
      record.each_counting([this, from = place_of(hub)](const StoredPart& part) {
        for (const Neighbour& each : part.said.neighbours) report(from, each);
      });
    }
    // Of itself a hub knows more than it said last.
    for (const CarryingLink& each : neighbours) report(place_of(self), each.neighbour);
    for (auto& edges : reported_) std::ranges::sort(edges, {}, &Edge::to);
  }

  [[nodiscard]] const std::vector<HubKey>& hubs() const { return hubs_; }
  /// kNobody: there is no record.
  [[nodiscard]] Place place_of(const HubKey& hub) const {
    const auto found = std::ranges::lower_bound(hubs_, hub);
    return found != hubs_.end() && *found == hub ? static_cast<Place>(found - hubs_.begin())
                                                 : kNobody;
  }
  /// Calls `visit(Edge)` for each edge from there that both ends report, with the higher cost.
  template <class Visit>
  void each_edge(Place from, Visit visit) const {
    for (const Edge& edge : reported_[from]) {
      const auto& back = reported_[edge.to];
      const auto found = std::ranges::lower_bound(back, from, {}, &Edge::to);
      if (found == back.end() || found->to != from) continue;
      visit(Edge{edge.to, std::max(edge.cost, found->cost)});
    }
  }

 private:
  void report(Place from, const Neighbour& neighbour) {
    const Place to = place_of(neighbour.hub);
    if (to != kNobody && to != from) reported_[from].push_back({to, neighbour.cost});
  }

  std::vector<HubKey> hubs_;  ///< ascending
  std::vector<std::vector<Edge>> reported_;
};

/// The best way to each hub (E. W. Dijkstra, A Note on Two Problems in Connexion with Graphs). All
/// costs are above 0, so the ways of all hubs together have no loop.
class ShortestWays {
 public:
  ShortestWays(const Graph& graph, Place self, std::span<const CarryingLink> neighbours)
      : labels_(graph.hubs().size()) {
    labels_[self] = {0, 0, kNobody};
    graph.each_edge(self, [&](const Edge& edge) {
      const auto found =
          std::ranges::lower_bound(neighbours, graph.hubs()[edge.to], {},
                                   [](const auto& each) { return each.neighbour.hub; });
      improve(edge.to, {edge.cost, 1, static_cast<std::uint32_t>(found - neighbours.begin())});
    });
    while (!waiting_.empty()) {
      std::ranges::pop_heap(waiting_, std::greater{});
      const auto [label, at] = waiting_.back();
      waiting_.pop_back();
      if (label != labels_[at]) continue;  // a better one came
      graph.each_edge(at, [&](const Edge& edge) {
        improve(edge.to, {label.cost + edge.cost, label.hops + 1, label.neighbour});
      });
    }
  }

  [[nodiscard]] const Label& to(Place hub) const { return labels_[hub]; }

 private:
  void improve(Place hub, const Label& label) {
    if (label >= labels_[hub]) return;
    labels_[hub] = label;
    waiting_.emplace_back(label, hub);
    std::ranges::push_heap(waiting_, std::greater{});
  }

  std::vector<Label> labels_;
  std::vector<std::pair<Label, Place>> waiting_;  ///< a heap, the best first
};

}  // namespace

std::optional<HubIdentity> identity_of(const StoredRecord& record) {
  const auto* head = record.head();
  if (head == nullptr) return std::nullopt;
  return HubIdentity{head->hub, head->instance, head->configured};
}

NetworkMap::NetworkMap(const HubIdentity& self, const RecordStore& store,
                       std::span<const CarryingLink> neighbours) {
  const Graph graph(self.key, store, neighbours);
  const ShortestWays shortest(graph, graph.place_of(self.key), neighbours);
  std::vector<Way> ways;
  for (Place at = 0; at < graph.hubs().size(); ++at) {
    const Label& label = shortest.to(at);
    if (label.cost == UINT32_MAX) continue;
    reachable_.push_back(graph.hubs()[at]);
    if (label.neighbour == kNobody) continue;  // this hub itself
    Way way{graph.hubs()[at], neighbours[label.neighbour].link, label.cost,
            static_cast<std::uint16_t>(label.hops)};
    if (way.hops > proto::kHopsMax) way.link = LinkNumber{};
    ways.push_back(way);
  }
  keep_preferred(self, store, ways);
}

void NetworkMap::keep_preferred(const HubIdentity& self, const RecordStore& store,
                                const std::vector<Way>& ways) {
  const auto identity = [&store](const HubKey& hub) { return *identity_of(*store.find(hub)); };
  for (const Way& way : ways) {
    if (way.hub.hub == self.key.hub) {
      if (is_preferred(identity(way.hub), self)) own_id_holder_ = way;
      continue;
    }
    if (!ways_.empty() && ways_.back().hub.hub == way.hub.hub) {
      if (!is_preferred(identity(way.hub), identity(ways_.back().hub))) continue;
      ways_.pop_back();
    }
    ways_.push_back(way);
    next_hops_[way.hub.hub.value()] = way.link;
  }
}

}  // namespace gimnet::hub
