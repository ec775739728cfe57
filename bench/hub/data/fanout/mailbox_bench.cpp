// The cost of handing a stretch of frames to another shard, on one thread: without the other CPU's
// cache misses.

#include <benchmark/benchmark.h>

#include "hub/data/fanout/mailbox.hpp"

namespace gimnet::hub {
namespace {

void post_and_take(benchmark::State& state) {
  Waker waker;
  Mailbox mailbox(2, {.entries = 8'192, .bytes = 16u << 20}, waker);
  const std::int64_t burst = state.range(0);
  Mail mail;
  mail.size = 32;
  mail.frames = 1;
  std::uint64_t frames = 0;
  for (auto _ : state) {
    for (std::int64_t i = 0; i < burst; ++i) mailbox.post(ShardIndex{1}, mail);
    mailbox.drain(10'000, [] {}, [&](const Mail& taken) { frames += taken.frames; });
  }
  benchmark::DoNotOptimize(frames);
  state.SetItemsProcessed(state.iterations() * burst);
}
BENCHMARK(post_and_take)->Arg(1)->Arg(32)->Arg(1'024);

void ask_for_room(benchmark::State& state) {
  Waker waker;
  Mailbox mailbox(2, {.entries = 8'192, .bytes = 16u << 20}, waker);
  for (auto _ : state) {
    benchmark::DoNotOptimize(mailbox.full(ShardIndex{1}, 1'000));
    benchmark::DoNotOptimize(mailbox.crowded(ShardIndex{1}));
  }
}
BENCHMARK(ask_for_room);

}  // namespace
}  // namespace gimnet::hub
