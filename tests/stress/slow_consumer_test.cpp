#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <deque>
#include <string>
#include <vector>

#include "hub/limits.hpp"
#include "tests/stress/support/hub_process.hpp"
#include "tests/stress/support/raw_node.hpp"
#include "tests/stress/support/statistics.hpp"

// One receiver stops, the others do not notice: provable is that they get everything, in order,
// that the stopped one is closed and told why, and that the ledger knows where its frames are.

namespace gimnet::stress {
namespace {

constexpr std::size_t kHealthy = 4;
constexpr std::size_t kFramesPerRound = 50;
constexpr std::size_t kPayloadBytes = 1'024;

JoinOptions at_shard(std::size_t shard, const char* name = "") {
  JoinOptions options;
  options.hello.name = name;
  options.hello.shard = static_cast<std::uint16_t>(shard);
  return options;
}

JoinOptions stopped_options() {
  JoinOptions options = at_shard(0, "stopped");
  options.socket.receive_buffer_bytes = 64 * 1024;
  return options;
}

/// One sender, healthy receivers on both shards, and one that is not read.
class Scene {
 public:
  Scene(const HubProcess& hub, proto::Policy policy)
      : policy_(policy),
        sender_(hub.tcp_url(), at_shard(0)),
        stopped_(hub.tcp_url(), stopped_options()) {
    for (std::size_t i = 0; i < kHealthy; ++i)
      healthy_.emplace_back(hub.tcp_url(), at_shard(i % 2));
    received_.resize(kHealthy);
  }

  /// Sends some frames to everybody and returns when the healthy ones have them all.
  void round() {
    for (std::size_t i = 0; i < kFramesPerRound; ++i) {
      ++to_each_;
      for (const RawNode& node : healthy_) put(node, to_each_, proto::Policy::block);
      const bool is_paused = sender_.is_paused(proto::Kind::unicast, 1, stopped_.id().value());
      if (policy_ == proto::Policy::block && is_paused) continue;
      put(stopped_, ++to_stopped_, policy_);
    }
    const Deadline deadline;
    while (!sender_.flush() || !have_all()) {
      deadline.check("frames for healthy nodes");
      take();
    }
    ++rounds_;
  }

  /// Reads what the kernel still holds for the stopped node, to the end of the stream. Returns its
  /// data frames.
  std::uint64_t read_stopped_to_its_end() {
    std::uint64_t frames = 0;
    const Deadline deadline;
    while (!stopped_.is_closed()) {
      deadline.check("end of the closed connection");
      if (!stopped_.read_some()) wait_readable({stopped_.descriptor()}, 100);
      while (const auto frame = stopped_.next())
        frames += frame->header.kind == proto::Kind::unicast ? 1 : 0;
    }
    return frames;
  }

  [[nodiscard]] RawNode& stopped() { return stopped_; }
  [[nodiscard]] std::uint64_t sent() const { return kHealthy * to_each_ + to_stopped_; }
  [[nodiscard]] std::uint64_t healthy_received() const { return kHealthy * to_each_; }
  [[nodiscard]] std::uint64_t rounds() const { return rounds_; }
  [[nodiscard]] bool is_in_order() const { return is_in_order_; }

 private:
  void put(const RawNode& to, std::uint64_t number, proto::Policy policy) {
    std::array<std::byte, kPayloadBytes> payload{};
    std::memcpy(payload.data(), &number, sizeof number);
    sender_.put(parts_of(proto::Kind::unicast, to.id().value(), policy), payload);
  }

  [[nodiscard]] bool have_all() const {
    return std::all_of(received_.begin(), received_.end(),
                       [&](std::uint64_t n) { return n == to_each_; });
  }

  void take() {
    std::vector<int> waited{sender_.descriptor()};
    for (const RawNode& node : healthy_) waited.push_back(node.descriptor());
    wait_readable(waited, 5);
    sender_.read_some();
    while (sender_.next()) {
    }
    for (std::size_t i = 0; i < kHealthy; ++i) {
      healthy_[i].keep_alive();
      healthy_[i].read_some();
      while (const auto frame = healthy_[i].next()) {
        std::uint64_t number = 0;
        std::memcpy(&number, frame->body().data(), sizeof number);
        is_in_order_ = is_in_order_ && number == ++received_[i];
      }
    }
  }

  const proto::Policy policy_;
  RawNode sender_;
  RawNode stopped_;
  std::deque<RawNode> healthy_;
  std::vector<std::uint64_t> received_;
  std::uint64_t to_each_ = 0;
  std::uint64_t to_stopped_ = 0;
  std::uint64_t rounds_ = 0;
  bool is_in_order_ = true;
};

std::vector<std::string> with_two_shards(std::vector<std::string> more) {
  more.insert(more.end(), {"--shards", "2", "--placement", "hint"});
  return more;
}

struct Case {
  proto::Policy policy = proto::Policy::block;
  bool keeps_alive = false;
  const char* counter = "";
  proto::GoodbyeCode code = proto::GoodbyeCode::done;
};

/// Rounds until the hub has closed the stopped node, then compares everything.
void expect_closed(const std::vector<std::string>& arguments, const Case& expected) {
  const HubProcess hub(with_two_shards(arguments));
  Scene scene(hub, expected.policy);
  RawNode observer(hub.unix_url());
  const Deadline deadline(std::chrono::seconds(20));
  Clock::time_point next_ping = Clock::now();
  while (Statistics::of(observer)[expected.counter] == 0) {
    deadline.check("the hub closes the stopped node");
    scene.round();
    if (expected.keeps_alive && Clock::now() >= next_ping) {
      scene.stopped().ping();
      next_ping = Clock::now() + std::chrono::milliseconds(300);
    }
  }
  scene.round();
  const std::uint64_t stopped_received = scene.read_stopped_to_its_end();
  const Statistics end = wait_for(
      observer,
      [&](const Statistics& now) { return now["queued"] == 0 && now["accepted"] == scene.sent(); },
      "the ledger after " + std::to_string(scene.sent()));
  EXPECT_TRUE(scene.is_in_order());
  EXPECT_GT(scene.rounds(), 10u);
  EXPECT_EQ(end["delivered"], scene.healthy_received() + stopped_received);
  EXPECT_TRUE(end.is_balanced()) << end.text();
  EXPECT_EQ(end[expected.counter], 1u);
  EXPECT_LE(end["pinned_bytes_max"], 256u << 20);

  JoinOptions again = stopped_options();
  again.hello.token = scene.stopped().welcome().token;
  const RawNode back(hub.tcp_url(), again);
  EXPECT_EQ(back.id(), scene.stopped().id());
  EXPECT_EQ(back.welcome().last_goodbye_code, static_cast<std::uint16_t>(expected.code));
  EXPECT_FALSE(back.welcome().last_goodbye_sentence.empty());
}

TEST(StoppedReceiver, IsClosedAsSilent) {
  expect_closed({}, {proto::Policy::block, false, "silent", proto::GoodbyeCode::silent});
}

TEST(StoppedReceiver, IsClosedAsSlowThoughItKeepsAlive) {
  expect_closed({"--limit", "slow_consumer_ms=1000"},
                {proto::Policy::drop, true, "slow_consumers", proto::GoodbyeCode::slow_consumer});
}

// Messages sent with BLOCK are dropped before the slow consumer's time is over; they waited all the
// same.
TEST(StoppedReceiver, IsClosedAsSlowThoughItsMessagesTimeOut) {
  expect_closed({"--limit", "slow_consumer_ms=1000", "--limit", "block_ms=500"},
                {proto::Policy::block, true, "slow_consumers", proto::GoodbyeCode::slow_consumer});
}

TEST(StoppedReceiver, HasTheTimesThatTheDocumentsPromise) {
  const hub::Limits limits;
  EXPECT_EQ(limits.keep_alive_ms, 1'000u);
  EXPECT_EQ(limits.silent_ms, 3'000u);
  EXPECT_EQ(limits.slow_consumer_ms, 10'000u);
  EXPECT_EQ(limits.slow_consumer_bytes, 4'096u);
  EXPECT_EQ(limits.block_ms, 5'000u);
}

}  // namespace
}  // namespace gimnet::stress
