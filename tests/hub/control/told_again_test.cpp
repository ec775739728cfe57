#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "proto/control/ctrl.hpp"
#include "proto/control/ns.hpp"
#include "tests/hub/control/support/test_conductor.hpp"

// What a node is told at its return of services that moved while it was away, or whose event was
// lost with its connection: with the command that lets WELCOME out, so that it stands before all
// that waits for the node.

namespace gimnet::hub {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
namespace ns = proto::ns;

class ToldAgainTest : public ::testing::Test {
 protected:
  ToldAgainTest() : robot_(hub_.join("robot")), viewer_(hub_.join("viewer")) {
    first_ = advertise(5);
    static_cast<void>(hub_.ask<ns::SubscribeAnswer>(viewer_, ns::Subscribe{"robot/odom"}));
  }
  GroupId advertise(std::uint32_t type) {
    ns::Advertise offer;
    offer.service = "odom";
    offer.message_type = type;
    return hub_.ask<ns::AdvertiseAnswer>(robot_, offer)->group;
  }
  void come_back() {
    proto::Hello hello;
    hello.name = "viewer";
    hello.token = viewer_.welcome.token;
    viewer_ = hub_.join(hello);
  }
  const AttachCommand& attach() { return std::get<AttachCommand>(hub_.shards.sent.back().command); }
  std::vector<ns::ServiceMoved> told() {
    std::vector<ns::ServiceMoved> events;
    std::span<const std::byte> frames = attach().told;
    while (!frames.empty()) {
      const proto::FrameHeader header = proto::load_header(frames.data());
      EXPECT_EQ(header.dst, viewer_.id.value());
      const auto event =
          proto::decode<ns::ServiceMoved>(frames.subspan(proto::kHeaderSize, header.length));
      EXPECT_TRUE(event);
      if (event) events.push_back(*event);
      frames = frames.subspan(header.frame_size());
    }
    return events;
  }
  std::uint64_t last_move() const {
    std::uint64_t move = 0;
    for (const auto* command : hub_.shards.all<SendControlCommand>())
      move = std::max(move, command->move);
    return move;
  }
  void read(std::uint64_t move, std::uint32_t attachment) {
    hub_.conductor.on_event(
        {viewer_.shard, MovesReadEvent{viewer_.session, attachment, viewer_.id, move}}, hub_.now);
  }

  TestConductor hub_;
  TestConductor::Node robot_;
  TestConductor::Node viewer_;
  GroupId first_;
};

TEST_F(ToldAgainTest, WhatMovedWhileTheNodeWasAway) {
  hub_.detach(viewer_);
  const GroupId between = advertise(6);
  const GroupId present = advertise(7);
  EXPECT_THAT(hub_.events<ns::ServiceMoved>(), IsEmpty());
  come_back();
  const auto events = told();
  ASSERT_EQ(events.size(), 1u);
  EXPECT_EQ(events[0].name, "robot/odom");
  EXPECT_EQ(events[0].old_group, first_);
  EXPECT_EQ(events[0].new_group, present);
  EXPECT_THAT(events[0].between, ElementsAre(between));
  EXPECT_TRUE(events[0].again);
  EXPECT_NE(attach().told_move, 0u);
}

TEST_F(ToldAgainTest, OfTheGroupsInBetweenTheLatestAreToldAsManyAsTheLimitSays) {
  hub_.detach(viewer_);
  std::vector<GroupId> between;
  while (between.size() < ns::kGroupsBetweenMax)
    between.push_back(advertise(6 + static_cast<std::uint32_t>(between.size())));
  GroupId present = advertise(50);
  come_back();
  ASSERT_EQ(told().size(), 1u);
  EXPECT_EQ(told()[0].old_group, first_);
  EXPECT_EQ(told()[0].between, between);
  EXPECT_EQ(told()[0].new_group, present);
  hub_.detach(viewer_);
  between.erase(between.begin());
  between.push_back(std::exchange(present, advertise(51)));
  come_back();
  ASSERT_EQ(told().size(), 1u);
  EXPECT_EQ(told()[0].old_group, first_) << "which it surely knows";
  EXPECT_EQ(told()[0].between, between);
  EXPECT_EQ(told()[0].new_group, present);
}

TEST_F(ToldAgainTest, WhatMayHaveBeenLostWithTheConnection) {
  const GroupId present = advertise(6);
  const auto sent = hub_.events<ns::ServiceMoved>();
  ASSERT_EQ(sent.size(), 1u);
  EXPECT_FALSE(sent[0].again);
  hub_.detach(viewer_);
  come_back();
  ASSERT_EQ(told().size(), 1u);
  EXPECT_EQ(told()[0].new_group, present);
  come_back();
  EXPECT_EQ(told().size(), 1u) << "nor is it known that it was read on the second connection";
}

TEST_F(ToldAgainTest, NothingThatWasRead) {
  advertise(6);
  const std::uint64_t move = last_move();
  ASSERT_NE(move, 0u);
  read(move, viewer_.attachment);
  hub_.detach(viewer_);
  come_back();
  EXPECT_THAT(told(), IsEmpty());
  EXPECT_EQ(attach().told_move, 0u);
}

TEST_F(ToldAgainTest, WhatWasReadOnAnEarlierConnectionIsToldAgainAllTheSame) {
  advertise(6);
  const std::uint64_t move = last_move();
  const std::uint32_t earlier = viewer_.attachment;
  come_back();
  read(move, earlier);
  come_back();
  EXPECT_EQ(told().size(), 1u);
  read(attach().told_move, viewer_.attachment);
  come_back();
  EXPECT_THAT(told(), IsEmpty());
}

TEST_F(ToldAgainTest, AlsoUnderAnotherId) {
  hub_.may_administer = true;
  proto::Hello hello;
  hello.role = proto::Role::admin;
  const auto admin = hub_.join(hello);
  hub_.detach(viewer_);
  advertise(6);
  proto::ctrl::Reassign reassign;
  reassign.node = viewer_.id;
  reassign.new_node = make_id<NodeId>(TestConductor::kHub, 900);
  ASSERT_TRUE(hub_.ask<proto::ctrl::ReassignAnswer>(admin, reassign, proto::Kind::ctrl));
  come_back();
  EXPECT_EQ(viewer_.id, reassign.new_node);
  EXPECT_EQ(told().size(), 1u);
}

TEST_F(ToldAgainTest, NothingToOneWhoseSessionIsNew) {
  hub_.detach(viewer_, true, proto::GoodbyeCode::done);
  advertise(6);
  viewer_ = hub_.join("viewer");
  EXPECT_THAT(told(), IsEmpty());
}

}  // namespace
}  // namespace gimnet::hub
