// What it costs to route one frame: the same with 10 nodes as with 10,000, but for the caches.

#include <benchmark/benchmark.h>

#include "bench/hub/data/support/null_transport.hpp"
#include "tests/hub/data/support/route_rig.hpp"

namespace gimnet::hub {
namespace {

constexpr std::uint32_t kFramesPerTurn = 512;

/// One turn: frames of 16 bytes to nodes in turn, routed and written.
void forward_in_turns(benchmark::State& state) {
  testing::RouteRig rig;
  const auto nodes = static_cast<std::uint32_t>(state.range(0));
  for (std::uint32_t i = 0; i < nodes; ++i) rig.add_here(2 + i);
  benchmarks::NullTransport transport;
  std::vector<GatherWriter> writers(nodes + 2);
  std::uint32_t next = 0;
  for (auto _ : state) {
    for (std::uint32_t i = 0; i < kFramesPerTurn; ++i) {
      const hub::Run run = rig.make_run(7u << 20 | (2 + next), {"0123456789abcdef"});
      next = next + 1 == nodes ? 0 : next + 1;
      rig.router.route(run, run.header());
    }
    for (Recipient* recipient : rig.recipients.dirty()) {
      recipient->dirty = false;
      benchmark::DoNotOptimize(
          writers[recipient->slot.value()].flush(recipient->outbox, nullptr, transport, rig.egress.context));
      recipient->outbox.on_emptied(rig.egress.context);
    }
    rig.recipients.dirty().clear();
  }
  state.SetItemsProcessed(state.iterations() * kFramesPerTurn);
}
BENCHMARK(forward_in_turns)->Arg(10)->Arg(100)->Arg(1'000)->Arg(10'000);

/// Runs of frames of 16 bytes to one node: what a burst costs.
void forward_a_burst(benchmark::State& state) {
  testing::RouteRig rig;
  Recipient& recipient = rig.add_here(2);
  benchmarks::NullTransport transport;
  GatherWriter writer;
  const hub::Run run = rig.make_run(7u << 20 | 2, std::vector<std::string>(kFramesPerTurn, "0123456789abcdef"));
  const proto::FrameHeader header = run.header();
  for (auto _ : state) {
    rig.router.route(run, header);
    benchmark::DoNotOptimize(writer.flush(recipient.outbox, nullptr, transport, rig.egress.context));
    recipient.outbox.on_emptied(rig.egress.context);
  }
  state.SetItemsProcessed(state.iterations() * kFramesPerTurn);
}
BENCHMARK(forward_a_burst);

}  // namespace
}  // namespace gimnet::hub
