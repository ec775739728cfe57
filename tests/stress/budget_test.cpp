#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <deque>
#include <string>
#include <vector>

#include "proto/control/ns.hpp"
#include "tests/stress/support/hub_process.hpp"
#include "tests/stress/support/raw_node.hpp"
#include "tests/stress/support/statistics.hpp"

// A thousand receivers that have stopped, behind a sender that has not: provable is that the hub's
// memory stays within its budget, and that the one healthy receiver gets everything.

namespace gimnet::stress {
namespace {

constexpr std::size_t kStopped = 1'000;
constexpr std::int64_t kBudget = 32 << 20;
constexpr std::size_t kBatchBytes = 64 * 1024;
constexpr std::size_t kWarmUpBytes = 64 * 1024;

const std::vector<std::string> kArguments{"--shards",         "2",       "--limit",
                                          "silent_ms=600000", "--limit", "slow_consumer_ms=600000"};

std::vector<std::string> with_budget(std::int64_t bytes) {
  std::vector<std::string> arguments = kArguments;
  arguments.insert(arguments.end(), {"--limit", "budget_bytes=" + std::to_string(bytes)});
  return arguments;
}

class Crowd {
 public:
  explicit Crowd(std::int64_t budget = kBudget,
                 const std::vector<std::string>& arguments = with_budget(kBudget))
      : budget_(budget),
        hub_(arguments),
        publisher_(hub_.unix_url(), named("publisher")),
        healthy_(hub_.unix_url()) {
    raise_descriptor_limit();
    proto::ns::Advertise service;
    service.service = "stream";
    group_ = publisher_.ask<proto::ns::AdvertiseAnswer>(proto::Kind::ns, service).group.value();
    subscribe(healthy_);
    for (std::size_t i = 0; i < kStopped; ++i) {
      // Over the Unix socket what the kernel holds for a receiver is bounded by the hub's own
      // buffer.
      stopped_.emplace_back(hub_.unix_url());
      subscribe(stopped_.back());
    }
  }

  /// Measures the memory of the hub with a thousand connected and a little of the same traffic,
  /// which the kernels still take.
  void measure_base() { base_ = hub_.resident_bytes(); }

  /// Publishes so many messages of that size, as fast as the healthy subscriber takes them.
  void publish(std::size_t messages, std::size_t size) {
    while (messages > 0) {
      const std::size_t batch =
          std::clamp<std::size_t>(kBatchBytes / (size + proto::kHeaderSize), 1, messages);
      for (std::size_t i = 0; i < batch; ++i) put(parts_of(proto::Kind::group, group_), size);
      expected_ += batch;
      messages -= batch;
      settle();
    }
  }

  /// One message of that size to each of the thousand and to the healthy one, so often.
  void unicast(std::size_t rounds, std::size_t size) {
    for (std::size_t round = 0; round < rounds; ++round) {
      const auto lane = round % 2 == 0 ? proto::Lane::normal : proto::Lane::bulk;
      for (const RawNode& node : stopped_) {
        put(parts_of(proto::Kind::unicast, node.id().value(), proto::Policy::drop, lane), size);
      }
      put(parts_of(proto::Kind::unicast, healthy_.id().value(), proto::Policy::drop), size);
      ++expected_;
      settle();
    }
  }

  void expect_bounded() {
    RawNode observer(hub_.unix_url());
    const Statistics now = Statistics::of(observer);
    EXPECT_LE(highest_ - base_, budget_ + budget_ / 10)
        << "base " << base_ << ", highest " << highest_ << ", " << now.text();
    EXPECT_GT(now.dropped(), 0u) << "nothing was let go: the test is too small";
    EXPECT_TRUE(now.is_balanced()) << now.text();
    EXPECT_EQ(received_, expected_);
    EXPECT_TRUE(is_in_order_);
  }

 private:
  static JoinOptions named(const char* name) {
    JoinOptions options;
    options.hello.name = name;
    return options;
  }

  void subscribe(RawNode& node) {
    static_cast<void>(node.ask<proto::ns::SubscribeAnswer>(
        proto::Kind::ns, proto::ns::Subscribe{"publisher/stream"}));
  }

  void put(const proto::FrameParts& parts, std::size_t size) {
    std::vector<std::byte> payload(size);
    std::memcpy(payload.data(), &sent_, std::min(size, sizeof sent_));
    ++sent_;
    publisher_.put(parts, payload);
  }

  void settle() {
    const Deadline deadline;
    while (!publisher_.flush() || received_ < expected_) {
      deadline.check("messages for the healthy subscriber");
      publisher_.read_some();
      while (publisher_.next()) {
      }
      wait_readable({healthy_.descriptor(), publisher_.descriptor()}, 5);
      while (healthy_.read_some()) take();
    }
    highest_ = std::max(highest_, hub_.resident_bytes());
  }

  void take() {
    while (const auto frame = healthy_.next()) {
      std::uint64_t number = 0;
      std::memcpy(&number, frame->body().data(), sizeof number);
      is_in_order_ = is_in_order_ && (received_ == 0 || number > last_);
      last_ = number;
      ++received_;
    }
  }

  const std::int64_t budget_;
  HubProcess hub_;
  RawNode publisher_;
  RawNode healthy_;
  std::deque<RawNode> stopped_;
  std::uint32_t group_ = 0;
  std::int64_t base_ = 0;
  std::int64_t highest_ = 0;
  std::uint64_t sent_ = 0;
  std::uint64_t expected_ = 0;
  std::uint64_t received_ = 0;
  std::uint64_t last_ = 0;
  bool is_in_order_ = true;
};

std::size_t scaled(std::size_t messages) { return is_full_size() ? 4 * messages : messages; }

TEST(Budget, HoldsBehindAThousandStoppedSubscribers) {
  Crowd crowd;
  crowd.publish(kWarmUpBytes / (8 * 1'024), 8 * 1'024);
  crowd.measure_base();
  crowd.publish(scaled(1'024), 8 * 1'024);
  crowd.expect_bounded();
}

TEST(Budget, HoldsForMessagesOfAKibibyte) {
  Crowd crowd;
  crowd.publish(kWarmUpBytes / 1'024, 1'024);
  crowd.measure_base();
  crowd.publish(scaled(4'096), 1'024);
  crowd.expect_bounded();
}

TEST(Budget, HoldsForMessagesOfSixteenBytes) {
  Crowd crowd;
  crowd.publish(kWarmUpBytes / 16, 16);
  crowd.measure_base();
  crowd.publish(scaled(131'072), 16);
  crowd.expect_bounded();
}

TEST(Budget, HoldsForLargeFrames) {
  Crowd crowd;
  crowd.publish(kWarmUpBytes / (64 * 1'024), 64 * 1'024);
  crowd.measure_base();
  crowd.publish(scaled(256), 64 * 1'024);
  crowd.expect_bounded();
}

// Neighbours of different lanes form no runs: each frame has an entry of its own, which is larger
// than the frame.
TEST(Budget, HoldsForUnicastOfSixteenBytes) {
  Crowd crowd;
  crowd.unicast(64, 16);
  crowd.measure_base();
  crowd.unicast(scaled(1'500), 16);
  crowd.expect_bounded();
}

// As the hub is started by default.
TEST(Budget, OfTheDefaultHoldsBehindAThousandStopped) {
  if (!is_full_size()) GTEST_SKIP() << "moves a gigabyte: with GIMNET_STRESS=full";
  Crowd crowd(256 << 20, kArguments);
  crowd.unicast(kWarmUpBytes / 1'024, 1'024);
  crowd.measure_base();
  crowd.unicast(1'000, 1'024);
  crowd.expect_bounded();
}

TEST(Budget, HoldsForUnicastThatMayBeDropped) {
  Crowd crowd;
  crowd.unicast(kWarmUpBytes / 1'024, 1'024);
  crowd.measure_base();
  crowd.unicast(scaled(400), 1'024);
  crowd.expect_bounded();
}

}  // namespace
}  // namespace gimnet::stress
