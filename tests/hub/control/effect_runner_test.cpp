#include "hub/control/effect_runner.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "base/log.hpp"
#include "proto/control/ctrl.hpp"
#include "proto/control/ns.hpp"
#include "proto/control/ns_register.hpp"
#include "tests/hub/control/support/test_conductor.hpp"

// The order of what the conductor publishes and tells is part of its meaning: who hears of an id
// may use it at once.

namespace gimnet::hub {
namespace {

using ::testing::ElementsAre;
namespace ns = proto::ns;

class EffectRunnerTest : public ::testing::Test, protected TestConductor {
 protected:
  EffectRunnerTest() { set_log_level(LogLevel::off); }
  ~EffectRunnerTest() override { set_log_level(LogLevel::info); }

  /// The event that this command sends.
  template <class Event>
  static std::optional<Event> event_in(const ShardCommand& command) {
    const auto* sent = std::get_if<SendControlCommand>(&command);
    if (sent == nullptr ||
        proto::split_control(payload_of(*sent))->header.operation != Event::kOperation)
      return {};
    return *proto::decode<Event>(payload_of(*sent));
  }
};

TEST_F(EffectRunnerTest, WhoMaySendToAServiceHearsOfItsGroupOnceThatIsThere) {
  const Node robot = join("robot");
  const Node sender = join("sender");
  ASSERT_TRUE(ask<ns::SubscribeAnswer>(sender, ns::Subscribe{"robot/cmd"}));
  std::vector<bool> there;
  std::size_t members = 0;
  shards.on_send = [&](const ShardCommand& command) {
    const auto moved = event_in<ns::ServiceMoved>(command);
    if (!moved) return;
    const GroupMembers* group = groups.find(index_of(moved->group));
    there.push_back(group != nullptr);
    for (const auto& list : group->by_shard) members += list.size();
  };
  ns::Advertise offer;
  offer.service = "cmd";
  offer.direction = ns::Direction::accepts;
  ASSERT_TRUE(ask<ns::AdvertiseAnswer>(robot, offer));
  EXPECT_THAT(there, ElementsAre(true)) << "else the first message, sent at once, is for no group";
  offer.message_type = 5;
  ASSERT_TRUE(ask<ns::AdvertiseAnswer>(robot, offer));
  EXPECT_THAT(there, ElementsAre(true, true)) << "the same where it moves";
  offer.direction = ns::Direction::provides;
  ASSERT_TRUE(ask<ns::AdvertiseAnswer>(robot, offer));
  EXPECT_THAT(there, ElementsAre(true, true, true));
  EXPECT_EQ(members, 0u) << "what it provides comes to who was told";
}

TEST_F(EffectRunnerTest, AnEventIsEncodedOnceForAllWhoHearOfIt) {
  constexpr std::size_t kReaders = 2 * TellCommand::kToMost + 2;
  const Node robot = join("robot");
  std::set<NodeId> readers;
  for (std::size_t i = 0; i < kReaders; ++i) {
    const Node reader = join("reader-" + std::to_string(i));
    // Both shards have readers with a window of their own, and one more than fits in a command.
    ns::Subscribe wanted{"robot/odom"};
    if (i < 2) wanted.window = 3;
    ASSERT_TRUE(ask<ns::SubscribeAnswer>(reader, wanted));
    readers.insert(reader.id);
  }
  shards.sent.clear();
  shards.told.clear();
  ns::Advertise offer{.service = "odom"};
  offer.delivery = ns::Delivery::sync;
  offer.window = 8;
  ASSERT_TRUE(ask<ns::AdvertiseAnswer>(robot, offer));
  EXPECT_THAT(shards.told, ElementsAre(TellCommand::kToMost, TellCommand::kToMost, 1, 1));
  std::set<NodeId> told;
  for (const FakeShards::Sent& each : shards.sent) {
    const auto moved = event_in<ns::ServiceMoved>(each.command);
    if (!moved) continue;
    EXPECT_EQ(moved->name, "robot/odom");
    const auto& frame = std::get<SendControlCommand>(each.command).frame;
    told.insert(NodeId{proto::load_header(frame.data()).dst});
  }
  EXPECT_EQ(told, readers);
}

TEST_F(EffectRunnerTest, ANewNameIsEncodedOnceForEachServiceAndShard) {
  constexpr std::size_t kServices = 40;
  constexpr std::size_t kReaders = 100;
  const Node robot = join("robot");
  for (std::size_t k = 0; k < kServices; ++k) {
    ASSERT_TRUE(ask<ns::AdvertiseAnswer>(robot, ns::Advertise{.service = "s" + std::to_string(k)}));
  }
  for (std::size_t i = 0; i < kReaders; ++i) {
    const Node reader = join("reader-" + std::to_string(i));
    for (std::size_t k = 0; k < kServices; ++k) {
      ASSERT_TRUE(ask<ns::SubscribeAnswer>(reader, ns::Subscribe{"robot/s" + std::to_string(k)}));
    }
  }
  std::size_t encoded = 0;
  std::size_t told = 0;
  std::size_t bytes = 0;
  shards.on_tell = [&](const TellCommand& command) {
    ++encoded;
    told += command.to.size();
    bytes += command.frame.capacity() + command.to.capacity() * sizeof(TellCommand::To);
  };
  ASSERT_TRUE(ask<ns::RegisterNameAnswer>(robot, ns::RegisterName{"lifter"}));
  EXPECT_EQ(told, kServices * kReaders);
  EXPECT_EQ(encoded, kServices * shards.shards());
  EXPECT_LE(bytes, encoded * 256 + 2 * told * sizeof(TellCommand::To))
      << "a vector that grows doubles";
}

}  // namespace
}  // namespace gimnet::hub
