#include "hub/data/egress/lane_queue.hpp"

#include <gtest/gtest.h>

#include "proto/frame/frame_parser.hpp"
#include "tests/hub/data/support/egress_rig.hpp"

namespace gimnet::hub {
namespace {

using testing::EgressRig;
using testing::TestFrame;

class LaneQueueTest : public ::testing::Test {
 protected:
  Entry entry(const std::string& payload, const TestFrame& frame = {}) {
    Entry made;
    made.run = rig.run({payload}, frame);
    made.size = made.run.size;
    made.frames = 1;
    made.block = frame.flags == 1;
    made.latest = (frame.flags & 3) == 3;
    made.source = SourceBytes::place_of(NodeId{7u << 20 | frame.src});
    if (made.block) made.source += SourceBytes::kFixed;
    return made;
  }
  /// The payload of the entry that goes for room.
  std::string drop() {
    Entry dropped;
    if (!lane.drop_oldest(dropped)) return "none";
    return {reinterpret_cast<const char*>(dropped.run.bytes + proto::kHeaderSize),
            dropped.run.size - proto::kHeaderSize};
  }
  std::vector<std::string> waiting() {
    std::vector<std::string> payloads;
    const RingQueue<Entry>& entries = lane.entries();
    for (std::uint64_t number = entries.first_number(); number != entries.end_number(); ++number) {
      const Entry& each = lane.entries().at(number);
      if (each.frames == 0) continue;
      payloads.emplace_back(reinterpret_cast<const char*>(each.run.bytes + proto::kHeaderSize),
                            each.run.size - proto::kHeaderSize);
    }
    return payloads;
  }
  EgressRig rig;
  LaneQueue lane;
};

TEST_F(LaneQueueTest, JoinsNeighboursWithOneHeader) {
  lane.push(entry("one"));
  lane.push(entry("two"));
  EXPECT_EQ(lane.entries().size(), 1u);
  EXPECT_EQ(lane.front().frames, 2u);
  lane.push(entry("other source", {.src = 2}));
  EXPECT_EQ(lane.entries().size(), 2u);
  lane.push(entry("back again"));
  EXPECT_EQ(lane.entries().size(), 3u);
  EXPECT_EQ(lane.bytes(), 3u + 3u + 12u + 10u + 4 * proto::kHeaderSize);
}

TEST_F(LaneQueueTest, CountsBlockAndLatestBytes) {
  lane.push(entry("block", {.flags = 1}));
  lane.push(entry("key_____", {.flags = 3 | proto::kFlagKeyed}));
  EXPECT_EQ(lane.block_bytes(), proto::kHeaderSize + 5);
  EXPECT_EQ(lane.latest_bytes(), proto::kHeaderSize + 8);
}

TEST_F(LaneQueueTest, DropsAWaitingEntryAtATime) {
  lane.push(entry("one"));
  lane.push(entry("two"));
  lane.push(entry("block", {.flags = 1}));
  lane.push(entry("three"));
  Entry dropped;
  for (const std::uint32_t frames : {2u, 1u}) {
    ASSERT_TRUE(lane.drop_oldest(dropped));
    EXPECT_EQ(dropped.frames, frames);
    EXPECT_EQ(dropped.size, frames * proto::kHeaderSize + (frames == 2 ? 6 : 5));
  }
  EXPECT_FALSE(lane.drop_oldest(dropped)) << "only BLOCK is left";
  EXPECT_EQ(lane.bytes(), proto::kHeaderSize + 5);
  EXPECT_EQ(lane.front().block, true);
}

TEST_F(LaneQueueTest, AnEntryIsNoLongerThanARun) {
  const std::string half(proto::kRunBytesMax / 2 - proto::kHeaderSize, 'h');
  lane.push(entry(half));
  lane.push(entry(half));
  EXPECT_EQ(lane.entries().size(), 1u);
  lane.push(entry(""));
  EXPECT_EQ(lane.entries().size(), 2u);
}

TEST_F(LaneQueueTest, TheOldestOfTheSourceWithTheMostGoes) {
  lane.push(entry("quiet 1", {.src = 1}));
  lane.push(entry("block", {.flags = 1, .src = 2}));
  lane.push(entry("flood 1", {.src = 2}));
  lane.push(entry("quiet 2", {.src = 1}));
  lane.push(entry("flood 2, longer", {.src = 2}));
  EXPECT_EQ(drop(), "flood 1");
  EXPECT_EQ(drop(), "quiet 1");
  EXPECT_EQ(waiting(), (std::vector<std::string>{"block", "quiet 2", "flood 2, longer"}));
  EXPECT_EQ(drop(), "flood 2, longer");
  EXPECT_EQ(drop(), "quiet 2");
  EXPECT_EQ(drop(), "none");
  EXPECT_EQ(lane.source_at(lane.sources().fullest()), (NodeId{7u << 20 | 2}));
}

TEST_F(LaneQueueTest, ItIsLookedForAmongTheFirst64Entries) {
  for (const int before : {63, 64}) {
    lane = LaneQueue{};
    for (int i = 0; i < before; ++i)
      lane.push(entry("quiet", {.src = static_cast<std::uint32_t>(i % 2 == 0 ? 1 : 3)}));
    lane.push(entry(std::string(10'000, 'f'), {.src = 2}));
    EXPECT_EQ(drop() == "quiet", before == 64) << before;
  }
}

// Its first entry waits for long, and a flood passes: no entry is kept of what was dropped.
TEST_F(LaneQueueTest, AFloodLeavesNoEntriesBehind) {
  const std::string flood(100, 'f');
  lane.push(entry("quiet", {.src = 1}));
  lane.push(entry(flood, {.src = 2}));
  for (int i = 0; i < 1'000; ++i) {
    lane.push(entry("key_____", {.flags = proto::kFlagKeyed, .src = 2}));  // not of one run
    lane.push(entry(flood, {.src = 2}));
    for (int drops = 0; drops < 2; ++drops) static_cast<void>(drop());
    // Empty ones are left in front at most, and go when the first one leaves.
    ASSERT_LE(lane.entries().capacity_bytes(), 64 * sizeof(Entry));
  }
  EXPECT_EQ(waiting().front(), "quiet");
}

// Entries get other numbers when one behind them goes.
TEST_F(LaneQueueTest, FindsWhatMovedUp) {
  const TestFrame latest{.flags = 3 | proto::kFlagKeyed, .src = 1};
  Entry older;
  Entry first = entry("key____1old", latest);
  EXPECT_FALSE(lane.replace_latest(first, older));
  lane.push(std::move(first));
  Entry part = entry("part", {.src = 3});
  part.fragmented = true;
  part.complete = false;
  part.message_number = 77;
  lane.push(std::move(part));
  for (int i = 0; i < 100; ++i)
    lane.push(entry("other", {.src = static_cast<std::uint32_t>(4 + i % 2)}));
  ASSERT_NE(lane.find_message(NodeId{7u << 20 | 3}, 77), nullptr) << "is indexed from here on";
  while (lane.entries().size() > 4) ASSERT_EQ(drop(), "other");
  Entry* found = lane.find_message(NodeId{7u << 20 | 3}, 77);
  ASSERT_NE(found, nullptr);
  EXPECT_EQ(found->message_number, 77u);
  Entry second = entry("key____1new", latest);
  ASSERT_TRUE(lane.replace_latest(second, older));
  EXPECT_EQ(waiting(), (std::vector<std::string>{"key____1new", "part", "other", "other"}));
}

TEST_F(LaneQueueTest, NothingIsReplacedInThePlaceOfALatestThatWasDropped) {
  const auto latest = [](std::uint32_t src) {
    return TestFrame{.flags = 3 | proto::kFlagKeyed, .src = src};
  };
  Entry older;
  for (const std::uint32_t src : {1u, 2u}) {
    Entry each = entry("key____1" + std::string(10 * src, 'x'), latest(src));
    EXPECT_FALSE(lane.replace_latest(each, older));
    lane.push(std::move(each));
  }
  EXPECT_EQ(drop().size(), 28u) << "that of source 2, in whose place stands now that of source 1";
  Entry next = entry("key____1next", latest(2));
  EXPECT_FALSE(lane.replace_latest(next, older));
  EXPECT_EQ(waiting().size(), 1u);
}

TEST_F(LaneQueueTest, FindsAMessageThatWaitsForMore) {
  Entry part = entry("part", {.src = 3});
  part.fragmented = true;
  part.complete = false;
  part.message_number = 77;
  lane.push(std::move(part));
  lane.push(entry("behind it"));
  EXPECT_EQ(lane.find_message(NodeId{7u << 20 | 4}, 77), nullptr);
  EXPECT_EQ(lane.find_message(NodeId{7u << 20 | 3}, 78), nullptr);
  Entry* found = lane.find_message(NodeId{7u << 20 | 3}, 77);
  ASSERT_NE(found, nullptr);
  lane.append_fragment(*found, rig.run({"the end"}, {.src = 3}), true, rig.pieces);
  EXPECT_EQ(found->frames, 2u);
  EXPECT_EQ(lane.find_message(NodeId{7u << 20 | 3}, 77), nullptr) << "complete";
  EXPECT_EQ(lane.bytes(), 4u + 9u + 7u + 3 * proto::kHeaderSize);
}

// Among few entries it is searched for, among many looked up: the same is found.
TEST_F(LaneQueueTest, FindsMessagesHoweverManyAreInterleaved) {
  for (const std::uint32_t messages : {10u, 64u, 65u, 1'000u}) {
    SCOPED_TRACE(messages);
    const auto part = [&](std::uint32_t number, bool complete) {
      Entry one = entry("part", {.src = 1 + number % 2});
      one.fragmented = true;
      one.complete = complete;
      one.message_number = number;
      return one;
    };
    const auto find = [&](std::uint32_t number) {
      return lane.find_message(NodeId{7u << 20 | (1 + number % 2)}, number);
    };
    for (std::uint32_t number = 0; number < messages; ++number) {
      lane.push(part(number, false));
      ASSERT_NE(find(number / 2), nullptr) << number;
    }
    EXPECT_EQ(lane.find_message(NodeId{7u << 20 | 2}, 0), nullptr) << "of another sender";
    for (std::uint32_t number = 0; number < messages; ++number) {
      Entry* found = find(number);
      ASSERT_NE(found, nullptr) << number;
      EXPECT_EQ(found->message_number, number);
      lane.append_fragment(*found, rig.run({"the end"}, {.src = 1 + number % 2}), true, rig.pieces);
      EXPECT_EQ(find(number), nullptr) << "complete";
    }
    EXPECT_EQ(lane.capacity_bytes() > lane.entries().capacity_bytes(), messages > 64)
        << "an index is counted";
    // A number that is used again is the newer message's.
    lane.push(part(5, false));
    ASSERT_NE(find(5), nullptr);
    EXPECT_EQ(find(5), &lane.entries().back());
    while (!lane.empty()) {
      Entry& front = lane.front();
      lane.on_left(front, front.size);
      front = Entry{};
      lane.pop_front();
    }
    EXPECT_EQ(find(5), nullptr) << "it left";
  }
}

TEST_F(LaneQueueTest, ReplacesTheLatestOfAStream) {
  const TestFrame latest{.flags = 3 | proto::kFlagKeyed};
  Entry older;
  Entry first = entry("key____1first", latest);
  EXPECT_FALSE(lane.replace_latest(first, older));
  lane.push(std::move(first));
  lane.push(entry("key____2", latest));
  Entry second = entry("key____1second!", latest);
  ASSERT_TRUE(lane.replace_latest(second, older));
  EXPECT_EQ(older.size, proto::kHeaderSize + 13);
  EXPECT_EQ(lane.front().size, proto::kHeaderSize + 15);
  EXPECT_EQ(lane.bytes(), lane.latest_bytes());
  lane.pop_front();
  Entry third = entry("key____1", latest);
  EXPECT_FALSE(lane.replace_latest(third, older)) << "it left";
}

TEST_F(LaneQueueTest, ReplacesAllThatCameBefore) {
  const TestFrame latest{.flags = 3 | proto::kFlagKeyed};
  constexpr std::size_t kStreams = 100;
  for (std::size_t i = 0; i < 10 * kStreams; ++i) {
    lane.push(entry("stream" + std::to_string(10 + i % kStreams).substr(0, 2) + std::to_string(i),
                    latest));
    lane.push(entry("plain", {.src = static_cast<std::uint32_t>(2 + i % 2)}));
  }
  Entry part = entry("part", {.src = 9});
  part.fragmented = true;
  part.complete = false;
  part.message_number = 77;
  lane.push(std::move(part));
  ASSERT_NE(lane.find_message(NodeId{7u << 20 | 9}, 77), nullptr);
  const std::size_t before = lane.entries().size();
  std::size_t lost = 0;
  lane.replace_all_latest([&](Entry& older) {
    EXPECT_TRUE(older.latest);
    ++lost;
  });
  EXPECT_EQ(lost, before - lane.entries().size());
  EXPECT_EQ(lane.find_message(NodeId{7u << 20 | 9}, 77), &lane.entries().back());
  std::uint64_t bytes = 0;
  std::uint64_t latest_bytes = 0;
  for (std::uint64_t number = lane.entries().first_number(); number != lane.entries().end_number();
       ++number) {
    const Entry& each = lane.entries().at(number);
    bytes += each.size;
    if (!each.latest) continue;
    latest_bytes += each.size;
    const std::string text(reinterpret_cast<const char*>(each.run.bytes + proto::kHeaderSize + 8),
                           each.run.size - proto::kHeaderSize - 8);
    EXPECT_GE(std::stoul(text), 9 * kStreams) << "the newest stay";
  }
  EXPECT_EQ(lane.bytes(), bytes);
  EXPECT_EQ(lane.latest_bytes(), latest_bytes);
  EXPECT_EQ(lane.block_bytes(), 0u);
  Entry next = entry("stream50next", latest);
  Entry older;
  EXPECT_TRUE(lane.replace_latest(next, older)) << "and are found";
}

// A lane that never runs empty, and a sender with an ever new key: what left is not remembered.
TEST_F(LaneQueueTest, ForgetsStreamsThatLeft) {
  const TestFrame latest{.flags = 3 | proto::kFlagKeyed};
  Entry older;
  for (int i = 0; i < 10'000; ++i) {
    std::string key(8, '\0');
    std::memcpy(key.data(), &i, sizeof i);
    Entry next = entry(key, latest);
    EXPECT_FALSE(lane.replace_latest(next, older));
    lane.push(std::move(next));
    if (i > 0) lane.pop_front();
    ASSERT_LE(lane.streams(), 200u);
  }
  // The one that waits is still found.
  std::string key(8, '\0');
  const int last = 9'999;
  std::memcpy(key.data(), &last, sizeof last);
  Entry next = entry(key, latest);
  EXPECT_TRUE(lane.replace_latest(next, older));
}

// The index stays for the next burst and knows nothing of the last one.
TEST_F(LaneQueueTest, RemembersNoStreamOfAnEarlierBurst) {
  const TestFrame latest{.flags = 3 | proto::kFlagKeyed};
  Entry older;
  for (int burst = 0; burst < 3; ++burst) {
    Entry first = entry("key____1", latest);
    EXPECT_FALSE(lane.replace_latest(first, older)) << "burst " << burst;
    lane.push(std::move(first));
    EXPECT_EQ(lane.streams(), 1u);
    Entry second = entry("key____1", latest);
    EXPECT_TRUE(lane.replace_latest(second, older));
    lane.pop_front();
    EXPECT_EQ(lane.streams(), 0u);
  }
  lane.trim();
  Entry again = entry("key____1", latest);
  EXPECT_FALSE(lane.replace_latest(again, older));
}

// A message that was looked up in an empty lane and then refused leaves indexes behind.
TEST_F(LaneQueueTest, CanBeTrimmedBetweenALookUpAndTheNextMessage) {
  const TestFrame latest{.flags = 3 | proto::kFlagKeyed};
  Entry older;
  Entry refused = entry("key____1", latest);
  EXPECT_FALSE(lane.replace_latest(refused, older));
  lane.trim();
  Entry next = entry("key____1", latest);
  EXPECT_FALSE(lane.replace_latest(next, older));
  lane.push(std::move(next));
  Entry newest = entry("key____1", latest);
  EXPECT_TRUE(lane.replace_latest(newest, older));
}

}  // namespace
}  // namespace gimnet::hub
