#include "hub/control/tellings.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>
#include <string>
#include <vector>

#include "base/log.hpp"
#include "proto/control/ns.hpp"
#include "proto/control/ns_register.hpp"
#include "proto/control/ns_watch.hpp"
#include "tests/hub/control/support/test_conductor.hpp"

// A service that moves is told in pieces: how many there are, who is told in which, and what a node
// is told again that missed events.

namespace gimnet::hub {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;
namespace ns = proto::ns;

class TellingsTest : public ::testing::Test, protected TestConductor {
 protected:
  TellingsTest() { set_log_level(LogLevel::off); }
  ~TellingsTest() override { set_log_level(LogLevel::info); }

  GroupId advertise(const Node& node, ns::Advertise offer) {
    const auto answer = ask<ns::AdvertiseAnswer>(node, offer);
    EXPECT_TRUE(answer);
    return answer ? answer->group : GroupId{};
  }
  std::vector<Node> subscribers(std::size_t count, const std::vector<std::string>& names) {
    std::vector<Node> viewers;
    for (std::size_t i = 0; i < count; ++i) {
      viewers.push_back(join("viewer-" + std::to_string(i)));
      for (const std::string& name : names)
        EXPECT_TRUE(ask<ns::SubscribeAnswer>(viewers.back(), ns::Subscribe{name}));
    }
    return viewers;
  }
  /// Nodes that were told how that service moved since the last call, in order.
  std::vector<NodeId> take_told() {
    std::vector<NodeId> told;
    for (const auto* command : shards.all<SendControlCommand>()) {
      const auto view = proto::split_control(payload_of(*command));
      if (view->header.operation != ns::ServiceMoved::kOperation) continue;
      EXPECT_TRUE(command->may_drop);
      told.push_back(NodeId{proto::load_header(command->frame.data()).dst});
    }
    shards.sent.clear();
    return told;
  }
  std::size_t members(GroupId group) const {
    const GroupMembers* found = groups.find(index_of(group));
    std::size_t count = 0;
    for (const auto& list : found->by_shard) count += list.size();
    for (const auto& list : found->paced_by_shard) count += list.size();
    return count;
  }
  void miss_events(const Node& node, std::uint32_t attachment) {
    conductor.on_event({node.shard, EventsMissedEvent{node.session, attachment, node.id}}, now);
  }
};

TEST_F(TellingsTest, ARegisterOfManyServicesIsToldInPiecesOfTheLimit) {
  limits.told_at_once = 10;
  const Node robot = join("robot");
  std::vector<std::string> names;
  for (int i = 0; i < 5; ++i) {
    const std::string service = "s" + std::to_string(i);
    advertise(robot, {.service = service});
    names.push_back("robot/" + service);
  }
  subscribers(7, names);
  take_told();
  ASSERT_TRUE(ask<ns::RegisterNameAnswer>(robot, ns::RegisterName{"other"}));
  EXPECT_THAT(take_told(), SizeIs(10));
  EXPECT_EQ(conductor.membership().topics().provided(), 0u) << "the state changes in one step";
  EXPECT_TRUE(conductor.tell_rest(now));
  EXPECT_THAT(take_told(), SizeIs(10));
  EXPECT_TRUE(conductor.tell_rest(now));
  EXPECT_THAT(take_told(), SizeIs(10));
  EXPECT_FALSE(conductor.tell_rest(now));
  EXPECT_THAT(take_told(), SizeIs(5));
}

TEST_F(TellingsTest, AServiceThatMovesAgainAndAgainKeepsNobodyFromBeingTold) {
  limits.told_at_once = 2;
  const Node robot = join("robot");
  advertise(robot, {.service = "odom"});
  const auto viewers = subscribers(5, {"robot/odom"});
  take_told();
  std::set<NodeId> told;
  for (std::uint32_t type = 1; type <= 3; ++type) {
    advertise(robot, {.service = "odom", .message_type = type});
    for (const NodeId node : take_told()) told.insert(node);
  }
  EXPECT_THAT(told, SizeIs(5));
  while (conductor.tell_rest(now)) {
  }
  EXPECT_EQ(take_told().back(), viewers.back().id) << "and all once more, since it moved meanwhile";
}

TEST_F(TellingsTest, ASubscriberJoinsANewGroupOnceItIsTold) {
  limits.told_at_once = 2;
  const Node robot = join("robot");
  const auto viewers = subscribers(5, {"robot/map"});
  shards.sent.clear();
  const GroupId group = advertise(robot, {.service = "map", .retain = true});
  EXPECT_EQ(members(group), 2u);
  EXPECT_THAT(shards.all<PaceCommand>(), SizeIs(2));
  EXPECT_TRUE(shards.all<PaceCommand>().front()->with_event);
  // One that subscribes again is told by the answer, and joins at once.
  ASSERT_TRUE(ask<ns::SubscribeAnswer>(viewers[4], ns::Subscribe{.name = "robot/map", .depth = 2}));
  EXPECT_EQ(members(group), 2u) << "its terms in force are those that the service gives anyway";
  take_told();
  ASSERT_TRUE(ask<ns::UnsubscribeAnswer>(viewers[3], ns::Unsubscribe{"robot/map"}));
  EXPECT_EQ(members(group), 2u);
  EXPECT_FALSE(conductor.tell_rest(now));
  EXPECT_THAT(take_told(), ElementsAre(viewers[2].id, viewers[4].id));
  EXPECT_EQ(members(group), 4u);
}

TEST_F(TellingsTest, WhoComesBackBeforeItsTurnIsAMemberAtOnce) {
  limits.told_at_once = 1;
  const Node robot = join("robot");
  auto viewers = subscribers(3, {"robot/map"});
  const GroupId group = advertise(robot, {.service = "map", .retain = true});
  detach(viewers[2]);
  proto::Hello hello;
  hello.token = viewers[2].welcome.token;
  hello.name = "viewer-2";
  join(hello);
  EXPECT_EQ(members(group), 2u) << "WELCOME told it";
  while (conductor.tell_rest(now)) {
  }
  EXPECT_EQ(members(group), 3u);
}

TEST_F(TellingsTest, ANodeThatMissedEventsIsToldWhatMovedAndWhoSubscribed) {
  const Node robot = join("robot");
  const Node viewer = join("viewer");
  const GroupId own = advertise(viewer, {.service = "view"});
  ASSERT_TRUE(ask<ns::SubscribeAnswer>(viewer, ns::Subscribe{"robot/map"}));
  ASSERT_TRUE(ask<ns::SubscribeAnswer>(viewer, ns::Subscribe{"robot/odom"}));
  ASSERT_TRUE(ask<ns::WatchAnswer>(viewer, ns::Watch{.watch = 1}));
  const GroupId map = advertise(robot, {.service = "map", .retain = true});
  ASSERT_TRUE(ask<ns::SubscribeAnswer>(robot, ns::Subscribe{"viewer/view"}));
  while (conductor.tell_rest(now)) {
  }
  shards.sent.clear();
  miss_events(viewer, viewer.attachment + 1);
  EXPECT_FALSE(conductor.tell_rest(now));
  EXPECT_THAT(shards.sent, IsEmpty()) << "of another connection";
  miss_events(viewer, viewer.attachment);
  EXPECT_FALSE(conductor.tell_rest(now));
  const auto told = shards.all<TellAgainCommand>();
  ASSERT_THAT(told, SizeIs(1));
  EXPECT_EQ(told[0]->attachment, viewer.attachment);
  std::span<const std::byte> frames{told[0]->frames};
  const auto next = [&] {
    const std::size_t size = proto::load_header(frames.data()).frame_size();
    const auto payload = frames.first(size).subspan(proto::kHeaderSize);
    frames = frames.subspan(size);
    return payload;
  };
  const auto moved = proto::decode<ns::ServiceMoved>(next());
  ASSERT_TRUE(moved);
  EXPECT_EQ(moved->group, map);
  const auto subscribed = proto::decode<ns::Subscribers>(next());
  ASSERT_TRUE(subscribed);
  EXPECT_EQ(subscribed->group, own);
  EXPECT_EQ(subscribed->subscribers, 1u);
  EXPECT_TRUE(frames.empty());
  const auto paces = shards.all<PaceCommand>();
  ASSERT_THAT(paces, SizeIs(1));
  EXPECT_FALSE(paces[0]->with_event) << "it is told now";
  ASSERT_FALSE(events<ns::WatchEvents>().empty()) << "what it watches begins again";
  EXPECT_EQ(events<ns::WatchEvents>()[0].changes.front().kind, ns::ChangeKind::begin);
}

}  // namespace
}  // namespace gimnet::hub
