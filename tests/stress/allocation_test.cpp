#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>
#include <string>
#include <vector>

#include "proto/control/ns.hpp"
#include "proto/frame/extensions.hpp"
#include "tests/stress/support/hub_process.hpp"
#include "tests/stress/support/raw_node.hpp"
#include "tests/stress/support/statistics.hpp"

// The shards' threads allocate nothing while data flows, as jemalloc itself counts it in the
// running hub. A round of the same traffic is repeated until one allocated no byte: memory that a
// fuller queue needed for the first time is kept, so the rounds before it are the warm-up. What is
// allocated again and again never has such a round.

namespace gimnet::stress {
namespace {

constexpr int kRoundsMax = 30;
/// The third shard is the observer's, whose requests do allocate.
constexpr std::size_t kObserverShard = 2;

std::size_t scaled(std::size_t count) { return is_full_size() ? 10 * count : count; }

class Traffic {
 public:
  Traffic() : hub_(arguments()), observer_(hub_.unix_url(), at_shard(kObserverShard)) {}

  RawNode& join(std::size_t shard, const char* name = "") {
    nodes_.emplace_back(hub_.unix_url(), at_shard(shard, name));
    blocks_.emplace_back();
    return nodes_.back();
  }
  [[nodiscard]] std::uint32_t id(std::size_t node) const { return nodes_[node].id().value(); }
  RawNode& node(std::size_t index) { return nodes_[index]; }

  /// Part of every round: a frame that this node sends.
  void add(std::size_t from, proto::FrameParts parts, std::size_t size) {
    const std::vector<std::byte> payload(size, std::byte{7});
    parts.header.src = id(from);
    parts.payload_size = size;
    std::vector<std::byte>& block = blocks_[from];
    const std::size_t before = block.size();
    block.resize(before + proto::prefix_size(parts) + size);
    ASSERT_NE(proto::write_frame(parts, payload, std::span(block).subspan(before)), 0u);
    ++frames_;
  }
  /// The messages of add() are sent so often in a round.
  void repeat(std::size_t times) { times_ = times; }
  /// Receivers read only when nobody can write any more: queues fill.
  void let_receivers_wait() { is_lazy_ = true; }

  Statistics round() {
    for (std::size_t i = 0; i < times_; ++i) {
      for (std::size_t node = 0; node < nodes_.size(); ++node)
        nodes_[node].put_bytes(blocks_[node]);
      write_all();
    }
    sent_ += times_ * frames_;
    return wait_for(
        observer_,
        [this](const Statistics& now) {
          read_all();
          return now["accepted"] == sent_ && now["queued"] == 0 && now["delivered"] == received();
        },
        "the end of a round");
  }

  /// Returns the counters after the round in which nothing was allocated.
  Statistics expect_a_round_without() {
    std::string steps;
    Statistics before = round();
    for (int i = 0; i < kRoundsMax; ++i) {
      Statistics after = round();
      const std::uint64_t bytes = allocated(after) - allocated(before);
      if (bytes == 0) return after;
      steps += " " + std::to_string(bytes);
      before = std::move(after);
    }
    ADD_FAILURE() << "each round of " << times_ * frames_ << " frames allocated bytes:" << steps;
    return before;
  }

  static std::uint64_t allocated(const Statistics& statistics) {
    return statistics.of_shard(0, "allocated_bytes") + statistics.of_shard(1, "allocated_bytes");
  }

 private:
  /// Frames that all nodes read.
  [[nodiscard]] std::uint64_t received() const {
    std::uint64_t sum = 0;
    for (const RawNode& node : nodes_) sum += node.frames_got();
    return sum;
  }
  static std::vector<std::string> arguments() {
    // On a slow machine a round has pauses: what the hub takes for idle gives memory back, and
    // needs it anew.
    return {"--shards",    "3",
            "--placement", "hint",
            "--limit",     "keep_alive_ms=3000000",
            "--limit",     "silent_ms=3600000",
            "--limit",     "slow_consumer_ms=3600000",
            "--limit",     "block_ms=3600000"};
  }
  static JoinOptions at_shard(std::size_t shard, const char* name = "") {
    JoinOptions options;
    options.hello.name = name;
    options.hello.shard = static_cast<std::uint16_t>(shard);
    return options;
  }

  void write_all() {
    const Deadline deadline;
    for (bool done = false; !done;) {
      deadline.check("room to write a round");
      std::size_t left_before = 0;
      std::size_t left = 0;
      for (RawNode& node : nodes_) {
        left_before += node.unwritten();
        node.flush();
        left += node.unwritten();
      }
      done = left == 0;
      if (!is_lazy_ || left == left_before) read_all();
    }
  }

  void read_all() {
    for (RawNode& node : nodes_) {
      while (node.read_some()) {
        while (node.next()) {
        }
      }
    }
  }

  HubProcess hub_;
  RawNode observer_;
  std::deque<RawNode> nodes_;
  std::deque<std::vector<std::byte>> blocks_;
  std::size_t frames_ = 0;
  std::size_t times_ = 1;
  bool is_lazy_ = false;
  std::uint64_t sent_ = 0;
};

TEST(ShardsAllocateNothing, AndTheirCounterRisesWhenSomethingDoes) {
  Traffic traffic;
  RawNode& node = traffic.join(0);
  const auto of_shard_0 = [](const Statistics& now) { return now.of_shard(0, "allocated_bytes"); };
  const Statistics before = wait_for(
      node, [&](const Statistics& now) { return of_shard_0(now) > 0; },
      "a hub that is linked with jemalloc");
  // Each request is handed to the conductor in memory of its own.
  static_cast<void>(wait_for(
      node, [&](const Statistics& now) { return of_shard_0(now) > of_shard_0(before); },
      "a request that allocates"));
}

TEST(ShardsAllocateNothing, ForAMillionSmallFramesInTurns) {
  Traffic traffic;
  for (std::size_t i = 0; i < 8; ++i) traffic.join(i % 2);
  for (std::size_t i = 0; i < 1'000; ++i) {
    traffic.add(i % 2,
                parts_of(proto::Kind::unicast, traffic.id(i % 8), proto::Policy::kind_default,
                         static_cast<proto::Lane>(i % 4)),
                16);
  }
  traffic.repeat(1'000);
  traffic.expect_a_round_without();
}

TEST(ShardsAllocateNothing, ForFramesOf64KiB) {
  Traffic traffic;
  for (std::size_t i = 0; i < 4; ++i) traffic.join(i % 2);
  for (std::size_t i = 0; i < 16; ++i) {
    traffic.add(i % 2, parts_of(proto::Kind::unicast, traffic.id(i % 4)), 65'536);
  }
  traffic.repeat(scaled(100));
  traffic.expect_a_round_without();
}

TEST(ShardsAllocateNothing, ForLargeFramesWithATrace) {
  Traffic traffic;
  for (std::size_t i = 0; i < 4; ++i) traffic.join(i % 2);
  std::array<std::byte, 128> memory{};
  proto::ExtensionWriter writer(memory);
  ASSERT_TRUE(writer.add_trace(2));
  for (std::size_t i = 0; i < 16; ++i) {
    proto::FrameParts parts = parts_of(proto::Kind::unicast, traffic.id(i % 4));
    parts.extensions = writer.written();
    traffic.add(i % 2, parts, 60'000);
  }
  traffic.repeat(scaled(50));
  traffic.expect_a_round_without();
}

// Two senders' messages of 1 MiB wait for one receiver, fragment by fragment in turns.
TEST(ShardsAllocateNothing, ForFragmentsThatWait) {
  Traffic traffic;
  for (std::size_t i = 0; i < 4; ++i) traffic.join(i % 2);
  traffic.let_receivers_wait();
  constexpr std::uint32_t kTotal = 1 << 20;
  constexpr std::uint32_t kPiece = 8'000;
  for (std::uint32_t offset = 0; offset < kTotal; offset += kPiece) {
    for (std::size_t message = 0; message < 4; ++message) {
      const std::uint32_t size = std::min(kPiece, kTotal - offset);
      proto::FrameParts parts =
          parts_of(proto::Kind::unicast, traffic.id(2 + message % 2), proto::Policy::kind_default,
                   message < 2 ? proto::Lane::normal : proto::Lane::bulk);
      parts.fragment = proto::FragmentHeader{static_cast<std::uint32_t>(message), offset, kTotal};
      traffic.add(message / 2, parts, size);
    }
  }
  traffic.repeat(scaled(10));
  traffic.expect_a_round_without();
}

TEST(ShardsAllocateNothing, ForLatestMessagesThatAreReplaced) {
  Traffic traffic;
  for (std::size_t i = 0; i < 4; ++i) traffic.join(i % 2);
  traffic.let_receivers_wait();
  for (std::size_t i = 0; i < 2'000; ++i) {
    proto::FrameParts parts =
        parts_of(proto::Kind::unicast, traffic.id(2 + i % 2), proto::Policy::latest);
    parts.key = i % 60;
    traffic.add(i / 2 % 2, parts, 1'000);
  }
  traffic.repeat(scaled(20));
  const Statistics end = traffic.expect_a_round_without();
  EXPECT_GT(end["dropped.replaced"], 0u) << "nothing had to wait: the test is too small";
}

TEST(ShardsAllocateNothing, ForSendersThatArePausedAndResumed) {
  Traffic traffic;
  for (std::size_t i = 0; i < 4; ++i) traffic.join(i % 2);
  traffic.let_receivers_wait();
  // More than a lane takes, less than its reserve on top.
  for (std::size_t i = 0; i < 400; ++i) {
    traffic.add(i % 2, parts_of(proto::Kind::unicast, traffic.id(2 + i % 2)),
                i % 8 == 0 ? 60'000 : 4'000);
  }
  traffic.repeat(scaled(10));
  const Statistics end = traffic.expect_a_round_without();
  EXPECT_GT(end["pauses"], 0u) << "no queue was full: the test is too small";
  EXPECT_GT(end["resumes"], 0u);
  EXPECT_EQ(end.dropped(), 0u);
}

TEST(ShardsAllocateNothing, ForSendersThatAreHeld) {
  Traffic traffic;
  for (std::size_t i = 0; i < 4; ++i) traffic.join(i % 2);
  traffic.let_receivers_wait();
  for (std::size_t i = 0; i < 4'000; ++i) {
    traffic.add(i % 2, parts_of(proto::Kind::unicast, traffic.id(2 + i / 2 % 2)), 4'000);
  }
  traffic.repeat(scaled(3));
  const Statistics end = traffic.expect_a_round_without();
  EXPECT_GT(end["held_reads"], 0u) << "nobody was held: the test is too small";
  EXPECT_EQ(end.dropped(), 0u);
}

TEST(ShardsAllocateNothing, ForAGroupOnTwoShards) {
  Traffic traffic;
  RawNode& provider = traffic.join(0, "provider");
  proto::ns::Advertise service;
  service.service = "stream";
  const std::uint32_t group =
      provider.ask<proto::ns::AdvertiseAnswer>(proto::Kind::ns, service).group.value();
  for (std::size_t i = 0; i < 20; ++i) {
    static_cast<void>(traffic.join(i % 2).ask<proto::ns::SubscribeAnswer>(
        proto::Kind::ns, proto::ns::Subscribe{"provider/stream"}));
  }
  for (std::size_t i = 0; i < 100; ++i) traffic.add(0, parts_of(proto::Kind::group, group), 16);
  traffic.add(0, parts_of(proto::Kind::group, group), 1'000);
  traffic.add(0, parts_of(proto::Kind::group, group), 65'536);
  traffic.repeat(scaled(50));
  const Statistics end = traffic.expect_a_round_without();
  EXPECT_GT(end.of_shard(1, "delivered"), 0u) << "the other shard had nothing to do";
}

}  // namespace
}  // namespace gimnet::stress
