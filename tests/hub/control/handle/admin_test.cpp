#include "hub/control/handle/admin.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "base/log.hpp"
#include "hub/config/options.hpp"
#include "proto/control/ctrl.hpp"
#include "proto/control/ns.hpp"
#include "tests/hub/control/support/test_conductor.hpp"

namespace gimnet::hub {
namespace {

using namespace std::chrono_literals;
namespace ctrl = proto::ctrl;
namespace ns = proto::ns;

class AdminTest : public ::testing::Test, protected TestConductor {
 protected:
  AdminTest() { set_log_level(LogLevel::off); }
  ~AdminTest() override { set_log_level(LogLevel::info); }
  template <class Answer, class Message>
  Answer ask_hub(const Node& node, const Message& message) {
    const auto answer = ask<Answer>(node, message, proto::Kind::ctrl);
    EXPECT_TRUE(answer);
    return *answer;
  }
};

TEST_F(AdminTest, TellsWhoTheHubIs) {
  const Node robot = join("robot");
  now += 60s;
  const auto info = ask_hub<ctrl::HubInfoAnswer>(robot, ctrl::HubInfo{});
  EXPECT_EQ(info.hub, kHub);
  EXPECT_EQ(info.hub_name, "hub-7");
  EXPECT_EQ(info.version, "1.2.3");
  EXPECT_EQ(info.shards, 2u);
  EXPECT_EQ(info.uptime_ms, 61'000u);
  EXPECT_EQ(info.nodes, 1u);
  EXPECT_EQ(info.services, 0u);
}

TEST_F(AdminTest, TellsTheCountersOfEveryShard) {
  const Node robot = join("robot");
  counters[1].delivered.add(42);
  const auto statistics = ask_hub<ctrl::StatisticsAnswer>(robot, ctrl::Statistics{});
  ASSERT_EQ(statistics.shards.size(), 2u);
  EXPECT_EQ(statistics.shards[1].shard, 1u);
  const auto& list = statistics.shards[1].counters;
  EXPECT_NE(std::find(list.begin(), list.end(), ctrl::CounterValue{"delivered", 42}), list.end());
}

TEST_F(AdminTest, TellsWhoWasRefusedInARecordOfItsOwn) {
  const Node robot = join("robot");
  refusals.count(proto::GoodbyeCode::hub_full);
  refusals.garbage.add(3);
  const auto statistics = ask_hub<ctrl::StatisticsAnswer>(robot, ctrl::Statistics{});
  ASSERT_EQ(statistics.shards.size(), 3u);
  EXPECT_EQ(statistics.shards[2],
            (ctrl::ShardRecord{ctrl::kConductorRecord,
                               {{"refused.hub_full", 1}, {"refused.garbage", 3}}}));
}

TEST_F(AdminTest, TellsWhatWasAskedAboutNames) {
  const Node robot = join("robot");
  ASSERT_TRUE(ask<ns::ResolveAnswer>(robot, ns::Resolve{"robot"}));
  ASSERT_FALSE(ask<ns::ResolveAnswer>(robot, ns::Resolve{"nobody"}));
  const auto statistics = ask_hub<ctrl::StatisticsAnswer>(robot, ctrl::Statistics{});
  ASSERT_EQ(statistics.shards.size(), 3u);
  EXPECT_EQ(statistics.shards[2],
            (ctrl::ShardRecord{ctrl::kConductorRecord,
                               {{"names.resolve", 2}, {"names.refused.not_found", 1}}}));
}

TEST_F(AdminTest, TellsWhatWasAskedOfTheHub) {
  const Node robot = join("robot");
  ask_hub<ctrl::HubInfoAnswer>(robot, ctrl::HubInfo{});
  ASSERT_FALSE(ask<ctrl::DrainAnswer>(robot, ctrl::Drain{}, proto::Kind::ctrl));
  const auto statistics = ask_hub<ctrl::StatisticsAnswer>(robot, ctrl::Statistics{});
  ASSERT_EQ(statistics.shards.size(), 3u);
  EXPECT_EQ(
      statistics.shards[2],
      (ctrl::ShardRecord{ctrl::kConductorRecord,
                         {{"ctrl.hub_info", 1}, {"ctrl.drain", 1}, {"ctrl.refused.denied", 1}}}));
}

TEST_F(AdminTest, StatisticsOfTheMostShardsFitInAFrame) {
  const Node robot = join("robot");
  counters[0].delivered.add(~std::uint64_t{0});
  ask_hub<ctrl::StatisticsAnswer>(robot, ctrl::Statistics{});
  const std::size_t two_shards =
      std::get<SendControlCommand>(shards.sent.back().command).frame.size();
  EXPECT_LE(two_shards / 2 * kShardCountMax, proto::kFrameLengthDefault);
}

TEST_F(AdminTest, TellsWhereConnectionsAre) {
  const Node robot = join("robot");
  const Node viewer = join("viewer");
  detach(viewer);
  const auto answer = ask_hub<ctrl::ConnectionsAnswer>(robot, ctrl::Connections{});
  ASSERT_EQ(answer.connections.size(), 2u);
  EXPECT_EQ(answer.connections[0].node, robot.id);
  EXPECT_EQ(answer.connections[0].name, "robot");
  EXPECT_EQ(answer.connections[0].shard, robot.shard.value());
  EXPECT_EQ(answer.connections[0].transport, "tcp");
  EXPECT_EQ(answer.connections[0].peer, "127.0.0.1:5000");
  EXPECT_TRUE(answer.connections[0].connected);
  EXPECT_EQ(answer.connections[1].shard, viewer.shard.value());
  EXPECT_FALSE(answer.connections[1].connected);
  const auto rest = ask_hub<ctrl::ConnectionsAnswer>(
      robot, ctrl::Connections{.after = robot.id, .records_max = 1});
  ASSERT_EQ(rest.connections.size(), 1u);
  EXPECT_EQ(rest.connections[0].node, viewer.id);
  EXPECT_FALSE(rest.more);
}

TEST_F(AdminTest, TellsWhatEachNodeCameTo) {
  const Node robot = join("robot");
  const auto counts = [&] {
    return ask_hub<ctrl::ConnectionsAnswer>(robot, ctrl::Connections{}).connections[0].counts;
  };
  EXPECT_EQ(counts(), ctrl::ConnectionCounts{}) << "its shard has not seen it yet";
  SessionGauges& shard = sessions[robot.shard.value()];
  SessionCounters& its = shard.begin(robot.session.slot, robot.session.generation);
  its.accepted.add(1);
  its.received_bytes.add(2);
  its.delivered.add(3);
  its.sent_bytes.add(4);
  its.dropped.add(5);
  shard.set_queued(robot.session.slot, 6);
  EXPECT_EQ(counts(), (ctrl::ConnectionCounts{6, 1, 2, 3, 4, 5, 0}));
  static_cast<void>(shard.begin(robot.session.slot, robot.session.generation - 1));
  EXPECT_EQ(counts(), ctrl::ConnectionCounts{}) << "those are another session's";
}

TEST_F(AdminTest, TellsWhatEachNodeAndServiceMissedAndWhoMissedMost) {
  const Node robot = join("robot");
  const Node viewer = join("viewer");
  const Node slow = join("slow");
  const auto offered = ask<ns::AdvertiseAnswer>(robot, ns::Advertise{.service = "odom"});
  ASSERT_TRUE(offered);
  const auto tell = [&](const Node& node, std::uint64_t total) {
    conductor.on_event({node.shard, MissedEvent{node.session, node.id, {offered->group, total}}},
                       now);
  };
  const auto of_service = [&] {
    const auto listed = ask<ns::ServicesAnswer>(robot, ns::ServicesRequest{});
    return std::pair{listed->services[0].missed, listed->services[0].missed_most};
  };
  const auto of_nodes = [&] {
    std::vector<std::uint64_t> missed;
    for (const auto& each :
         ask_hub<ctrl::ConnectionsAnswer>(robot, ctrl::Connections{}).connections)
      missed.push_back(each.counts.missed);
    return missed;
  };
  tell(viewer, 5);
  EXPECT_EQ(of_service(), std::pair(std::uint64_t{0}, NodeId{})) << "it is no subscriber";
  for (const Node& node : {viewer, slow})
    ASSERT_TRUE(ask<ns::SubscribeAnswer>(node, ns::Subscribe{.name = "robot/odom"}));
  tell(viewer, 5);
  tell(slow, 4);
  tell(slow, 9);
  EXPECT_EQ(of_service(), std::pair(std::uint64_t{14}, slow.id));
  EXPECT_EQ(of_nodes(), (std::vector<std::uint64_t>{0, 5, 9}));
  ASSERT_TRUE(ask<ns::UnsubscribeAnswer>(slow, ns::Unsubscribe{"robot/odom"}));
  EXPECT_EQ(of_service(), std::pair(std::uint64_t{5}, viewer.id));
}

}  // namespace
}  // namespace gimnet::hub
