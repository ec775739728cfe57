// The cost of one subscriber more or less for the conductor, in groups of 10, 1,000 and 10,000:
// published alone, or with the group as a whole, as it is when the service begins.

#include <benchmark/benchmark.h>

#include <map>
#include <memory>
#include <span>
#include <vector>

#include "hub/control/table_publisher.hpp"

namespace gimnet::hub {
namespace {

using std::chrono::milliseconds;

constexpr HubId kHub{7};
constexpr GroupIndex kGroup{1};

struct World {
  explicit World(std::size_t count) {
    for (std::size_t i = 0; i <= count; ++i) {
      subscribers.push_back((*membership.join({}, milliseconds{0}, effects)).session->index);
    }
    static_cast<void>(membership.services().advertise(subscribers[0], "robot/odom", {},
                                                      milliseconds{0}, effects));
    for (std::size_t i = 1; i <= count; ++i) {
      static_cast<void>(membership.services().subscribe(subscribers[i], "robot/odom", {}, effects));
    }
    publisher.publish_group(kGroup, membership);
    publisher.publish_members(kGroup, std::span{subscribers}.subspan(1), membership);
    effects.clear();
  }
  Limits limits;
  Effects effects;
  Membership membership{Sessions::Options{kHub, 2, Placement::spread}, limits};
  NodeTable nodes;
  GroupTable groups;
  Quiescence quiescence{2};
  TablePublisher publisher{kHub, 2, {nodes, groups, quiescence}};
  std::vector<NodeIndex> subscribers;
};

World& world(benchmark::State& state) {
  static std::map<std::int64_t, std::unique_ptr<World>> worlds;
  auto& found = worlds[state.range(0)];
  if (!found) found = std::make_unique<World>(static_cast<std::size_t>(state.range(0)));
  return *found;
}

/// Each iteration ends a subscription and begins it again: two changes.
template <class Publish>
void change(benchmark::State& state, Publish publish) {
  World& hub = world(state);
  Services& services = hub.membership.services();
  std::size_t step = 0;
  for (auto _ : state) {
    const NodeIndex node =
        hub.subscribers[1 + ++step * 7'919 % static_cast<std::size_t>(state.range(0))];
    static_cast<void>(services.unsubscribe(node, "robot/odom", {}, hub.effects));
    publish(hub, node);
    static_cast<void>(services.subscribe(node, "robot/odom", {}, hub.effects));
    publish(hub, node);
    hub.effects.clear();
  }
}

void change_member(benchmark::State& state) {
  change(state, [](World& hub, NodeIndex node) {
    hub.publisher.publish_members(kGroup, {&node, 1}, hub.membership);
  });
}
void change_all(benchmark::State& state) {
  change(state, [](World& hub, NodeIndex) {
    hub.publisher.publish_members(kGroup, std::span{hub.subscribers}.subspan(1), hub.membership);
  });
}

void sizes(benchmark::internal::Benchmark* bench) { bench->Arg(10)->Arg(1'000)->Arg(10'000); }
BENCHMARK(change_member)->Apply(sizes);
BENCHMARK(change_all)->Apply(sizes);

}  // namespace
}  // namespace gimnet::hub
