// The cost of finding frames in a read buffer of 256 KiB. Goal: 2 to 3 ns a frame of 32 bytes
// inside a run.

#include <benchmark/benchmark.h>

#include <cstddef>
#include <cstdint>
#include <vector>

#include "proto/frame/frame_parser.hpp"

namespace {

using namespace gimnet::proto;

constexpr std::size_t kBufferSize = 256 * 1024;

FrameHeader header_to(std::uint32_t dst, std::uint32_t length) {
  FrameHeader header;
  header.length = length;
  header.dst = dst;
  header.src = 0x00700011;
  return header;
}

/// A buffer of whole frames; `destinations` of them take turns.
std::vector<std::byte> buffer_of(std::uint32_t payload, std::uint32_t destinations) {
  std::vector<std::byte> buffer;
  for (std::uint32_t i = 0; buffer.size() + kHeaderSize + payload <= kBufferSize; ++i) {
    const std::size_t at = buffer.size();
    buffer.resize(at + kHeaderSize + payload);
    store_header(buffer.data() + at, header_to(0x00700012 + i % destinations, payload));
  }
  return buffer;
}

void read_runs(benchmark::State& state, const std::vector<std::byte>& buffer) {
  std::int64_t frames = 0;
  for (auto _ : state) {
    const std::byte* at = buffer.data();
    const std::byte* const end = at + buffer.size();
    while (at != end) {
      const NextRun next = next_run(at, end, kFrameLengthDefault);
      benchmark::DoNotOptimize(next.run.size);
      if (next.found != Found::run) break;
      at += next.run.size;
      frames += next.run.frames;
    }
  }
  state.SetItemsProcessed(frames);
  state.counters["per_frame"] = benchmark::Counter(
      static_cast<double>(frames), benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}

void BM_NextRunToOne(benchmark::State& state) {
  read_runs(state, buffer_of(static_cast<std::uint32_t>(state.range(0)), 1));
}
BENCHMARK(BM_NextRunToOne)->Arg(16)->Arg(256)->Arg(4096)->Arg(65'536 - 16);

void BM_NextRunInTurns(benchmark::State& state) {
  read_runs(state, buffer_of(16, static_cast<std::uint32_t>(state.range(0))));
}
BENCHMARK(BM_NextRunInTurns)->Arg(2)->Arg(8);

void BM_CheckHeader(benchmark::State& state) {
  FrameHeader header = header_to(0x00700012, 16);
  for (auto _ : state) {
    benchmark::DoNotOptimize(header);
    benchmark::DoNotOptimize(check_header_from_node(header));
  }
}
BENCHMARK(BM_CheckHeader);

void BM_ParseFrame(benchmark::State& state) {
  const auto buffer = buffer_of(16, 1);
  for (auto _ : state) {
    benchmark::DoNotOptimize(parse_frame(buffer, Origin::node).has_value());
  }
}
BENCHMARK(BM_ParseFrame);

}  // namespace
