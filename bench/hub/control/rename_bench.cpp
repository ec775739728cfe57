// The cost of a new name for the conductor: REGISTER withdraws every service of the node and tells
// every subscriber. 1,000 subscribers of each service.

#include <benchmark/benchmark.h>
#include <malloc.h>

#include <memory>
#include <string>
#include <vector>

#include "hub/control/effect_runner.hpp"
#include "hub/data/tables/group_table.hpp"
#include "hub/data/tables/node_table.hpp"

namespace gimnet::hub {
namespace {

using std::chrono::milliseconds;

constexpr HubId kHub{7};
constexpr std::size_t kSubscribers = 1'000;

/// Keeps what shards are told, as a shard that is busy does.
class BusyShards final : public ShardProxy {
 public:
  void send(ShardIndex, ShardCommand command) override { commands.push_back(std::move(command)); }
  [[nodiscard]] std::size_t shards() const override { return 2; }
  std::vector<ShardCommand> commands;
};

double heap_megabytes() {
  const struct mallinfo2 info = ::mallinfo2();
  return static_cast<double>(info.uordblks + info.hblkhd) / 1e6;
}

/// A provider with so many services, all of which 1,000 others have subscribed to.
struct World {
  explicit World(std::size_t services) {
    facts.id = kHub;
    facts.shards = shards.shards();
    provider = &join("robot");
    for (std::size_t i = 0; i < kSubscribers; ++i) {
      const NodeIndex reader = join("reader-" + std::to_string(i)).index;
      for (std::size_t k = 0; k < services; ++k)
        static_cast<void>(membership.services().subscribe(reader, full_name(k), {}, effects));
    }
    for (std::size_t k = 0; k < services; ++k) {
      static_cast<void>(membership.services().advertise(provider->index, full_name(k), {},
                                                        milliseconds{0}, effects));
    }
    carry_out();
    std::vector<ShardCommand>{}.swap(shards.commands);
  }
  static std::string full_name(std::size_t k) { return "robot/service-" + std::to_string(k); }
  Session& join(const std::string& name) {
    JoinRequest request;
    request.name = name;
    return *membership.join(request, milliseconds{0}, effects)->session;
  }
  void carry_out() {
    runner.carry_out(effects, milliseconds{0});
    while (runner.tell_rest()) {
    }
    effects = {};
  }

  HubFacts facts;
  Limits limits;
  Effects effects;
  BusyShards shards;
  NodeTable nodes;
  GroupTable groups;
  Quiescence quiescence{2};
  Membership membership{Sessions::Options{kHub, 2, Placement::spread}, limits};
  Watches watches{HubTitle{kHub, "lab"}, 1, limits};
  TablePublisher publisher{kHub, 2, {nodes, groups, quiescence}};
  StateKeeper keeper{HubState{}, {}};
  EffectRunner runner{{facts, limits, shards, membership, watches, publisher, keeper}};
  Session* provider = nullptr;
};

void new_name(benchmark::State& state) {
  double megabytes = 0;
  for (auto _ : state) {
    state.PauseTiming();
    auto world = std::make_unique<World>(static_cast<std::size_t>(state.range(0)));
    const double before = heap_megabytes();
    state.ResumeTiming();
    static_cast<void>(
        world->membership.rename(*world->provider, "lifter", milliseconds{0}, world->effects));
    world->carry_out();
    state.PauseTiming();
    megabytes = heap_megabytes() - before;
    state.counters["commands"] = static_cast<double>(world->shards.commands.size());
    world.reset();
    state.ResumeTiming();
  }
  state.counters["heap_MB"] = megabytes;
}
BENCHMARK(new_name)->Arg(10)->Arg(1'000)->Iterations(1)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace gimnet::hub
