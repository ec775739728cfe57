#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <future>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "tests/stress/support/hub_process.hpp"
#include "tests/stress/support/nif_node.hpp"
#include "tests/stress/support/raw_node.hpp"
#include "tests/stress/support/statistics.hpp"

// The smallest frames there are, 16 bytes, in one burst: they cost the hub most for each byte.
// Provable is that two others have their turns meanwhile, since the flood goes on until they have
// had them, and that no frame is lost.

namespace gimnet::stress {
namespace {

constexpr std::chrono::seconds kPatience{120};
constexpr std::uint64_t kSteered = 100;

std::int32_t in_ms(std::chrono::milliseconds time) {
  return static_cast<std::int32_t>(time.count());
}

std::uint64_t burst_frames() { return is_full_size() ? 1'000'000 : 200'000; }

RawNode at_shard(const HubProcess& hub, std::uint16_t shard) {
  JoinOptions options;
  options.hello.shard = shard;
  return {hub.tcp_url(), options};
}

NifNode named_at_shard(const HubProcess& hub, const char* name, std::uint8_t shard) {
  nif_options options{};
  options.shard_plus_one = static_cast<std::uint8_t>(shard + 1);
  return {hub.tcp_url(), name, options};
}

/// One node, and two who take what it sends: to each so many frames after the other.
class Flood {
 public:
  Flood(const HubProcess& hub, std::uint16_t second_shard, std::uint64_t in_a_row)
      : from_(at_shard(hub, 0)), in_a_row_(in_a_row) {
    to_.push_back(at_shard(hub, 0));
    to_.push_back(at_shard(hub, second_shard));
  }

  /// The burst, then more of the same until `is_over`. Returns how many frames were sent; all have
  /// come then.
  std::uint64_t run(const std::atomic<bool>& is_over) {
    constexpr std::uint64_t kMore = 10'000;
    put(burst_frames());
    const Deadline deadline(kPatience);
    while (!is_over.load() || got() < from_.frames_sent()) {
      deadline.check("a burst of small frames");
      if (from_.flush() && !is_over.load()) put(kMore);
      from_.keep_alive();
      from_.read_some();
      while (from_.next()) {
      }
      if (!take()) wait_readable({to_[0].descriptor(), to_[1].descriptor()}, 1);
    }
    return from_.frames_sent();
  }

 private:
  void put(std::uint64_t frames) {
    for (std::uint64_t i = 0; i < frames; ++i) {
      const std::uint32_t to = to_[i / in_a_row_ % to_.size()].id().value();
      from_.put(parts_of(proto::Kind::unicast, to), {});
    }
  }
  [[nodiscard]] bool take() {
    bool took = false;
    for (RawNode& node : to_) {
      node.keep_alive();
      took = node.read_some() || took;
      while (node.next()) {
      }
    }
    return took;
  }
  [[nodiscard]] std::uint64_t got() const { return to_[0].frames_got() + to_[1].frames_got(); }

  RawNode from_;
  std::vector<RawNode> to_;
  const std::uint64_t in_a_row_;
};

/// Two that ask and answer. Returns how often there was an answer.
std::uint64_t steer(const NifNode& operator_node, const NifNode& robot) {
  std::thread answering([&] {
    Incoming in;
    for (std::uint64_t answered = 0;
         answered != kSteered && in.receive(robot, in_ms(kPatience)) == NIF_OK;) {
      if (in->type != NIF_MESSAGE) continue;
      std::memcpy(&answered, in->payload, sizeof answered);
      static_cast<void>(nif_send_to(robot.get(), in->from, in->payload, in->size));
    }
  });
  std::uint64_t steered = 0;
  for (bool is_answered = true; is_answered && steered < kSteered;) {
    const std::uint64_t number = steered + 1;
    Incoming in;
    is_answered = nif_send_to(operator_node.get(), robot.id(), &number, sizeof number) == NIF_OK &&
                  in.receive(operator_node, in_ms(kPatience)) == NIF_OK &&
                  in->type == NIF_MESSAGE && std::memcmp(in->payload, &number, sizeof number) == 0;
    steered += is_answered ? 1 : 0;
  }
  answering.join();
  return steered;
}

void expect_turns_for_others(std::uint16_t second_shard, std::uint64_t in_a_row) {
  const HubProcess hub({"--shards", "2", "--placement", "hint"});
  const NifNode operator_node = named_at_shard(hub, "operator", 0);
  const NifNode robot = named_at_shard(hub, "robot", static_cast<std::uint8_t>(second_shard));
  Flood flood(hub, second_shard, in_a_row);
  std::atomic<bool> is_over{false};
  std::future<std::uint64_t> flooding =
      std::async(std::launch::async, [&] { return flood.run(is_over); });
  EXPECT_EQ(steer(operator_node, robot), kSteered);
  is_over.store(true);
  const std::uint64_t frames = flooding.get();
  EXPECT_GE(frames, burst_frames());
  RawNode observer(hub.unix_url());
  const Statistics end =
      wait_for(observer, [](const Statistics& now) { return now["queued"] == 0; }, "the end");
  EXPECT_EQ(end["accepted"], frames + 2 * kSteered);
  EXPECT_EQ(end["delivered"], end["accepted"]);
  EXPECT_EQ(end.dropped(), 0u) << end.text();
}

TEST(Burst, OfFramesThatGoTogetherLeavesOthersTheirTurns) {
  for (const std::uint16_t second_shard : {std::uint16_t{0}, std::uint16_t{1}}) {
    expect_turns_for_others(second_shard, burst_frames() / 2);
  }
}

// Each is looked up and handed over by itself.
TEST(Burst, OfFramesThatGoSinglyLeavesOthersTheirTurns) {
  for (const std::uint16_t second_shard : {std::uint16_t{0}, std::uint16_t{1}}) {
    expect_turns_for_others(second_shard, 1);
  }
}

}  // namespace
}  // namespace gimnet::stress
