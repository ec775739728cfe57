#include "hub/shard/io_shard.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>

#include "tests/hub/shard/support/hub_rig.hpp"

namespace gimnet::hub {
namespace {

using proto::DropReason;
using proto::Kind;
using ::testing::ElementsAre;
using testing::FakeNode;
using testing::FrameSpec;
using testing::HubRig;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr std::uint32_t kEverybody = 7u << 20 | kEveryIndex;

std::string list_payload(std::initializer_list<std::uint32_t> ids, const std::string& payload) {
  std::string text(4 * ids.size(), '\0');
  std::memcpy(text.data(), std::data(ids), text.size());
  return text + payload;
}

TEST(IoShard, CarriesFramesBetweenShardsInOrder) {
  HubRig rig(2);
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(1);
  std::vector<std::string> sent;
  for (int i = 0; i < 300; ++i) {
    sent.push_back(std::to_string(i));
    rig.send(a, b.id.value(), sent.back());
    if (i % 7 == 0) rig.turn();
  }
  rig.settle();
  EXPECT_EQ(b.texts(), sent);
  EXPECT_EQ(rig.sum(&ShardCounters::mailbox_frames), 300u);
  EXPECT_LE(rig.sum(&ShardCounters::mailbox_entries), 44u) << "one entry a burst, not a frame";
}

TEST(IoShard, BroadcastReachesEverybodyButItsSender) {
  HubRig rig(3);
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(0);
  FakeNode& c = rig.join(1);
  FakeNode& d = rig.join(1);
  rig.send(a, kEverybody, "own hub", {.kind = Kind::broadcast});
  rig.send(a, 0xFFFFFFFF, "every hub", {.kind = Kind::broadcast});
  rig.send(a, 8u << 20 | kEveryIndex, "another hub", {.kind = Kind::broadcast});
  rig.settle();
  for (const FakeNode* node : {&b, &c, &d})
    EXPECT_THAT(node->texts(), ElementsAre("own hub", "every hub"));
  EXPECT_THAT(a.frames, IsEmpty());
  EXPECT_EQ(rig.ledger().delivered, 6u);
  EXPECT_EQ(rig.dropped(DropReason::no_route), 1u);
  EXPECT_EQ(rig.dropped(DropReason::no_subscriber), 0u) << "a shard without nodes is nobody's loss";
}

TEST(IoShard, ABroadcastWithoutRecipientIsCountedOnce) {
  HubRig rig(2);
  FakeNode& a = rig.join(0);
  rig.send(a, kEverybody, "alone", {.kind = Kind::broadcast, .flags = proto::kFlagReport});
  rig.settle();
  EXPECT_EQ(rig.dropped(DropReason::no_subscriber), 1u);
  EXPECT_EQ(rig.ledger().dropped, 1u);
  EXPECT_THAT(a.reports(), SizeIs(1));
}

TEST(IoShard, GroupReachesSubscribersOnAllShards) {
  HubRig rig(2);
  FakeNode& provider = rig.join(0);
  std::vector<FakeNode*> members;
  for (std::size_t i = 0; i < 11; ++i) members.push_back(&rig.join(i % 2));
  FakeNode& other = rig.join(1);
  rig.publish_group(5, provider.id, members);
  rig.send(provider, HubRig::group(5), "small", {.kind = Kind::group});
  rig.send(provider, HubRig::group(5), std::string(5'000, 'L'), {.kind = Kind::group});
  rig.send(other, HubRig::group(5), "not the provider", {.kind = Kind::group});
  rig.send(provider, HubRig::group(6), "no such group", {.kind = Kind::group});
  rig.settle();
  for (const FakeNode* member : members)
    EXPECT_THAT(member->texts(), ElementsAre("small", std::string(5'000, 'L')));
  EXPECT_THAT(other.frames, IsEmpty());
  EXPECT_EQ(rig.dropped(DropReason::not_allowed), 1u);
  EXPECT_EQ(rig.dropped(DropReason::no_such_group), 1u);
  EXPECT_EQ(rig.ledger().delivered, 22u);
}

TEST(IoShard, AGroupWithoutMembersDropsItsFrames) {
  HubRig rig(2);
  FakeNode& provider = rig.join(0);
  rig.publish_group(5, provider.id, {});
  rig.send(provider, HubRig::group(5), "nobody listens", {.kind = Kind::group});
  rig.settle();
  EXPECT_EQ(rig.dropped(DropReason::no_subscriber), 1u);
}

TEST(IoShard, ServiceReachesTheProvider) {
  for (const std::size_t shard : {0u, 1u}) {
    HubRig rig(2);
    FakeNode& provider = rig.join(shard);
    FakeNode& client = rig.join(0);
    rig.publish_group(5, provider.id, {}, true);
    rig.send(client, HubRig::group(5), "request", {.kind = Kind::service});
    rig.settle();
    EXPECT_THAT(provider.texts(), ElementsAre("request"));
    EXPECT_EQ(provider.frames[0].header.dst, HubRig::group(5));
  }
}

TEST(IoShard, ListReachesEachOfItsNodesOnceAndWithoutTheIds) {
  HubRig rig(2);
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(0);
  FakeNode& c = rig.join(1);
  FakeNode& d = rig.join(1);
  const std::uint32_t nobody = 7u << 20 | 900;
  rig.send(a, 4, list_payload({b.id.value(), c.id.value(), d.id.value(), nobody}, "to three"),
           {.kind = Kind::list});
  rig.send(a, 1, list_payload({c.id.value()}, "to one far away"), {.kind = Kind::list});
  rig.send(a, 1, list_payload({b.id.value()}, ""), {.kind = Kind::list});
  rig.settle();
  EXPECT_THAT(b.texts(), ElementsAre("to three", ""));
  EXPECT_THAT(c.texts(), ElementsAre("to three", "to one far away"));
  EXPECT_THAT(d.texts(), ElementsAre("to three"));
  for (const FakeNode* node : {&b, &c, &d}) {
    EXPECT_EQ(node->frames[0].header.dst, 0u);
    EXPECT_EQ(node->frames[0].header.kind, Kind::list);
    EXPECT_EQ(node->frames[0].header.src, a.id.value());
  }
  EXPECT_EQ(rig.dropped(DropReason::no_such_node), 1u);
  EXPECT_EQ(rig.ledger().delivered, 5u);
}

TEST(IoShard, ListOf1024NodesAndPayloadsOfEverySize) {
  HubRig rig(2);
  FakeNode& a = rig.join(0);
  std::vector<FakeNode*> nodes;
  std::string ids;
  for (std::size_t i = 0; i < 1'024; ++i) {
    nodes.push_back(&rig.join(i % 2));
    const std::uint32_t id = nodes.back()->id.value();
    ids.append(reinterpret_cast<const char*>(&id), sizeof id);
  }
  for (const std::size_t size : {0u, 1u, 100u, 20'000u, 61'440u}) {
    rig.send(a, 1'024, ids + std::string(size, 'x'), {.kind = Kind::list});
    rig.settle();
    for (FakeNode* node : nodes) {
      ASSERT_THAT(node->frames, SizeIs(1)) << size;
      EXPECT_EQ(node->frames[0].body.size(), size);
      node->frames.clear();
    }
  }
}

TEST(IoShard, AFrameLargerThanItsRecipientTakesIsDropped) {
  HubRig rig(2);
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(1, {.frame_bytes = 1'000});
  rig.send(a, b.id.value(), std::string(1'000, 'x'));
  rig.send(a, b.id.value(), std::string(1'001, 'x'), {.lane = 2});
  rig.settle();
  EXPECT_THAT(b.frames, SizeIs(1));
  EXPECT_EQ(rig.dropped(DropReason::too_large), 1u);
}

// In one run with the same header: only those that are too large go.
TEST(IoShard, SmallFramesBesideALargeOneArrive) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(0, {.frame_bytes = 1'000});
  rig.send(a, b.id.value(), "small");
  rig.send(a, b.id.value(), std::string(1'001, 'x'));
  rig.send(a, b.id.value(), "another");
  rig.settle();
  EXPECT_THAT(b.texts(), ElementsAre("small", "another"));
  EXPECT_EQ(rig.dropped(DropReason::too_large), 1u);
}

// The receiving shard is busy with 256 other commands: the session's frames come after its
// AttachCommand all the same.
TEST(IoShard, FramesFromAnotherShardFindASessionWhoseAttachWaits) {
  HubRig rig(2);
  FakeNode& a = rig.join(0);
  for (int i = 0; i < 1'000; ++i) rig.command(1, CloseCommand{{ConnectionSlot{9'999}, 1}, {}, ""});
  auto [transport, peer] = make_memory_pipe();
  AttachCommand command;
  command.session = {ConnectionSlot{40}, 1};
  command.attachment = 1;
  command.node = make_id<NodeId>(rig.hub(), 40);
  command.transport = std::move(transport);
  command.peer_frame_bytes = 65'536;
  rig.command(1, std::move(command));
  rig.nodes().publish(40, {ShardIndex{1}, ConnectionSlot{40}, 1});
  rig.send(a, make_id<NodeId>(rig.hub(), 40).value(), "early");
  rig.settle();
  EXPECT_EQ(rig.dropped(DropReason::no_such_node), 0u);
  EXPECT_EQ(rig.ledger().delivered, 1u);
}

// Small frames that alternate between shards fill the mailbox by entries; those with BLOCK are
// never dropped for it.
TEST(IoShard, ABurstThatFillsTheMailboxLosesNothingSentWithBlock) {
  Limits limits;
  limits.mailbox_entries = 64;
  HubRig rig(2, limits);
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(0);
  FakeNode& c = rig.join(1);
  for (int i = 0; i < 2'000; ++i) {
    rig.send(a, b.id.value(), std::to_string(i));
    rig.send(a, c.id.value(), std::to_string(i));
  }
  rig.settle();
  EXPECT_THAT(b.frames, SizeIs(2'000));
  EXPECT_THAT(c.frames, SizeIs(2'000));
  EXPECT_EQ(rig.ledger().dropped, 0u);
}

TEST(IoShard, ReadsLaterWhileAnotherShardHasTooMuchToDo) {
  Limits limits;
  limits.mailbox_bytes = 256 * 1024;
  HubRig rig(2, limits);
  FakeNode& a = rig.join(0);
  FakeNode& c = rig.join(1);
  for (int i = 0; i < 1'000; ++i) rig.send(a, c.id.value(), std::string(1'000, 'x'), {.flags = 2});
  for (int i = 0; i < 50; ++i) rig.turn_shard(0);
  EXPECT_TRUE(a.pipe.transport_readable()) << "the mailbox is more than half full";
  rig.settle();
  EXPECT_THAT(c.frames, SizeIs(1'000));
  EXPECT_EQ(rig.ledger().dropped, 0u);
}

TEST(IoShard, RunsOnAThreadOfItsOwnUntilItIsStopped) {
  HubRig rig(1);
  rig.command(0, StopCommand{});
  rig.run_threads();
  EXPECT_GE(rig.sum(&ShardCounters::turns), 1u);
}

// Frames that waited for the former id are lost and counted, and the node begins anew.
TEST(IoShard, ARenumberedNodeIsToldAndBeginsAnew) {
  HubRig rig(1);
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(0, {.resume = true});
  const std::uint32_t former = b.id.value();
  b.pipe.close();
  rig.settle();
  rig.rejoin(b, {.resume = true});
  EXPECT_TRUE(b.welcome->resumed);
  b.pipe.set_room(0);
  rig.send(a, former, "waits", {.flags = proto::kFlagReport});
  rig.settle_without_reading();
  rig.renumber(b, 400);
  rig.settle();
  const auto detached = rig.take_detached();
  ASSERT_TRUE(detached);
  EXPECT_EQ(rig.dropped(proto::DropReason::link_lost), 1u);
  ASSERT_EQ(a.reports().size(), 1u);
  rig.send(a, former, "old");
  rig.send(a, b.id.value(), "new");
  rig.settle();
  EXPECT_EQ(rig.dropped(proto::DropReason::renumbered), 1u);
  b.frames.clear();
  rig.rejoin(b, {.resume = true});
  rig.settle();
  EXPECT_FALSE(b.welcome->resumed);
  EXPECT_EQ(b.texts(), (std::vector<std::string>{"new"}));
  EXPECT_TRUE(rig.ledger().exact());
  rig.send(b, a.id.value(), "late", {.src = former});
  rig.settle();
  ASSERT_TRUE(b.goodbye) << "the former id is not its own any more";
  EXPECT_EQ(b.goodbye->code, proto::GoodbyeCode::wrong_source);
}

TEST(IoShard, ARenumberedNodeIsToldSo) {
  HubRig rig(1);
  FakeNode& b = rig.join(0);
  rig.renumber(b, 400);
  rig.settle();
  ASSERT_TRUE(b.goodbye);
  EXPECT_EQ(b.goodbye->code, proto::GoodbyeCode::renumbered);
}

// The conductor publishes the group, then sends the pace: a shard may see the one in the middle of
// a turn, without the other. Nothing is lost when one that gets everything wants a rate, and none
// comes late when it does not any more.
TEST(IoShard, ASubscriberThatChangesItsTermsMissesNothingInBetween) {
  HubRig rig(2);
  FakeNode& provider = rig.join(0);
  FakeNode& viewer = rig.join(1);
  const FrameSpec group{.kind = Kind::group};
  const auto say = [&](const std::string& text) {
    rig.send(provider, HubRig::group(5), text, group);
    rig.settle();
  };
  rig.publish_group(5, provider.id, {&viewer});
  say("plain");
  const auto say_part = [&](std::uint32_t offset, const std::string& part) {
    std::string fragment(proto::kFragmentHeaderSize, '\0');
    proto::store_fragment_header(reinterpret_cast<std::byte*>(fragment.data()), {1, offset, 4});
    rig.send(provider, HubRig::group(5), fragment + part,
             {.kind = Kind::group, .flags = proto::kFlagFragment});
    rig.settle();
  };
  rig.publish_paced_group(5, provider.id, {&viewer}, false, true);
  say("published");
  say_part(0, "ab");
  rig.pace(viewer, 5, {.depth = 3, .interval_us = 1'000'000}, false, true);
  say_part(2, "cd");
  ASSERT_EQ(viewer.frames.size(), 4u) << "a message in the middle of which the pace began";
  viewer.frames.resize(2);
  say("paced");
  for (const char* text : {"held 1", "held 2", "held 3"}) say(text);
  EXPECT_THAT(viewer.texts(), ElementsAre("plain", "published", "paced"));
  rig.now_ms += 1'000;
  rig.pace(viewer, 5, {});
  say("behind them");
  EXPECT_THAT(viewer.texts(), ElementsAre("plain", "published", "paced", "held 1", "held 2",
                                          "held 3", "behind them"));
  EXPECT_EQ(rig.ledger().dropped, 0u);
  // A new subscriber gets nothing before its shard knows how much.
  FakeNode& other = rig.join(1);
  rig.publish_paced_group(5, provider.id, {&viewer, &other});
  say("too soon");
  EXPECT_THAT(other.frames, IsEmpty());
}

// The outbox that held it releases the id that it had, which leads to nobody.
TEST(IoShard, AHeldNodeThatIsRenumberedIsReadAgain) {
  Limits limits;
  limits.lane1_bytes = 64 * 1024;
  limits.reserve_bytes = 32 * 1024;
  HubRig rig(2, limits);
  FakeNode& flooder = rig.join(0, {.resume = true});
  FakeNode& slow = rig.join(1);
  FakeNode& other = rig.join(1);
  slow.pipe.set_room(0);
  flooder.pipe.plan_receives(std::vector<std::size_t>(100'000, 4'096));
  for (int i = 0; i < 300; ++i) rig.send(flooder, slow.id.value(), std::string(1'000, 'x'));
  rig.settle_without_reading();
  ASSERT_EQ(rig.connection(flooder)->holds, 1u);
  rig.renumber(flooder, 400);
  rig.settle_without_reading();
  rig.rejoin(flooder, {.resume = true});
  slow.pipe.set_room(MemoryPeer::kAll);
  rig.settle();
  EXPECT_EQ(rig.connection(flooder)->holds, 0u);
  rig.send(flooder, other.id.value(), "still there");
  rig.settle();
  EXPECT_THAT(other.texts(), ElementsAre("still there"));
}

TEST(IoShard, GoesByNewLimitsFromTheNextTurnOn) {
  HubRig rig(1);
  FakeNode& a = rig.join(0);
  Limits limits;
  limits.requests = 1;
  rig.command(0, LimitsCommand{limits});
  rig.settle();
  for (int i = 0; i < 2; ++i) {
    rig.send(a, 0, std::string(4, '\1'), {.kind = proto::Kind::ctrl});
  }
  rig.settle();
  ASSERT_TRUE(a.goodbye);
  EXPECT_EQ(a.goodbye->code, proto::GoodbyeCode::too_many_requests);
}

}  // namespace
}  // namespace gimnet::hub
