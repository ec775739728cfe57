#include "hub/data/fanout/fanout.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/hub/data/support/route_rig.hpp"

namespace gimnet::hub {
namespace {

using proto::DropReason;
using proto::Kind;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using testing::RouteRig;
using ::testing::SizeIs;

constexpr ShardIndex kThere{1};
constexpr std::uint8_t kDrop = 2;

TEST(Fanout, NeighbouringFramesBecomeOneEntry) {
  RouteRig rig;
  rig.fanout.hand_over(kThere, rig.egress.run({"one"}));
  rig.fanout.hand_over(kThere, rig.egress.run({"two", "three"}, {.lane = 2}));
  EXPECT_THAT(rig.take_mail(), IsEmpty()) << "more may come";
  rig.fanout.post_all();
  EXPECT_THAT(rig.take_mail(), ElementsAre(3u));
  rig.fanout.post_all();
  EXPECT_THAT(rig.take_mail(), IsEmpty());
  EXPECT_EQ(rig.fanout.take_posted(), 0b10u);
  EXPECT_EQ(rig.fanout.take_posted(), 0u);
}

/// The mail of the other shard, entry by entry, as the payloads of its frames.
std::vector<std::vector<std::string>> entries_of(RouteRig& rig) {
  std::vector<std::vector<std::string>> entries;
  rig.mailbox_there.drain(
      1'000, [] {},
      [&](const Mail& mail) {
        std::vector<std::string>& payloads = entries.emplace_back();
        for (std::uint32_t done = 0; done < mail.size;) {
          const proto::FrameHeader header = proto::load_header(mail.bytes + done);
          payloads.emplace_back(
              reinterpret_cast<const char*>(mail.bytes) + done + proto::kHeaderSize, header.length);
          done += static_cast<std::uint32_t>(header.frame_size());
        }
        EXPECT_EQ(payloads.size(), mail.frames);
        BufferPool::end_loan(mail.lent);
      });
  return entries;
}

using Entries = std::vector<std::vector<std::string>>;

TEST(Fanout, SmallFramesThatLieApartBecomeOneEntryInTheirOrder) {
  RouteRig rig;
  for (const char* payload : {"one", "two", "three", "four"}) {
    rig.fanout.hand_over(kThere, rig.egress.run({payload}));
    static_cast<void>(rig.egress.run({"for somebody else"}));
  }
  rig.fanout.hand_over(kThere, rig.egress.run({"five", "six"}));
  rig.fanout.post_all();
  EXPECT_EQ(entries_of(rig), (Entries{{"one", "two", "three", "four", "five", "six"}}));
}

TEST(Fanout, LargeFramesThatLieApartStayWhereTheyAre) {
  RouteRig rig;
  const std::string large(4'096 - proto::kHeaderSize, 'l');
  const std::string small(4'095 - proto::kHeaderSize, 's');
  const auto apart = [&](const std::string& payload) {
    rig.fanout.hand_over(kThere, rig.egress.run({payload}));
    static_cast<void>(rig.egress.run({"for somebody else"}));
  };
  const std::uint64_t copied = rig.egress.tally.copied_bytes;
  for (const std::string& payload : {large, large, small, large}) apart(payload);
  EXPECT_EQ(rig.egress.tally.copied_bytes, copied);
  apart(small);
  rig.fanout.post_all();
  EXPECT_EQ(rig.egress.tally.copied_bytes, copied) << "a large one before it";
  EXPECT_EQ(entries_of(rig), (Entries{{large}, {large}, {small}, {large}, {small}}));
  apart(small);
  apart(small);
  rig.fanout.post_all();
  EXPECT_EQ(rig.egress.tally.copied_bytes, copied + 2 * 4'095u);
  EXPECT_EQ(entries_of(rig), (Entries{{small, small}}));
}

TEST(Fanout, WhatTheOtherShardStillReadsIsNotWrittenOver) {
  RouteRig rig;
  Entries expected;
  // More than one chunk, in many bursts, of which the other shard has read none.
  for (int burst = 0; burst < 40; ++burst) {
    std::vector<std::string>& entry = expected.emplace_back();
    for (int i = 0; i < 3; ++i) {
      entry.push_back(std::to_string(burst) + "." + std::to_string(i) + std::string(300, '.'));
      rig.fanout.hand_over(kThere, rig.egress.run({entry.back()}));
      static_cast<void>(rig.egress.run({"for somebody else"}));
    }
    rig.fanout.post_all();
  }
  std::vector<std::string> all;
  for (const auto& entry : entries_of(rig)) all.insert(all.end(), entry.begin(), entry.end());
  std::vector<std::string> wanted;
  for (const auto& entry : expected) wanted.insert(wanted.end(), entry.begin(), entry.end());
  EXPECT_EQ(all, wanted);
}

TEST(Fanout, AFullMailboxDropsWhatMayBeDropped) {
  Limits limits;
  limits.mailbox_entries = 2;
  RouteRig rig(limits);
  for (int i = 0; i < 3; ++i) {
    rig.fanout.hand_over(kThere, rig.egress.run({"x"}, {.flags = kDrop}));
    rig.fanout.post_all();
  }
  EXPECT_EQ(rig.egress.dropped(DropReason::shard_full), 1u);
  EXPECT_EQ(rig.fanout.crowded(), 0b10u);
  // One stretch: block, drop, drop, block, block.
  rig.fanout.hand_over(kThere, rig.egress.run({"b"}));
  rig.fanout.hand_over(kThere, rig.egress.run({"d", "d"}, {.flags = kDrop}));
  rig.fanout.hand_over(kThere, rig.egress.run({"b", "b"}));
  rig.fanout.post_all();
  EXPECT_EQ(rig.egress.dropped(DropReason::shard_full), 3u);
  EXPECT_THAT(rig.take_mail(), ElementsAre(1u, 1u, 1u, 2u));
  EXPECT_TRUE(rig.ledger_exact());
  rig.fanout.look_for_room();
  EXPECT_EQ(rig.fanout.crowded(), 0u);
}

TEST(Fanout, CopiesAListWithoutItsIds) {
  RouteRig rig;
  proto::FrameHeader header;
  header.kind = proto::Kind::list;
  header.length = 7;
  const hub::Run frame = rig.egress.run({"idididid"
                                         "payload"},
                                        {.kind = proto::Kind::list});
  const hub::Run first = rig.fanout.copy_without_ids(frame, header);
  EXPECT_EQ(first.size, proto::kHeaderSize + 7);
  EXPECT_EQ(std::memcmp(first.bytes + proto::kHeaderSize, "payload", 7), 0);
  const NodeId ids[] = {NodeId{1}, NodeId{2}, NodeId{3}};
  const hub::Run second = rig.fanout.copy_for(ids, frame, header);
  EXPECT_EQ(second.bytes, first.bytes + first.size) << "behind what is still kept";
  EXPECT_EQ(second.header().dst, 3u);
  EXPECT_EQ(second.header().frame_size(), second.size);
  EXPECT_EQ(second.size, list_frame_offset(3) + first.size);
  EXPECT_EQ(proto::ListIds(second.bytes + proto::kHeaderSize, 3)[2], NodeId{3});
  EXPECT_EQ(std::memcmp(second.bytes + list_frame_offset(3), first.bytes, first.size), 0);
}

TEST(Fanout, DropsSinglyWhatIsTooLarge) {
  RouteRig rig;
  Recipient& a = rig.add_here(2);
  a.frame_bytes = 10;
  const hub::Run run = rig.egress.run({std::string(10, 'a'), std::string(11, 'b'), "c"});
  rig.fanout.deliver(a, run, run.header(), {});
  EXPECT_EQ(rig.egress.dropped(DropReason::too_large), 1u);
  EXPECT_EQ(rig.egress.tally.queued, 2);
  EXPECT_TRUE(rig.ledger_exact());
}

// Neighbours that fit become one entry, and neighbours that do not fit are one drop.
TEST(Fanout, KeepsTheOrderOfWhatIsNotTooLarge) {
  RouteRig rig;
  Recipient& a = rig.add_here(2);
  a.frame_bytes = 2;
  const hub::Run run =
      rig.egress.run({"lll", "a", "b", "lll", "lll", "cc", "lll"}, {.flags = kDrop});
  rig.fanout.deliver(a, run, run.header(), {});
  EXPECT_EQ(rig.egress.dropped(DropReason::too_large), 4u);
  ASSERT_EQ(a.outbox.lane(1).front().frames, 3u);
  EXPECT_EQ(std::memcmp(a.outbox.lane(1).front().run.bytes + 2 * 17 + proto::kHeaderSize, "cc", 2),
            0);
  EXPECT_TRUE(rig.ledger_exact());
}

struct CountedLosses final : CountedGroups {
  [[nodiscard]] bool counts(GroupId) const override { return false; }
  void on_lost(GroupId, std::uint32_t messages) override {
    ++calls;
    lost += messages;
  }
  std::uint64_t calls = 0;
  std::uint64_t lost = 0;
};

// One publisher of small messages would hold up a shard for as long as it likes by subscribers that
// read nothing.
TEST(Fanout, ARunToFullQueuesIsNotTakenApart) {
  constexpr std::uint32_t kMembers = 50;
  constexpr std::uint32_t kFrames = 1'000;
  constexpr std::uint32_t kRuns = 10;
  Limits limits;
  limits.lane1_bytes = 2'500 * 20 + 19;  // two runs and a half
  CountedLosses losses;                  // told until the rig ends
  RouteRig rig(limits);
  std::vector<std::uint32_t> members;
  for (std::uint32_t index = 2; index < 2 + kMembers; ++index) {
    Recipient& member = rig.add_here(index);
    member.outbox.set_counted_groups(&losses);
    member.outbox.settle(rig.egress.context);  // as after a write that did not take all
    members.push_back(index);
  }
  rig.publish_group(1, 1, members, {});
  for (std::uint32_t i = 0; i < kRuns; ++i) {
    rig.route(make_id<GroupId>(HubId{7}, 1).value(), std::vector<std::string>(kFrames, "four"),
              {.kind = Kind::group, .flags = proto::kFlagReport});
    // A read buffer goes on behind the frames; here none joins its neighbour.
    static_cast<void>(rig.egress.run({"between"}));
    --rig.egress.accepted;
  }
  constexpr std::uint64_t kLostRuns = std::uint64_t{kMembers} * (kRuns - 2);
  EXPECT_EQ(rig.egress.dropped(DropReason::queue_full), kLostRuns * kFrames);
  EXPECT_EQ(losses.lost, kLostRuns * kFrames);
  EXPECT_EQ(losses.calls, kLostRuns);
  EXPECT_TRUE(rig.ledger_exact());
}

TEST(RecipientTable, FindsASessionByItsGenerationOnly) {
  RouteRig rig;
  Recipient& a = rig.add_here(2);
  EXPECT_EQ(rig.recipients.find(ConnectionSlot{2}, 2), &a);
  EXPECT_EQ(rig.recipients.find(ConnectionSlot{2}, 3), nullptr);
  EXPECT_EQ(rig.recipients.find(ConnectionSlot{99}, 2), nullptr);
  rig.recipients.mark_dirty(a);
  rig.recipients.mark_dirty(a);
  EXPECT_THAT(rig.recipients.dirty(), SizeIs(1));
  rig.recipients.remove(a);
  EXPECT_THAT(rig.recipients.dirty(), IsEmpty());
  EXPECT_EQ(rig.recipients.find(ConnectionSlot{2}, 2), nullptr);
}

}  // namespace
}  // namespace gimnet::hub
