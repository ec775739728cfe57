// The cost of writing and reading a message of a robot: some numbers, a name, and an array of a
// laser's ranges.

#include <benchmark/benchmark.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "proto/bitestream/reader.hpp"
#include "proto/bitestream/writer.hpp"

namespace {

using namespace gimnet::proto::bitestream;

void write_message(Writer& writer, std::span<const float> ranges) {
  writer.put_time(1, 1767225600000000000);
  writer.put_text(2, "laser");
  writer.put_f64(3, 1.5);
  writer.put_f64(4, -2.5);
  writer.put_f64(5, 0.1);
  writer.put_u32(6, 17);
  writer.begin_nested(7);
  writer.put_f32(1, 0.5f);
  writer.put_f32(2, 0.25f);
  writer.end_nested();
  writer.put_array(8, ranges);
}

void BM_Write(benchmark::State& state) {
  const std::vector<float> ranges(static_cast<std::size_t>(state.range(0)), 1.0f);
  std::array<std::byte, 8192> memory{};
  for (auto _ : state) {
    Writer writer{std::span(memory)};
    write_message(writer, ranges);
    benchmark::DoNotOptimize(writer.finish());
  }
  state.SetItemsProcessed(state.iterations() * 10);
}
BENCHMARK(BM_Write)->Arg(1)->Arg(180)->Arg(1080);

void BM_ReadInOrder(benchmark::State& state) {
  Writer writer;
  write_message(writer, std::vector<float>(static_cast<std::size_t>(state.range(0)), 1.0f));
  for (auto _ : state) {
    Reader reader(writer.bytes());
    while (const auto value = reader.next()) benchmark::DoNotOptimize(value->bytes().data());
  }
  state.SetItemsProcessed(state.iterations() * 8);
}
BENCHMARK(BM_ReadInOrder)->Arg(1)->Arg(180)->Arg(1080);

void BM_Find(benchmark::State& state) {
  Writer writer;
  write_message(writer, std::vector<float>(180, 1.0f));
  const Reader reader(writer.bytes());
  const Key key(static_cast<std::uint32_t>(state.range(0)));
  for (auto _ : state) benchmark::DoNotOptimize(reader.find(key)->bytes().data());
}
BENCHMARK(BM_Find)->Arg(1)->Arg(6)->Arg(8);

void BM_Check(benchmark::State& state) {
  Writer writer;
  write_message(writer, std::vector<float>(180, 1.0f));
  for (auto _ : state) benchmark::DoNotOptimize(is_valid(writer.bytes()));
}
BENCHMARK(BM_Check);

}  // namespace
