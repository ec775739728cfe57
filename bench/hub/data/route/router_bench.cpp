// The cost of forwarding one frame of 16 bytes, from a read buffer of 256 KiB as a shard sees it:
// parsed, routed, written. By how many nodes the hub has, and by how many of them one buffer speaks
// to. The look-up itself is two array indexes and costs the same for any number of nodes: as many
// instructions, and as much time where a buffer speaks to as many of them. What differs is what
// each further recipient of a buffer costs: about 1,300 instructions for a write of its own, and
// its memory, which is in no cache where there are many. In the running hub that write is a system
// call, which takes several times as long. Fetching recipients ahead, 4 to 6 frames before their
// turn, was tried and could not be seen in the figures.

#include <benchmark/benchmark.h>

#include <random>

#include "bench/hub/data/support/null_stream.hpp"
#include "proto/frame/frame_parser.hpp"
#include "tests/hub/data/support/route_rig.hpp"

namespace gimnet::hub {
namespace {

constexpr std::uint32_t kFirstNode = 2;
constexpr std::uint32_t kFrames = 8'000;
constexpr std::uint32_t kBuffers = 16;
const char* const kPayload = "0123456789abcdef";

/// A hub's routing side with so many nodes, and read buffers whose frames go in turns to so many of
/// them, which differ from buffer to buffer.
class Forwarding {
 public:
  Forwarding(std::uint32_t nodes, std::uint32_t destinations) : writers_(nodes + kFirstNode) {
    for (std::uint32_t i = 0; i < nodes; ++i) rig_.add_here(kFirstNode + i);
    std::mt19937 random(7);
    for (std::uint32_t i = 0; i < kBuffers; ++i) {
      std::vector<std::uint32_t> to(destinations);
      for (std::uint32_t& each : to)
        each = kFirstNode + static_cast<std::uint32_t>(random() % nodes);
      BufferRef& slab = slabs_.emplace_back(rig_.egress.pool.take_slab());
      std::byte* at = slab->data;
      for (std::uint32_t frame = 0; frame < kFrames; ++frame) {
        const auto bytes = testing::EgressRig::bytes(kPayload);
        std::memcpy(at, bytes.data(), bytes.size());
        store_le(at + 4, make_id<NodeId>(HubId{7}, to[frame % destinations]).value());
        at += bytes.size();
      }
      ends_.push_back(at);
    }
  }

  void forward_buffer() {
    const BufferRef& slab = slabs_[next_];
    const std::byte* const end = ends_[next_];
    next_ = (next_ + 1) % kBuffers;
    for (const std::byte* at = slab->data; at != end;) {
      const proto::RunView found = proto::next_run(at, end, proto::kFrameLengthDefault).run;
      rig_.router.route(slab, found);
      at += found.size;
    }
  }
  void flush() {
    for (Recipient* recipient : rig_.recipients.dirty()) {
      recipient->dirty = false;
      benchmark::DoNotOptimize(writers_[recipient->slot.value()].flush(
          recipient->outbox, nullptr, transport_, rig_.egress.context));
      recipient->outbox.on_emptied(rig_.egress.context);
    }
    rig_.recipients.dirty().clear();
  }

 private:
  testing::RouteRig rig_;
  benchmarks::NullStream transport_;
  std::vector<GatherWriter> writers_;
  std::vector<BufferRef> slabs_;
  std::vector<const std::byte*> ends_;
  std::size_t next_ = 0;
};

/// Arguments: nodes of the hub, and of them the recipients of one buffer.
void forward(benchmark::State& state) {
  Forwarding forwarding(static_cast<std::uint32_t>(state.range(0)),
                        static_cast<std::uint32_t>(state.range(1)));
  for (auto _ : state) {
    forwarding.forward_buffer();
    forwarding.flush();
  }
  state.SetItemsProcessed(state.iterations() * kFrames);
}
BENCHMARK(forward)
    ->ArgNames({"nodes", "recipients"})
    ->Args({10, 8})
    ->Args({10'000, 8})
    ->Args({1'000, 1'000})
    ->Args({10'000, 1'000})
    ->Args({10'000, kFrames});

/// Runs of frames of 16 bytes to one node: what a burst costs.
void forward_a_burst(benchmark::State& state) {
  Forwarding forwarding(1, 1);
  for (auto _ : state) {
    forwarding.forward_buffer();
    forwarding.flush();
  }
  state.SetItemsProcessed(state.iterations() * kFrames);
}
BENCHMARK(forward_a_burst);

}  // namespace
}  // namespace gimnet::hub
