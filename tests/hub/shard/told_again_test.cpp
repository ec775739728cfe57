#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/hub/shard/support/hub_rig.hpp"

// What a node is told at its return, before all that waits for it, and how the conductor learns
// that it was read.

namespace gimnet::hub {
namespace {

using proto::Kind;
using ::testing::ElementsAre;
using testing::FakeNode;
using testing::HubRig;
using ::testing::IsEmpty;
using testing::JoinSpec;
using ::testing::SizeIs;

constexpr std::uint32_t kGroup = 5;

std::vector<std::byte> event_for(const FakeNode& node, std::size_t bytes = 8) {
  return HubRig::frame(node, node.id.value(), std::string(bytes, 'e'),
                       {.kind = Kind::ns, .src = 7u << 20});
}

/// The moves that the conductor was told to be read, with the number of the connection.
std::vector<std::pair<std::uint64_t, std::uint32_t>> read_moves(HubRig& rig) {
  std::vector<std::pair<std::uint64_t, std::uint32_t>> found;
  for (const ShardEvent& event : rig.take_events()) {
    const auto* read = std::get_if<MovesReadEvent>(&event.what);
    if (read != nullptr) found.emplace_back(read->move, read->attachment);
  }
  return found;
}

void pong(HubRig& rig, FakeNode& node, std::uint32_t sequence) {
  rig.send_flow(node, proto::flow::Pong{sequence, 0, 0});
  rig.settle();
}

std::uint32_t last_ping(const FakeNode& node) {
  const auto pings = node.flow_of<proto::flow::Ping>();
  return pings.empty() ? 0 : pings.back().sequence;
}

SendControlCommand move_for(const FakeNode& node, std::uint64_t move) {
  SendControlCommand command;
  command.session = node.session;
  command.frame = event_for(node);
  command.move = move;
  return command;
}

TEST(ToldAgain, StandsBeforeWhatIsSentAgainAndWhatWaits) {
  HubRig rig;
  FakeNode& provider = rig.join(0);
  FakeNode& subscriber = rig.join(0, {.resume = true});
  rig.publish_group(kGroup, provider.id, {&subscriber});
  rig.send(provider, HubRig::group(kGroup), "lost on the way", {.kind = Kind::group});
  rig.settle_without_reading();
  subscriber.pipe.close();
  rig.settle_without_reading();
  rig.send(provider, HubRig::group(kGroup), "while away", {.kind = Kind::group});
  rig.settle_without_reading();
  subscriber.kinds.clear();
  const auto event = event_for(subscriber);
  rig.rejoin(subscriber, {.resume = true, .told = event, .told_move = 9});
  rig.settle();
  ASSERT_TRUE(subscriber.welcome->resumed);
  EXPECT_THAT(subscriber.texts(), ElementsAre("lost on the way", "while away"));
  EXPECT_THAT(subscriber.kinds,
              ElementsAre(Kind::link, Kind::ns, Kind::flow, Kind::group, Kind::group));
  EXPECT_THAT(read_moves(rig), IsEmpty());
  pong(rig, subscriber, last_ping(subscriber));
  EXPECT_THAT(read_moves(rig), ElementsAre(std::pair{9u, 2u}));
}

TEST(ToldAgain, ANodeThatIsToldMuchMayAskAllTheSame) {
  Limits limits;
  limits.control_bytes = 16 * 1024;
  HubRig rig(1, limits);
  FakeNode& node = rig.join(0);
  std::vector<std::byte> events;
  for (int i = 0; i < 100; ++i) {
    const auto event = event_for(node, 1024);
    events.insert(events.end(), event.begin(), event.end());
  }
  node.kinds.clear();
  rig.rejoin(node, {.told = events, .told_move = 1});
  rig.command(0, move_for(node, 2));
  rig.settle();
  EXPECT_EQ(std::ranges::count(node.kinds, Kind::ns), 101);
  EXPECT_FALSE(node.goodbye);
}

TEST(ToldAgain, OneEventGoesToEachOfManySessions) {
  HubRig rig;
  FakeNode& one = rig.join(0);
  FakeNode& other = rig.join(0);
  TellCommand command;
  command.frame = event_for(one);
  command.move = 4;
  for (const FakeNode* node : {&one, &other}) command.to.push_back({node->session, node->id});
  command.to.push_back({{ConnectionSlot{77}, 1}, NodeId{77}});  // it left meanwhile
  rig.command(0, std::move(command));
  rig.settle();
  for (FakeNode* node : {&one, &other}) {
    EXPECT_EQ(std::ranges::count(node->kinds, Kind::ns), 1);
    pong(rig, *node, last_ping(*node));
    EXPECT_THAT(read_moves(rig), ElementsAre(std::pair{4u, 1u}));
  }
}

TEST(ToldAgain, NothingIsAskedWhereNothingWasTold) {
  HubRig rig;
  FakeNode& node = rig.join(0);
  rig.rejoin(node);
  rig.command(0, move_for(node, 0));
  rig.settle();
  EXPECT_THAT(node.flow(), IsEmpty());
  pong(rig, node, 0);
  pong(rig, node, 1);
  EXPECT_THAT(read_moves(rig), IsEmpty());
}

TEST(ToldAgain, OnePingIsUnderWayHoweverMuchIsTold) {
  HubRig rig;
  FakeNode& node = rig.join(0);
  for (std::uint64_t move = 1; move <= 20; ++move) rig.command(0, move_for(node, move));
  rig.settle();
  ASSERT_THAT(node.flow_of<proto::flow::Ping>(), SizeIs(1));
  const std::uint32_t first = last_ping(node);
  pong(rig, node, first + 1);
  EXPECT_THAT(read_moves(rig), IsEmpty()) << "that answers another PING";
  pong(rig, node, first);
  EXPECT_THAT(read_moves(rig), ElementsAre(std::pair{1u, 1u}))
      << "no more than what stood before the PING";
  ASSERT_THAT(node.flow_of<proto::flow::Ping>(), SizeIs(2));
  pong(rig, node, first);
  EXPECT_THAT(read_moves(rig), IsEmpty());
  pong(rig, node, last_ping(node));
  EXPECT_THAT(read_moves(rig), ElementsAre(std::pair{20u, 1u}));
  pong(rig, node, last_ping(node));
  EXPECT_THAT(read_moves(rig), IsEmpty());
  EXPECT_THAT(node.flow_of<proto::flow::Ping>(), SizeIs(2));
}

TEST(ToldAgain, AnAnswerOfAnEarlierConnectionProvesNothing) {
  HubRig rig;
  FakeNode& node = rig.join(0);
  rig.command(0, move_for(node, 1));
  rig.settle();
  const std::uint32_t asked = last_ping(node);
  rig.rejoin(node);
  pong(rig, node, asked);
  EXPECT_THAT(read_moves(rig), IsEmpty());
}

TEST(ToldAgain, KeepAliveGoesOnBesideIt) {
  Limits limits;
  HubRig rig(1, limits);
  FakeNode& node = rig.join(0);
  rig.command(0, move_for(node, 3));
  rig.settle();
  const std::uint32_t asked = last_ping(node);
  rig.pass_ms(limits.keep_alive_ms + 100, false);
  rig.settle();
  ASSERT_NE(last_ping(node), asked);
  pong(rig, node, last_ping(node));
  EXPECT_THAT(read_moves(rig), IsEmpty());
  pong(rig, node, asked);
  EXPECT_THAT(read_moves(rig), ElementsAre(std::pair{3u, 1u}));
}

}  // namespace
}  // namespace gimnet::hub
