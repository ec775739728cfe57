#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "proto/control/ctrl.hpp"
#include "proto/control/ns.hpp"
#include "tests/hub/control/support/test_conductor.hpp"

// Tests the words to a node at its return about services that moved while it was away, or whose
// event was lost with its connection: with the command that lets WELCOME out, so that it stands
// before all that waits for the node.

namespace gimnet::hub {
namespace {

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
  TestConductor hub_;
  TestConductor::Node robot_;
  TestConductor::Node viewer_;
  GroupId first_;
};

TEST_F(ToldAgainTest, WhatChangedWhileTheNodeWasAwayIsToldAsItIsNow) {
  hub_.detach(viewer_);
  advertise(6);
  const GroupId present = advertise(7);
  EXPECT_THAT(hub_.events<ns::ServiceMoved>(), IsEmpty());
  come_back();
  const auto events = told();
  ASSERT_EQ(events.size(), 1u);
  EXPECT_EQ(events[0].name, "robot/odom");
  EXPECT_EQ(events[0].group, present);
  EXPECT_EQ(events[0].provider, robot_.id);
  EXPECT_EQ(events[0].message_type, 7u);
}

TEST_F(ToldAgainTest, WhatMayHaveBeenLostWithTheConnection) {
  const GroupId present = advertise(6);
  ASSERT_EQ(hub_.events<ns::ServiceMoved>().size(), 1u);
  hub_.detach(viewer_);
  come_back();
  ASSERT_EQ(told().size(), 1u);
  EXPECT_EQ(told()[0].group, present);
  come_back();
  EXPECT_THAT(told(), IsEmpty()) << "nothing changed since the second connection began";
}

TEST_F(ToldAgainTest, ThatAProviderWent) {
  hub_.detach(viewer_);
  hub_.detach(robot_, true, proto::GoodbyeCode::done);
  come_back();
  ASSERT_EQ(told().size(), 1u);
  EXPECT_EQ(told()[0].group, first_) << "the group stays";
  EXPECT_EQ(told()[0].provider, NodeId{});
  EXPECT_EQ(told()[0].session, 0u);
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
