#include <gtest/gtest.h>

#include <atomic>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <thread>

#include "gimnet/gimi.hpp"
#include "tests/client/gimi/support/hub_process.hpp"

// Programs whose nodes are given other ids while they send: a hub of two shards, with one end on
// each.

namespace gimnet {
namespace {

using test::eventually;
using test::HubProcess;

constexpr Timeout kWait = std::chrono::duration_cast<Timeout>(test::kPatience);
constexpr std::uint32_t kHub = 7u << 20;
constexpr std::uint32_t kRounds = 12;
/// How many may be under way, so that no queue is ever full.
constexpr std::uint32_t kUnderWayMax = 500;
constexpr QueueOptions kQueue{1'000, AtFullQueue::stop_reading};

class Renumbered : public testing::Test {
 protected:
  static std::string make_folder() {
    std::string folder = testing::TempDir() + "gimnet-renumbered-XXXXXX";
    EXPECT_NE(::mkdtemp(folder.data()), nullptr);
    return folder;
  }
  ~Renumbered() override { std::filesystem::remove_all(folder_); }

  [[nodiscard]] Node join(const std::string& name, std::uint8_t shard) {
    NodeOptions options;
    options.name = name;
    options.hub = hub_.url();
    options.shard = shard;
    options.keep_token = false;
    return Node::join(options).or_throw();
  }

  /// Refused as long as the node has not been heard of since the last time.
  void give_another_id(const Node& node) {
    const Peer wanted{kHub | next_++};
    EXPECT_TRUE(eventually([&] { return administrator_.reassign(node.peer(), wanted).ok(); }))
        << wanted.text();
    EXPECT_TRUE(eventually([&] { return node.peer() == wanted; }));
  }

  /// Numbers, one after the other as fast as it goes, and "end" as the last when `ends_` was set.
  template <class Send>
  void say_numbers(const Send& send) {
    for (std::uint32_t number = 0; !ends_.load(); ++number) {
      while (number - taken_.load() >= kUnderWayMax && !ends_.load()) std::this_thread::yield();
      const Outcome<void> said = send(std::to_string(number));
      ASSERT_TRUE(said) << number << ": " << said.failure().sentence;
    }
    EXPECT_TRUE(send("end"));
  }
  template <class Receive>
  void take_numbers(const Receive& receive) {
    for (std::uint32_t number = 0;; taken_.store(++number)) {
      const Outcome<Message> message = receive();
      ASSERT_TRUE(message) << number << ": " << message.failure().sentence;
      if (message->text() == "end") return;
      ASSERT_EQ(message->text(), std::to_string(number));
    }
  }

  const std::string folder_ = make_folder();
  // A machine that is busy elsewhere is no reason to give a message up.
  HubProcess hub_{{"--listen", "unix:" + folder_ + "/hub", "--shards", "2", "--limit",
                   "block_ms=600000", "--limit", "slow_consumer_ms=600000", "--limit",
                   "grace_ms=600000"}};
  Node administrator_ = [this] {
    NodeOptions options;
    options.hub = "unix:" + folder_ + "/hub";
    options.administrator = true;
    return Node::join(options).or_throw();
  }();
  std::uint32_t next_ = 1'000;
  std::atomic<bool> ends_{false};
  std::atomic<std::uint32_t> taken_{0};
};

TEST_F(Renumbered, NothingThatIsSentToAServiceIsLost) {
  const Node robot = join("robot", 0);
  const Node viewer = join("operator", 1);
  AcceptOptions accepting;
  accepting.queue = kQueue;
  const Queue commands = robot.accept("drive", accepting).or_throw();
  const Sender drive = viewer.sender_to_service("robot/drive").or_throw();
  std::jthread sending(
      [&] { say_numbers([&](const std::string& text) { return drive.send(text, kWait); }); });
  std::jthread taking([&] { take_numbers([&] { return commands.receive(kWait); }); });
  for (std::uint32_t round = 0; round < kRounds; ++round)
    give_another_id(round % 3 == 2 ? viewer : robot);
  ends_.store(true);
}

TEST_F(Renumbered, NothingOfAStreamIsLost) {
  const Node robot = join("robot", 0);
  const Node viewer = join("viewer", 1);
  const Publisher odometry = robot.advertise("odom").or_throw();
  const Subscription subscription = viewer.subscribe("robot/odom", kQueue).or_throw();
  odometry.wait_for_subscribers(1, kWait).or_throw();
  std::jthread sending(
      [&] { say_numbers([&](const std::string& text) { return odometry.publish(text, kWait); }); });
  std::jthread taking([&] { take_numbers([&] { return subscription.receive(kWait); }); });
  for (std::uint32_t round = 0; round < kRounds; ++round)
    give_another_id(round % 2 == 0 ? viewer : robot);
  ends_.store(true);
}

}  // namespace
}  // namespace gimnet
