// One connection's queue: in and out at once, with a backlog under each policy, and as fragments of
// large messages.

#include <benchmark/benchmark.h>

#include <cstdint>
#include <string>
#include <vector>

#include "bench/hub/data/support/null_stream.hpp"
#include "tests/hub/data/support/egress_rig.hpp"

namespace gimnet::hub {
namespace {

using testing::EgressRig;
using testing::TestFrame;

void in_and_out(benchmark::State& state) {
  EgressRig rig;
  Outbox outbox;
  GatherWriter writer;
  benchmarks::NullStream transport;
  const hub::Run run = rig.run({std::string(static_cast<std::size_t>(state.range(0)), 'x')});
  const proto::FrameHeader header = run.header();
  for (auto _ : state) {
    outbox.push(run, header, {}, rig.context);
    benchmark::DoNotOptimize(writer.flush(outbox, nullptr, transport, rig.context));
    outbox.on_emptied(rig.context);
  }
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(in_and_out)->Arg(0)->Arg(16)->Arg(256)->Arg(1'000)->Arg(4'079)->Arg(4'080)->Arg(65'536);

/// A full lane that takes no more: what each message costs then.
void into_a_full_lane(benchmark::State& state, const TestFrame& frame) {
  EgressRig rig;
  Outbox outbox;
  const hub::Run run = rig.run({std::string(200, 'k')}, frame);
  const proto::FrameHeader header = run.header();
  for (std::uint64_t bytes = 0; bytes < rig.limits.lane1_bytes; bytes += run.size) {
    outbox.push(run, header, {}, rig.context);
  }
  outbox.settle(rig.context);
  for (auto _ : state) outbox.push(run, header, {}, rig.context);
  state.SetItemsProcessed(state.iterations());
  outbox.drop_all(proto::DropReason::link_lost, rig.context);
}
BENCHMARK_CAPTURE(into_a_full_lane, drop, TestFrame{.flags = 2});
BENCHMARK_CAPTURE(into_a_full_lane, oldest, TestFrame{.kind = proto::Kind::group});
BENCHMARK_CAPTURE(into_a_full_lane, latest, TestFrame{.flags = 3 | proto::kFlagKeyed});

/// Bursts of LATEST messages for a peer that comes too late for most: `range(0)` streams, each
/// replaced once, then all are written.
void bursts_of_streams(benchmark::State& state) {
  EgressRig rig;
  Outbox outbox;
  GatherWriter writer;
  benchmarks::NullStream transport;
  std::vector<hub::Run> runs;
  for (std::int64_t key = 0; key < state.range(0); ++key) {
    std::string payload(200, 'k');
    payload[0] = static_cast<char>(key % 128);
    payload[1] = static_cast<char>(key / 128);
    runs.push_back(rig.run({payload}, TestFrame{.flags = 3 | proto::kFlagKeyed}));
  }
  for (auto _ : state) {
    for (int round = 0; round < 2; ++round) {
      for (const hub::Run& run : runs) outbox.push(run, run.header(), {}, rig.context);
      outbox.settle(rig.context);
    }
    benchmark::DoNotOptimize(writer.flush(outbox, nullptr, transport, rig.context));
    outbox.on_emptied(rig.context);
  }
  state.SetItemsProcessed(state.iterations() * state.range(0) * 2);
}
BENCHMARK(bursts_of_streams)->Arg(10)->Arg(200);

/// A message of 1 MiB in fragments of 8 KiB, as it comes in a few turns.
void fragments(benchmark::State& state) {
  EgressRig rig;
  Outbox outbox;
  GatherWriter writer;
  benchmarks::NullStream transport;
  constexpr std::uint32_t kPiece = 8 * 1024;
  constexpr std::uint32_t kTotal = 1 << 20;
  constexpr std::uint32_t kPerTurn = 16;
  std::uint32_t number = 0;
  std::uint32_t offset = 0;
  for (auto _ : state) {
    for (std::uint32_t i = 0; i < kPerTurn; ++i) {
      rig.push_fragment(outbox, number, offset, kTotal, std::string(kPiece, 'f'));
      offset += kPiece;
      if (offset == kTotal) {
        offset = 0;
        ++number;
      }
    }
    benchmark::DoNotOptimize(writer.flush(outbox, nullptr, transport, rig.context));
    outbox.on_emptied(rig.context);
  }
  state.SetItemsProcessed(state.iterations() * kPerTurn);
  state.SetBytesProcessed(state.iterations() * kPerTurn * kPiece);
}
BENCHMARK(fragments);

}  // namespace
}  // namespace gimnet::hub
