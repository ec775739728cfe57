// The cost of names and services for the conductor, and its growth: with 1,000, 10,000 and 100,000
// of each.

#include <benchmark/benchmark.h>

#include <map>
#include <memory>
#include <string>

#include "hub/control/state/listing.hpp"
#include "hub/control/state/watches.hpp"

namespace gimnet::hub {
namespace {

using std::chrono::milliseconds;

constexpr HubId kHub{7};
/// Services of one node: half of what the limit allows.
constexpr std::size_t kServicesPerNode = 500;
constexpr std::size_t kRobotsPerHall = 100;

/// A hub with so many nodes, in halls of 100, and as many services.
struct World {
  explicit World(std::size_t count) {
    limits.nodes = 1'000'000;
    for (std::size_t i = 0; i < count; ++i) join(i);
    for (std::size_t i = 0; i < count; ++i) advertise(i);
  }
  static std::string name(std::size_t i) {
    return "hall-" + std::to_string(i / kRobotsPerHall) + "/robot-" + std::to_string(i);
  }
  Session& join(std::size_t i) {
    JoinRequest request;
    request.name = name(i);
    request.description = "a robot";
    request.origin = PeerAddress{"tcp", "127.0.0.1:40000"};
    Session& session = *membership.join(request, milliseconds{0}, effects)->session;
    note();
    return session;
  }
  void leave(Session& session) {
    membership.connection_ended(session, {true, proto::GoodbyeCode::done, ""}, milliseconds{0},
                                effects);
    note();
  }
  void advertise(std::size_t i) {
    const std::string full_name = name(i / kServicesPerNode) + "/service-" + std::to_string(i);
    const NodeIndex provider{static_cast<std::uint32_t>(i / kServicesPerNode + 1)};
    static_cast<void>(
        membership.services().advertise(provider, full_name, {}, milliseconds{0}, effects));
    note();
  }
  void note() {
    for (const Effect& effect : effects) {
      if (const auto* node = std::get_if<NodeNoted>(&effect))
        watches.note(*node, membership, milliseconds{0});
      if (const auto* service = std::get_if<ServiceNoted>(&effect))
        watches.note(*service, membership, milliseconds{0});
    }
    effects.clear();
  }

  Limits limits;
  Effects effects;
  Membership membership{Sessions::Options{kHub, 1, Placement::spread}, limits};
  Watches watches{HubTitle{kHub, "lab"}, 1, limits};
};

World& world(benchmark::State& state) {
  static std::map<std::int64_t, std::unique_ptr<World>> worlds;
  auto& found = worlds[state.range(0)];
  if (!found) found = std::make_unique<World>(static_cast<std::size_t>(state.range(0)));
  return *found;
}

/// Names in an order that no cache foresees.
std::size_t scattered(std::size_t step, std::int64_t count) {
  return step * 7'919 % static_cast<std::size_t>(count);
}

void sizes(benchmark::internal::Benchmark* bench) { bench->Arg(1'000)->Arg(10'000)->Arg(100'000); }

void resolve(benchmark::State& state) {
  const World& hub = world(state);
  std::size_t step = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        hub.membership.directory().find(World::name(scattered(++step, state.range(0)))));
  }
}
BENCHMARK(resolve)->Apply(sizes);

void join_and_leave(benchmark::State& state) {
  World& hub = world(state);
  for (auto _ : state) hub.leave(hub.join(static_cast<std::size_t>(state.range(0)) + 5));
}
BENCHMARK(join_and_leave)->Apply(sizes);

/// A node that is there takes another name, and its own again.
void register_name(benchmark::State& state) {
  World& hub = world(state);
  Session& session =
      *hub.membership.sessions().find(NodeIndex{static_cast<std::uint32_t>(state.range(0))});
  const std::string own = World::name(static_cast<std::size_t>(state.range(0)) - 1);
  for (auto _ : state) {
    static_cast<void>(
        hub.membership.rename(session, "hall-0/another", milliseconds{0}, hub.effects));
    static_cast<void>(hub.membership.rename(session, own, milliseconds{0}, hub.effects));
    hub.note();
  }
}
BENCHMARK(register_name)->Apply(sizes);

void advertise_and_withdraw(benchmark::State& state) {
  World& hub = world(state);
  Services& services = hub.membership.services();
  std::size_t step = 0;
  for (auto _ : state) {
    const std::size_t robot = scattered(++step, state.range(0));
    const NodeIndex provider{static_cast<std::uint32_t>(robot + 1)};
    const auto added = services.advertise(provider, World::name(robot) + "/extra", {},
                                          milliseconds{0}, hub.effects);
    static_cast<void>(services.withdraw(provider, added->group, milliseconds{0}, hub.effects));
    hub.note();
  }
}
BENCHMARK(advertise_and_withdraw)->Apply(sizes);

void list_page(benchmark::State& state, const char* text) {
  const World& hub = world(state);
  const auto pattern = proto::Pattern::parse(text);
  for (auto _ : state) {
    const ListingRequest<NodeIndex> request{
        &*pattern, {}, false, hub.limits.page_records, hub.limits.scan_records};
    benchmark::DoNotOptimize(list_nodes(hub.membership, request));
  }
}
BENCHMARK_CAPTURE(list_page, one_hall, "hall-3/*")->Apply(sizes);
BENCHMARK_CAPTURE(list_page, all, "**")->Apply(sizes);
BENCHMARK_CAPTURE(list_page, none, "*/nobody")->Apply(sizes);

/// One robot of all, wherever it is: as many pieces of work as that takes.
void list_whole(benchmark::State& state) {
  const World& hub = world(state);
  const auto pattern = proto::Pattern::parse("*/robot-7");
  for (auto _ : state) {
    ListingRequest<NodeIndex> request{
        &*pattern, {}, false, hub.limits.page_records, hub.limits.scan_records};
    for (Listed<NodeIndex> listed = list_nodes(hub.membership, request); listed.more;
         listed = list_nodes(hub.membership, request)) {
      request.after = listed.next;
    }
  }
  state.SetItemsProcessed(state.iterations() * state.range(0));
}
BENCHMARK(list_whole)->Apply(sizes);

/// A snapshot of the nodes and services that fit.
void watch_snapshot(benchmark::State& state, const char* pattern) {
  World& hub = world(state);
  for (auto _ : state) {
    proto::ns::Watch wanted;
    wanted.watch = 1;
    wanted.pattern = pattern;
    static_cast<void>(hub.watches.watch(NodeIndex{1}, wanted));
    std::size_t frames = 1;
    while (frames != 0) {
      frames = 0;
      static_cast<void>(
          hub.watches.serve(hub.membership, milliseconds{0},
                            [&frames](NodeIndex, const proto::Payload&) { ++frames; }));
      hub.watches.taken(NodeIndex{1}, {1, 4});
    }
    static_cast<void>(hub.watches.unwatch(NodeIndex{1}, 1));
  }
}
BENCHMARK_CAPTURE(watch_snapshot, all, "")->Apply(sizes)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(watch_snapshot, one_hall, "hall-3/**")
    ->Apply(sizes)
    ->Unit(benchmark::kMillisecond);

/// A node joins and leaves before 100 watches of which one is about it.
void tell_100_watches(benchmark::State& state) {
  World& hub = world(state);
  const auto serve = [&hub] {
    const auto send = [](NodeIndex, const proto::Payload&) {};
    while (hub.watches.serve(hub.membership, milliseconds{0}, send)) {
    }
  };
  for (std::uint32_t node = 1; node <= 100; ++node) {
    proto::ns::Watch wanted;
    wanted.watch = 1;
    wanted.epoch = hub.watches.journal().epoch();
    wanted.version = hub.watches.journal().version();
    wanted.pattern =
        "hall-" +
        std::to_string(static_cast<std::size_t>(state.range(0)) / kRobotsPerHall + node - 1) + "/*";
    static_cast<void>(hub.watches.watch(NodeIndex{node}, wanted));
  }
  for (auto _ : state) {
    hub.leave(hub.join(static_cast<std::size_t>(state.range(0)) + 5));
    serve();
    hub.watches.taken(NodeIndex{1}, {1, 4});
  }
  for (std::uint32_t node = 1; node <= 100; ++node) hub.watches.connection_ended(NodeIndex{node});
}
BENCHMARK(tell_100_watches)->Apply(sizes);

}  // namespace
}  // namespace gimnet::hub
