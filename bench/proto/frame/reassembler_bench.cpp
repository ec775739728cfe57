// The cost of cutting a message and putting it together again, beside copying its bytes once.

#include <benchmark/benchmark.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "proto/frame/fragmenter.hpp"
#include "proto/frame/reassembler.hpp"

namespace {

using namespace gimnet::proto;

constexpr FragmentStream kStream{0x00700011, 0x00700012, Kind::unicast, 1};

void BM_Fragmenter(benchmark::State& state) {
  const auto total = static_cast<std::uint32_t>(state.range(0));
  for (auto _ : state) {
    Fragmenter fragmenter(total);
    while (!fragmenter.done()) benchmark::DoNotOptimize(fragmenter.next());
  }
  state.SetItemsProcessed(state.iterations() *
                          ((state.range(0) + kFragmentPayload - 1) / kFragmentPayload));
}
BENCHMARK(BM_Fragmenter)->Arg(1 << 20)->Arg(1 << 30);

void BM_Reassembler(benchmark::State& state) {
  const std::vector<std::byte> message(static_cast<std::size_t>(state.range(0)));
  Reassembler reassembler;
  std::uint32_t number = 0;
  for (auto _ : state) {
    Fragmenter fragmenter(static_cast<std::uint32_t>(message.size()));
    ++number;
    while (!fragmenter.done()) {
      const Piece piece = fragmenter.next();
      auto result = reassembler.take(kStream, {number, piece.offset, fragmenter.total()},
                                     std::span(message).subspan(piece.offset, piece.size));
      benchmark::DoNotOptimize(result.message.data());
    }
  }
  state.SetBytesProcessed(state.iterations() * state.range(0));
}
BENCHMARK(BM_Reassembler)->Arg(32 << 10)->Arg(64 << 10)->Arg(1 << 20)->Arg(16 << 20);

}  // namespace
