#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <deque>
#include <string>
#include <vector>

#include "proto/control/ns.hpp"
#include "tests/stress/support/hub_process.hpp"
#include "tests/stress/support/raw_node.hpp"
#include "tests/stress/support/statistics.hpp"

// A large message to many is copied by nobody: one buffer, a reference for each. And the counter
// that says so does count, where the hub means to copy.

namespace gimnet::stress {
namespace {

constexpr std::size_t kSubscribers = 100;
constexpr std::size_t kMessages = 100;

class Audience {
 public:
  explicit Audience(const char* shards)
      : hub_({"--shards", shards, "--limit", "silent_ms=600000"}), observer_(hub_.unix_url()) {
    JoinOptions options;
    options.hello.name = "publisher";
    publisher_ = RawNode(hub_.tcp_url(), options);
    proto::ns::Advertise service;
    service.service = "stream";
    group_ = publisher_.ask<proto::ns::AdvertiseAnswer>(proto::Kind::ns, service).group.value();
    for (std::size_t i = 0; i < kSubscribers; ++i) {
      subscribers_.emplace_back(hub_.tcp_url());
      static_cast<void>(subscribers_.back().ask<proto::ns::SubscribeAnswer>(
          proto::Kind::ns, proto::ns::Subscribe{"publisher/stream"}));
    }
  }

  /// So many messages of that size; each arrives whole at everybody.
  void publish(std::size_t size) {
    const std::vector<std::byte> payload(size, std::byte{9});
    for (std::size_t i = 0; i < kMessages; ++i) {
      publisher_.put(parts_of(proto::Kind::group, group_), payload);
      publisher_.flush_all();
      for (RawNode& subscriber : subscribers_) {
        const Frame frame = subscriber.wait_next();
        ASSERT_EQ(frame.body().size(), size);
        ASSERT_EQ(frame.body().back(), std::byte{9});
      }
    }
  }
  /// To one of them alone.
  void send_to_one(std::size_t size) {
    publisher_.put(parts_of(proto::Kind::unicast, subscribers_.front().id().value()),
                   std::vector<std::byte>(size));
    publisher_.flush_all();
    static_cast<void>(subscribers_.front().wait_next());
  }
  [[nodiscard]] Statistics statistics() { return Statistics::of(observer_); }
  [[nodiscard]] Statistics exact_ledger() { return wait_for_exact_ledger(observer_); }
  [[nodiscard]] std::uint64_t sent() const { return publisher_.frames_sent(); }
  [[nodiscard]] std::uint64_t received() const {
    std::uint64_t sum = 0;
    for (const RawNode& subscriber : subscribers_) sum += subscriber.frames_got();
    return sum;
  }

 private:
  HubProcess hub_;
  RawNode observer_;
  RawNode publisher_;
  std::deque<RawNode> subscribers_;
  std::uint32_t group_ = 0;
};

void expect_no_payload_byte_copied(const char* shards) {
  Audience audience(shards);
  const Statistics before = audience.statistics();
  audience.publish(65'536);
  const Statistics after = audience.exact_ledger();
  EXPECT_EQ(after["accepted"], audience.sent());
  EXPECT_EQ(after["copies"], audience.sent() * (kSubscribers - 1));
  EXPECT_EQ(after["delivered"], audience.received());
  EXPECT_EQ(after["copied_bytes"], before["copied_bytes"]);
  // If a read ended within a header, that was moved; never a byte behind it.
  EXPECT_LE(after["moved_tail_bytes"] - before["moved_tail_bytes"],
            proto::kHeaderSize * (after["receive_calls"] - before["receive_calls"]));
}

TEST(Copying, NoPayloadByteFor64KiBToAHundredSubscribers) { expect_no_payload_byte_copied("1"); }

TEST(Copying, NoPayloadByteFor64KiBToAHundredSubscribersOnTwoShards) {
  expect_no_payload_byte_copied("2");
}

TEST(Copying, ShowsInItsCounterWhereTheHubMeansToCopy) {
  Audience audience("1");
  const Statistics before = audience.statistics();
  audience.send_to_one(100);
  const Statistics after = audience.statistics();
  EXPECT_EQ(after["copied_bytes"], before["copied_bytes"] + proto::kHeaderSize + 100)
      << "a small frame to one";
  audience.send_to_one(65'536);
  EXPECT_EQ(audience.statistics()["copied_bytes"], after["copied_bytes"]) << "a large one";
}

}  // namespace
}  // namespace gimnet::stress
