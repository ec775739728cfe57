#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>

#include "proto/frame/fragment_header.hpp"
#include "tests/hub/shard/support/hub_rig.hpp"

// Another program comes back under the session of a node: what waited for the former one alone goes
// back to its senders.

namespace gimnet::hub {
namespace {

using proto::DropReason;
using proto::Kind;
using ::testing::ElementsAre;
using testing::FakeNode;
using testing::FrameSpec;
using testing::HubRig;
using testing::JoinSpec;

constexpr JoinSpec kFirst{.resume = true};
constexpr JoinSpec kNext{.resume = true, .epoch = 78};  // another program

class NewProgram : public ::testing::Test {
 protected:
  NewProgram() : sender(rig.join(0)), robot(rig.join(1, kFirst)) {
    rig.publish_group(5, robot.id, {}, true);
    rig.publish_group(6, sender.id, {&robot});
    robot.pipe.reset();
    rig.settle();
  }
  void send_all() {
    rig.send(sender, robot.id.value(), "to the node", {.flags = proto::kFlagReport});
    rig.send(sender, HubRig::group(5), "to the service",
             {.kind = Kind::service, .flags = proto::kFlagReport});
    rig.send(sender, HubRig::group(6), "to the subscriber", {.kind = Kind::group});
    rig.send(sender, 0xFFFFFFFF, "to all", {.kind = Kind::broadcast});
    rig.settle();
  }
  /// Frames that the sender was told of as dropped for that reason.
  std::uint64_t told(DropReason reason) {
    rig.pass_ms(1'000);
    rig.settle();
    std::uint64_t count = 0;
    for (const proto::Report& report : sender.reports())
      if (report.reason == reason) count += report.count;
    return count;
  }

  HubRig rig{2};
  FakeNode& sender;
  FakeNode& robot;
};

TEST_F(NewProgram, GetsNothingThatWasForTheOneBefore) {
  send_all();
  rig.rejoin(robot, kNext);
  ASSERT_TRUE(robot.welcome && !robot.welcome->resumed);
  rig.settle();
  EXPECT_THAT(robot.texts(), ElementsAre("to the subscriber", "to all"));
  EXPECT_EQ(rig.dropped(DropReason::away), 2u);
  EXPECT_EQ(told(DropReason::away), 2u);
  rig.send_flow(robot, proto::flow::Confirm{robot.data_frames});
  rig.settle();
  EXPECT_EQ(rig.ledger().queued, 0u);
  EXPECT_TRUE(rig.ledger().exact());
}

TEST_F(NewProgram, OneThatResumesGetsAll) {
  send_all();
  rig.rejoin(robot, kFirst);
  ASSERT_TRUE(robot.welcome && robot.welcome->resumed);
  rig.settle();
  EXPECT_THAT(robot.texts(),
              ElementsAre("to the node", "to the service", "to the subscriber", "to all"));
  EXPECT_EQ(rig.dropped(DropReason::away), 0u);
}

TEST_F(NewProgram, GetsWhatIsSentFromThenOn) {
  send_all();
  rig.rejoin(robot, kNext);
  rig.settle();
  robot.frames.clear();
  rig.send(sender, robot.id.value(), "for the new one");
  rig.settle();
  EXPECT_THAT(robot.texts(), ElementsAre("for the new one"));
}

// A message of which a part waited is lost as a whole.
TEST_F(NewProgram, GetsNoRestOfAMessage) {
  const auto fragment = [&](std::uint32_t offset) {
    std::string text(proto::kFragmentHeaderSize + 10, 'x');
    const std::uint32_t words[] = {1, offset, 20};
    std::memcpy(text.data(), words, sizeof words);
    rig.send(sender, robot.id.value(), text, {.flags = proto::kFlagFragment});
    rig.settle();
  };
  fragment(0);
  rig.rejoin(robot, kNext);
  fragment(10);
  EXPECT_THAT(robot.texts(), ElementsAre());
  EXPECT_EQ(rig.dropped(DropReason::away), 1u);
  EXPECT_EQ(rig.dropped(DropReason::cut_message), 1u);
  EXPECT_EQ(rig.ledger().queued, 0u);
}

TEST_F(NewProgram, LetsPausedSendersGoOn) {
  std::size_t sent = 0;
  for (; sent < 3'000 && sender.flow_of<proto::flow::Pause>().empty(); ++sent) {
    rig.send(sender, robot.id.value(), std::string(1'000, 'x'));
    rig.settle();
  }
  ASSERT_FALSE(sender.flow_of<proto::flow::Pause>().empty()) << "of " << sent << " messages";
  rig.rejoin(robot, kNext);
  rig.settle();
  EXPECT_FALSE(sender.flow_of<proto::flow::Resume>().empty());
  EXPECT_EQ(rig.dropped(DropReason::away), sent);
}

// The nodes behind a link had no break.
TEST(NewLink, GetsWhatWaitedForTheNodesBehindIt) {
  HubRig rig{2};
  FakeNode& sender = rig.join(0);
  FakeNode& link = rig.link(0, HubId{9}, {.resume = true});
  link.pipe.reset();
  rig.settle();
  rig.send(sender, make_id(HubId{9}, NodeIndex{4}).value(), "to a node there");
  rig.settle();
  rig.rejoin(link, kNext);
  rig.settle();
  EXPECT_THAT(link.texts(), ElementsAre("to a node there"));
}

}  // namespace
}  // namespace gimnet::hub
