#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <span>

#include "tests/hub/shard/support/hub_rig.hpp"

// No peer keeps a shard's turn to itself: of frames to many each turn hands on a share, and the
// rest goes on behind the others in the next.

namespace gimnet::hub {
namespace {

using proto::DropReason;
using proto::Kind;
using ::testing::ElementsAre;
using testing::FakeNode;
using testing::FrameSpec;
using testing::HubRig;
using ::testing::SizeIs;

constexpr std::uint32_t kEverybody = 7u << 20 | kEveryIndex;

Limits with_share(std::uint64_t deliveries) {
  Limits limits;
  limits.turn_deliveries = deliveries;
  return limits;
}

/// One sender and others on the same shard, all of whom a frame of kind BROADCAST is for.
struct Crowd {
  Crowd(HubRig& rig, std::size_t nodes) : hub(rig) {
    for (std::size_t i = 0; i < nodes; ++i) all.push_back(&rig.join(0));
    rig.settle();
  }
  /// Frames that form no runs, since their headers differ in turns.
  void broadcast(FakeNode& from, int frames, const std::string& prefix = "") {
    for (int i = 0; i < frames; ++i) {
      const std::uint8_t flags = i % 2 == 0 ? 0 : proto::kFlagReport;
      sent.push_back(prefix + std::to_string(i));
      hub.send(from, kEverybody, sent.back(), {.kind = Kind::broadcast, .flags = flags});
    }
  }
  /// Frames that were taken in by one turn.
  std::uint64_t turn() {
    const std::uint64_t before = hub.ledger().accepted;
    hub.turn_shard(0);
    return hub.ledger().accepted - before;
  }
  HubRig& hub;
  std::vector<FakeNode*> all;
  std::vector<std::string> sent;
};

TEST(TurnShare, WhatIsBeyondItWaitsForTheNextTurn) {
  HubRig rig(1, with_share(12));
  Crowd crowd(rig, 6);
  crowd.broadcast(*crowd.all[0], 7);
  for (const std::uint64_t frames : {2u, 2u, 2u, 1u, 0u}) EXPECT_EQ(crowd.turn(), frames);
  rig.settle();
  for (std::size_t i = 1; i < 6; ++i) EXPECT_EQ(crowd.all[i]->texts(), crowd.sent) << "in order";
}

TEST(TurnShare, OneBeyondItIsTheLastOfTheTurn) {
  HubRig rig(1, with_share(13));
  Crowd crowd(rig, 6);
  crowd.broadcast(*crowd.all[0], 7);
  for (const std::uint64_t frames : {3u, 3u, 1u, 0u}) EXPECT_EQ(crowd.turn(), frames);
}

TEST(TurnShare, OneFrameIsHandedOnHoweverManyItIsFor) {
  HubRig rig(1, with_share(1));
  Crowd crowd(rig, 6);
  crowd.broadcast(*crowd.all[0], 3);
  for (const std::uint64_t frames : {1u, 1u, 1u, 0u}) EXPECT_EQ(crowd.turn(), frames);
  EXPECT_EQ(rig.ledger().delivered, 15u);
}

TEST(TurnShare, NeighbouringFramesWithOneHeaderAreOne) {
  HubRig rig(1, with_share(1));
  Crowd crowd(rig, 6);
  for (int i = 0; i < 50; ++i)
    rig.send(*crowd.all[0], kEverybody, "like the others", {.kind = Kind::broadcast});
  EXPECT_EQ(crowd.turn(), 50u);
}

TEST(TurnShare, FramesToOneHaveNone) {
  HubRig rig(1, with_share(1));
  Crowd crowd(rig, 6);
  for (std::size_t i = 0; i < 50; ++i)
    rig.send(*crowd.all[0], crowd.all[1 + i % 5]->id.value(), "x");
  EXPECT_EQ(crowd.turn(), 50u);
}

TEST(TurnShare, OthersGoFirst) {
  HubRig rig(1, with_share(1));
  Crowd crowd(rig, 3);
  crowd.broadcast(*crowd.all[0], 3);
  EXPECT_EQ(crowd.turn(), 1u);
  rig.send(*crowd.all[1], crowd.all[2]->id.value(), "between");
  EXPECT_EQ(crowd.turn(), 2u);
  rig.settle();
  EXPECT_THAT(crowd.all[2]->texts(), ElementsAre("0", "between", "1", "2"));
}

TEST(TurnShare, ThoseWithARestHaveOneTogether) {
  HubRig rig(1, with_share(12));
  Crowd crowd(rig, 6);
  crowd.broadcast(*crowd.all[0], 10);
  crowd.broadcast(*crowd.all[1], 10);
  for (const std::uint64_t frames : {3u, 2u, 2u}) EXPECT_EQ(crowd.turn(), frames);
  rig.settle();
  EXPECT_EQ(rig.ledger().accepted, 20u);
}

TEST(TurnShare, GroupsAndListsHaveIt) {
  HubRig rig(1, with_share(5));
  Crowd crowd(rig, 6);
  FakeNode& a = *crowd.all[0];
  rig.publish_group(5, a.id,
                    {crowd.all[1], crowd.all[2], crowd.all[3], crowd.all[4], crowd.all[5]});
  std::string ids;
  for (std::size_t i = 1; i < 6; ++i) {
    const std::uint32_t id = crowd.all[i]->id.value();
    ids.append(reinterpret_cast<const char*>(&id), sizeof id);
  }
  for (int i = 0; i < 2; ++i) {
    rig.send(a, HubRig::group(5), "g", {.kind = Kind::group});
    rig.send(a, 5, ids + "l", {.kind = Kind::list});
  }
  for (const std::uint64_t frames : {1u, 1u, 1u, 1u, 0u}) EXPECT_EQ(crowd.turn(), frames);
  rig.settle();
  for (std::size_t i = 1; i < 6; ++i)
    EXPECT_THAT(crowd.all[i]->texts(), ElementsAre("g", "l", "g", "l"));
}

TEST(TurnShare, NothingIsReadBeforeTheRestIsRouted) {
  HubRig rig(1, with_share(1));
  Crowd crowd(rig, 3);
  FakeNode& a = *crowd.all[0];
  crowd.broadcast(a, 3);
  EXPECT_EQ(crowd.turn(), 1u);
  crowd.broadcast(a, 3, "later ");
  EXPECT_EQ(crowd.turn(), 1u);
  EXPECT_TRUE(a.pipe.transport_readable());
  rig.settle();
  EXPECT_EQ(crowd.all[1]->texts(), crowd.sent);
}

TEST(TurnShare, ANodeWithARestIsNotSilent) {
  HubRig rig(1, with_share(1));
  Crowd crowd(rig, 3);
  crowd.broadcast(*crowd.all[0], 60);
  rig.turn();
  for (std::size_t i = 0; i < 50; ++i) {
    for (FakeNode* node : {crowd.all[1], crowd.all[2]}) rig.send_flow(*node, proto::flow::Pong{});
    rig.pass_ms(100, false);
  }
  EXPECT_FALSE(crowd.all[0]->pipe.transport_gone());
  rig.pass_ms(4'200, false);
  EXPECT_TRUE(crowd.all[0]->pipe.transport_gone()) << "after it, as ever";
  EXPECT_EQ(rig.ledger().accepted, 60u);
}

TEST(TurnShare, WhatWasReadBeforeThePeerClosedIsDelivered) {
  HubRig rig(1, with_share(1));
  Crowd crowd(rig, 3);
  crowd.broadcast(*crowd.all[0], 20);
  crowd.all[0]->pipe.close();
  rig.settle();
  for (std::size_t i = 1; i < 3; ++i) EXPECT_EQ(crowd.all[i]->texts(), crowd.sent);
  EXPECT_TRUE(rig.take_detached());
}

TEST(TurnShare, WhoIsHeldKeepsItsRest) {
  HubRig rig(1, with_share(1));
  Crowd crowd(rig, 3);
  crowd.broadcast(*crowd.all[0], 5);
  EXPECT_EQ(crowd.turn(), 1u);
  rig.state(0).signals.apply_hold(crowd.all[0]->id, true);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(crowd.turn(), 0u);
  rig.state(0).signals.apply_hold(crowd.all[0]->id, false);
  EXPECT_EQ(crowd.turn(), 1u);
  rig.settle();
  EXPECT_EQ(crowd.all[1]->texts(), crowd.sent);
}

TEST(TurnShare, ARestThatIsNotRoutedAnyMoreIsCounted) {
  HubRig rig(1, with_share(1));
  Crowd crowd(rig, 3);
  crowd.broadcast(*crowd.all[0], 5);
  EXPECT_EQ(crowd.turn(), 1u);
  rig.command(0, CloseCommand{crowd.all[0]->session, proto::GoodbyeCode::kicked, "go"});
  EXPECT_EQ(crowd.turn(), 4u);
  EXPECT_EQ(rig.dropped(DropReason::link_lost), 4u);
  EXPECT_EQ(crowd.turn(), 0u);
  EXPECT_EQ(rig.state(0).receive_buffer.rests(), 0u);
}

TEST(TurnShare, ARestOfANodeWithResumeStaysItsSenders) {
  HubRig rig(1, with_share(1));
  FakeNode& a = rig.join(0, {.resume = true});
  Crowd crowd(rig, 2);
  crowd.broadcast(a, 5);
  EXPECT_EQ(crowd.turn(), 1u);
  rig.rejoin(a, {.resume = true});
  EXPECT_EQ(crowd.turn(), 0u);
  EXPECT_EQ(rig.sum(&ShardCounters::untaken_frames), 4u);
  EXPECT_EQ(rig.ledger().dropped, 0u);
  a.read();
  ASSERT_TRUE(a.welcome);
  EXPECT_TRUE(a.welcome->resumed);
  EXPECT_EQ(a.welcome->taken, 1u) << "it sends the others again";
}

TEST(TurnShare, ARestIsNotTakenWhenTheHubEnds) {
  HubRig rig(1, with_share(1));
  Crowd crowd(rig, 3);
  crowd.broadcast(*crowd.all[0], 5);
  EXPECT_EQ(crowd.turn(), 1u);
  rig.command(0, DrainCommand{10'000});
  rig.settle();
  EXPECT_EQ(rig.ledger().accepted, 1u);
  EXPECT_EQ(rig.sum(&ShardCounters::untaken_frames), 4u);
  for (const FakeNode* node : crowd.all) EXPECT_TRUE(node->goodbye);
}

TEST(TurnShare, AFaultInTheRestIsSeenInItsTurn) {
  HubRig rig(1, with_share(1));
  Crowd crowd(rig, 3);
  FakeNode& a = *crowd.all[0];
  crowd.broadcast(a, 3);
  rig.send(a, crowd.all[1]->id.value(), "not its own", {.src = 99});
  crowd.broadcast(a, 3, "behind it");
  rig.settle();
  EXPECT_THAT(crowd.all[1]->texts(), SizeIs(3));
  ASSERT_TRUE(a.goodbye);
  EXPECT_EQ(a.goodbye->code, proto::GoodbyeCode::wrong_source);
}

TEST(TurnShare, WhileManyRestsAreKeptLittleIsRead) {
  HubRig rig(1, with_share(1));
  Crowd crowd(rig, 56);
  std::vector<std::byte> flood;
  for (std::size_t i = 0; i < 20'000; ++i) {
    const std::uint8_t flags = i % 2 == 0 ? 0 : proto::kFlagReport;
    const auto frame = HubRig::frame(*crowd.all[0], kEverybody, "",
                                     {.kind = Kind::broadcast, .flags = flags, .src = 0});
    flood.insert(flood.end(), frame.begin(), frame.end());
  }
  for (FakeNode* node : crowd.all) {
    for (std::size_t at = 0; at < flood.size(); at += proto::kHeaderSize) {
      store_le(flood.data() + at + 8, node->id.value());
    }
    rig.write(*node, flood);
  }
  std::vector<std::uint64_t> before;
  for (const FakeNode* node : crowd.all) before.push_back(rig.counts(*node).received_bytes);
  rig.turn();
  std::size_t in_full = 0;
  for (std::size_t i = 0; i < crowd.all.size(); ++i) {
    const std::uint64_t bytes = rig.counts(*crowd.all[i]).received_bytes - before[i];
    if (bytes == kSlabReadBytes) ++in_full;
    if (in_full <= i) {
      EXPECT_EQ(bytes, 4'096u) << i;
    }
  }
  EXPECT_EQ(in_full, 52u) << "16 MiB of slabs, and not one more";
  rig.turn();
  EXPECT_EQ(rig.state(0).receive_buffer.rests(), 56u);
}

// The slab of a rest may hold the beginning of a large frame, and others read meanwhile.
TEST(TurnShare, AnyStreamArrivesWhole) {
  for (std::uint32_t seed = 0; seed < 30; ++seed) {
    std::mt19937 random(seed);
    const auto below = [&](std::uint32_t end) {
      return static_cast<std::uint32_t>(random() % end);
    };
    HubRig rig(2, with_share(1 + below(20)));
    FakeNode& watcher = rig.join(below(2));
    std::vector<FakeNode*> senders;
    for (std::size_t i = 0; i < 4; ++i) senders.push_back(&rig.join(i % 2));
    std::vector<std::vector<std::byte>> streams(senders.size());
    std::vector<std::size_t> done(senders.size());
    std::map<std::uint32_t, std::vector<std::string>> sent;
    for (std::size_t i = 0; i < senders.size(); ++i) {
      rig.publish_group(static_cast<std::uint32_t>(10 + i), senders[i]->id,
                        {&watcher, senders[(i + 1) % 4]});
      for (int frame = 0; frame < 120; ++frame) {
        std::string text = std::to_string(frame) + " ";
        text.resize(text.size() + (below(8) == 0 ? below(60'000) : below(300)),
                    static_cast<char>('a' + below(26)));
        sent[senders[i]->id.value()].push_back(text);
        const std::uint8_t flags = below(2) == 0 ? 0 : proto::kFlagReport;
        const auto bytes =
            HubRig::frame(*senders[i], HubRig::group(static_cast<std::uint32_t>(10 + i)), text,
                          {.kind = Kind::group, .flags = flags});
        streams[i].insert(streams[i].end(), bytes.begin(), bytes.end());
      }
    }
    for (bool more = true; more;) {
      more = false;
      for (std::size_t i = 0; i < senders.size(); ++i) {
        const std::size_t size = std::min<std::size_t>(below(90'000), streams[i].size() - done[i]);
        rig.write(*senders[i], std::span(streams[i]).subspan(done[i], size));
        done[i] += size;
        more = more || done[i] != streams[i].size();
      }
      rig.turn();
      watcher.read();
      for (FakeNode* node : senders) node->read();
    }
    rig.settle();
    std::map<std::uint32_t, std::vector<std::string>> got;
    for (const auto& frame : watcher.frames) got[frame.header.src].push_back(frame.text());
    EXPECT_EQ(got, sent) << "seed " << seed;
  }
}

TEST(TurnShare, WhatAnotherShardHandedOverHasOne) {
  HubRig rig(2, with_share(10));
  FakeNode& a = rig.join(0);
  std::vector<FakeNode*> members;
  for (int i = 0; i < 5; ++i) members.push_back(&rig.join(1));
  rig.publish_group(5, a.id, members);
  rig.settle();
  std::vector<std::string> sent;
  for (int i = 0; i < 7; ++i) {
    sent.push_back(std::to_string(i));
    const std::uint8_t flags = i % 2 == 0 ? 0 : proto::kFlagReport;
    rig.send(a, HubRig::group(5), sent.back(), {.kind = Kind::group, .flags = flags});
  }
  const auto queued = [&] {
    rig.turn_shard(1);
    return rig.state(1).shared.mailboxes[1]->empty() && !rig.shard(1).has_rest();
  };
  for (const std::uint64_t frames : {2u, 4u, 6u, 7u}) {
    rig.turn_shard(0);
    EXPECT_EQ(rig.ledger().accepted, frames) << "recipients on another shard count";
  }
  EXPECT_FALSE(queued());
  members[0]->read();
  EXPECT_THAT(members[0]->frames, SizeIs(2)) << "one share for one turn";
  for (int i = 0; i < 2; ++i) EXPECT_FALSE(queued());
  EXPECT_TRUE(queued());
  rig.settle();
  for (const FakeNode* member : members) EXPECT_EQ(member->texts(), sent);
}

TEST(TurnShare, WhoSendsMoreToAnotherShardThanItHandsOnIsReadLater) {
  HubRig rig(2, with_share(10));
  FakeNode& a = rig.join(0);
  std::vector<FakeNode*> members;
  for (int i = 0; i < 5; ++i) members.push_back(&rig.join(1));
  rig.publish_group(5, a.id, members);
  rig.settle();
  for (int i = 0; i < 30; ++i) {
    const std::uint8_t flags = i % 2 == 0 ? 0 : proto::kFlagReport;
    rig.send(a, HubRig::group(5), "x", {.kind = Kind::group, .flags = flags});
  }
  for (int i = 0; i < 10; ++i) rig.turn_shard(0);
  EXPECT_EQ(rig.ledger().accepted, 10u) << "half of eight shares, and what passes it";
  EXPECT_TRUE(rig.connection(a)->gate.has(ReadGate::no_room));
  rig.settle();
  for (const FakeNode* member : members) EXPECT_THAT(member->frames, SizeIs(30));
}

}  // namespace
}  // namespace gimnet::hub
