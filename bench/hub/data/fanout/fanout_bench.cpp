// One frame to many recipients, by a copy each or by a reference each, queued and written.

#include <benchmark/benchmark.h>

#include "bench/hub/data/support/null_stream.hpp"
#include "tests/hub/data/support/route_rig.hpp"

namespace gimnet::hub {
namespace {

void fan_out(benchmark::State& state, bool by_reference) {
  testing::RouteRig rig;
  const auto recipients = static_cast<std::uint32_t>(state.range(0));
  const auto bytes = static_cast<std::size_t>(state.range(1));
  for (std::uint32_t i = 0; i < recipients; ++i) rig.add_here(2 + i);
  benchmarks::NullStream transport;
  GatherWriter writer;
  const hub::Run run =
      rig.make_run(7u << 20 | 1, {std::string(bytes, 'x')}, {.kind = proto::Kind::group});
  const proto::FrameHeader header = run.header();
  for (auto _ : state) {
    for (const auto& recipient : rig.recipients_made) {
      rig.fanout.deliver(*recipient, run, header, Handover{by_reference});
    }
    for (Recipient* recipient : rig.recipients.dirty()) {
      recipient->dirty = false;
      benchmark::DoNotOptimize(
          writer.flush(recipient->outbox, nullptr, transport, rig.egress.context));
      recipient->outbox.on_emptied(rig.egress.context);
    }
    rig.recipients.dirty().clear();
  }
  state.SetItemsProcessed(state.iterations() * recipients);
}

/// Above a kilobyte there is a reference in both: a frame is never copied then.
void sizes(benchmark::internal::Benchmark* bench) {
  for (const std::int64_t recipients : {10, 100, 1'000}) {
    for (const std::int64_t bytes : {16, 256, 1'000, 4'096, 65'536})
      bench->Args({recipients, bytes});
  }
}
BENCHMARK_CAPTURE(fan_out, by_copy, false)->Apply(sizes);
BENCHMARK_CAPTURE(fan_out, by_reference, true)->Apply(sizes);

/// Ten recipients, the last of them in that slot: those between are free.
void broadcast(benchmark::State& state) {
  testing::RouteRig rig;
  for (std::uint32_t i = 0; i < 9; ++i) rig.add_here(2 + i);
  rig.add_here(static_cast<std::uint32_t>(state.range(0)));
  const hub::Run run =
      rig.make_run(7u << 20 | kEveryIndex, {"x"}, {.kind = proto::Kind::broadcast});
  for (auto _ : state) {
    rig.route(run);
    for (Recipient* recipient : rig.recipients.dirty()) {
      recipient->dirty = false;
      recipient->outbox.drop_all(proto::DropReason::link_lost, rig.egress.context);
    }
    rig.recipients.dirty().clear();
    static_cast<void>(rig.take_mail());
  }
  state.SetItemsProcessed(state.iterations() * 10);
}
BENCHMARK(broadcast)->Arg(11)->Arg(1'000)->Arg(10'000)->Arg(100'000);

}  // namespace
}  // namespace gimnet::hub
