#include "hub/data/egress/copy_chunk.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/hub/data/support/egress_rig.hpp"

namespace gimnet::hub {
namespace {

using testing::EgressRig;
using ::testing::ElementsAre;
using testing::TestConnection;
using testing::TestFrame;

/// An outbox to which frames are offered as a router offers them: what append() takes, and what it
/// leaves to push().
class OpenRunTest : public ::testing::Test {
 protected:
  void TearDown() override { EXPECT_TRUE(rig.ledger_exact()); }
  /// Was it appended?
  bool offer(const std::vector<std::string>& payloads, const TestFrame& frame = {}) {
    const hub::Run run = rig.run(payloads, frame);
    if (connection.outbox.append(run.bytes, run.size, run.frames)) {
      rig.tally.queued += run.frames;
      return true;
    }
    connection.outbox.push(run, run.header(), {}, rig.context);
    return false;
  }
  std::vector<std::string> flush_and_take() {
    EXPECT_EQ(connection.flush(), Flush::emptied);
    return connection.take();
  }

  EgressRig rig;
  TestConnection connection{rig};
};

TEST_F(OpenRunTest, FramesLikeTheLastOneAreAppended) {
  EXPECT_FALSE(offer({"one"}));
  EXPECT_TRUE(offer({"two"}));
  EXPECT_TRUE(offer({"three", "four"}));
  EXPECT_EQ(rig.tally.queued, 4);
  EXPECT_EQ(connection.outbox.lane(1).front().frames, 4u);
  EXPECT_THAT(flush_and_take(), ElementsAre("one", "two", "three", "four"));
  EXPECT_EQ(rig.tally.delivered, 4u);
  EXPECT_EQ(connection.outbox.lane(1).bytes(), 0u);
}

TEST_F(OpenRunTest, EverySizeIsCopiedWhole) {
  std::vector<std::string> sent;
  for (std::uint32_t size = 0; size < 200; ++size) {
    std::string payload;
    for (std::uint32_t i = 0; i < size; ++i)
      payload += static_cast<char>('a' + (i * 7 + size) % 26);
    offer({payload});
    sent.push_back(payload);
    if (size % 8 != 7) continue;
    EXPECT_EQ(flush_and_take(), sent);
    sent.clear();
  }
}

TEST_F(OpenRunTest, AnotherHeaderIsNot) {
  offer({"one"});
  EXPECT_FALSE(offer({"another lane"}, {.lane = 2}));
  EXPECT_FALSE(offer({"one"})) << "the last run is another one now";
  EXPECT_FALSE(offer({"another sender"}, {.src = 2}));
  EXPECT_FALSE(offer({"other flags"}, {.flags = 1, .src = 2}));
  EXPECT_FALSE(offer({"another kind"}, {.kind = proto::Kind::service, .flags = 1, .src = 2}));
  EXPECT_THAT(flush_and_take(), ElementsAre("one", "one", "another sender", "other flags",
                                            "another kind", "another lane"));
}

TEST_F(OpenRunTest, BlockIsCountedAsWhatItIs) {
  offer({"one"}, {.flags = 1});
  EXPECT_TRUE(offer({"two"}, {.flags = 1}));
  EXPECT_EQ(connection.outbox.lane(1).block_bytes(), 2 * proto::kHeaderSize + 6u);
  EXPECT_THAT(flush_and_take(), ElementsAre("one", "two"));
  EXPECT_EQ(connection.outbox.lane(1).block_bytes(), 0u);
}

TEST_F(OpenRunTest, LargeRunsAreReferredTo) {
  const std::string largest_copied(4'095 - proto::kHeaderSize, 'x');
  const std::string smallest_referred(4'096 - proto::kHeaderSize, 'x');
  offer({std::string(3'000, 'f')});  // fills a chunk, so that the next one is large
  offer({largest_copied});
  offer({largest_copied});
  while (!offer({"small"})) {
  }
  EXPECT_TRUE(offer({"small"}));
  EXPECT_FALSE(offer({smallest_referred}));
  EXPECT_FALSE(offer({"small"})) << "no order would be kept";
  EXPECT_EQ(connection.flush(), Flush::emptied);
}

TEST_F(OpenRunTest, WhatIsLookedAtSinglyIsNot) {
  const std::uint8_t latest = 3 | proto::kFlagKeyed;
  offer({"key____1 old"}, {.flags = latest});
  EXPECT_FALSE(offer({"key____1 new"}, {.flags = latest}));
  rig.push_fragment(connection.outbox, 1, 0, 8, "half");
  EXPECT_FALSE(offer({"whole"}));
  rig.push_fragment(connection.outbox, 1, 4, 8, "half");
  EXPECT_FALSE(offer({"whole"}));
  EXPECT_EQ(connection.flush(), Flush::emptied);
}

TEST_F(OpenRunTest, AFlushClosesIt) {
  offer({"one"});
  EXPECT_THAT(flush_and_take(), ElementsAre("one"));
  EXPECT_FALSE(offer({"two"}));
  EXPECT_TRUE(offer({"three"}));
  EXPECT_THAT(flush_and_take(), ElementsAre("two", "three"));
}

TEST_F(OpenRunTest, ABacklogClosesIt) {
  connection.peer.set_room(20);
  offer({"one"});
  offer({"two"});
  EXPECT_EQ(connection.flush(), Flush::blocked);
  EXPECT_FALSE(offer({"three"}));
  EXPECT_FALSE(offer({"four"})) << "policies begin when something waits";
  connection.peer.set_room(MemoryPeer::kAll);
  EXPECT_EQ(connection.flush(), Flush::emptied);
  EXPECT_THAT(connection.take(), ElementsAre("one", "two", "three", "four"));
}

TEST_F(OpenRunTest, AControlFrameBetweenDoesNotMixWithIt) {
  offer({"one"});
  const auto ping = EgressRig::bytes("", {.kind = proto::Kind::flow, .lane = 0});
  ASSERT_TRUE(connection.outbox.push_control(ping, rig.context));
  EXPECT_FALSE(offer({"two"}));
  EXPECT_TRUE(offer({"three"}));
  ASSERT_EQ(connection.flush(), Flush::emptied);
  EXPECT_THAT(connection.take(), ElementsAre("", "one", "two", "three"));
}

TEST_F(OpenRunTest, EndsWithTheLanesLimit) {
  rig.limits.lane1_bytes = 16 * 1'024;
  const std::string kilobyte(512 - proto::kHeaderSize, 'k');
  for (const std::uint8_t flags : {std::uint8_t{1}, std::uint8_t{2}}) {
    for (int i = 0; i < 16; ++i) offer({kilobyte}, {.flags = flags});
  }
  EXPECT_EQ(connection.outbox.lane(1).bytes(), 16u * 1'024);
  // The last one is beyond it: this takes the long way, where the policy decides.
  EXPECT_FALSE(offer({kilobyte}, {.flags = 2}));
  EXPECT_EQ(rig.dropped(proto::DropReason::queue_full), 1u);
  EXPECT_FALSE(offer({kilobyte}));
  EXPECT_THAT(rig.signals.take(), ElementsAre("pause 1"));
  EXPECT_EQ(connection.flush(), Flush::emptied);
}

TEST_F(OpenRunTest, AnIdleOutboxGivesItBack) {
  EXPECT_FALSE(connection.outbox.has_lanes());
  EXPECT_TRUE(connection.outbox.empty());
  EXPECT_EQ(connection.flush(), Flush::emptied);
  EXPECT_FALSE(connection.outbox.has_lanes());
  offer({"one"});
  connection.outbox.trim();
  EXPECT_TRUE(connection.outbox.has_lanes()) << "something waits";
  EXPECT_THAT(flush_and_take(), ElementsAre("one"));
  connection.outbox.trim();
  EXPECT_FALSE(connection.outbox.has_lanes());
  EXPECT_FALSE(offer({"two"}));
  EXPECT_THAT(flush_and_take(), ElementsAre("two"));
}

}  // namespace
}  // namespace gimnet::hub
