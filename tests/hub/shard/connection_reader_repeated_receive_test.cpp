#include "hub/shard/connection_reader.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/hub/shard/support/hub_rig.hpp"

namespace gimnet::hub {
namespace {

using testing::FakeNode;
using testing::HubRig;
using ::testing::SizeIs;

TEST(RepeatedReceive, ReadsAgainWhatCameMeanwhileWhereThatIsOften) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(0);
  const auto send_in_reads_of_one = [&](std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) rig.send(a, b.id.value(), "message");
    a.pipe.plan_receives(std::vector<std::size_t>(count, proto::kHeaderSize + 7));
    b.frames.clear();
  };
  // A newcomer has shown nothing yet: one read a turn.
  send_in_reads_of_one(7);
  for (std::size_t turn = 1; turn <= 7; ++turn) {
    rig.turn();
    b.read();
    EXPECT_THAT(b.frames, SizeIs(turn));
  }
  // The eighth read is followed by another, which finds something; so it goes on.
  for (int round = 0; round < 3; ++round) {
    send_in_reads_of_one(4);
    const std::uint64_t sends_before = rig.sum(&ShardCounters::send_calls);
    rig.turn();
    b.read();
    EXPECT_THAT(b.frames, SizeIs(4)) << "in one turn";
    EXPECT_EQ(rig.sum(&ShardCounters::send_calls), sends_before + 1);
  }
}

TEST(RepeatedReceive, ReadsAgainEverMoreRarelyWhereNothingCame) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(0);
  rig.settle();
  const std::uint64_t calls_before = rig.sum(&ShardCounters::receive_calls);
  constexpr std::uint64_t kMessages = 640;
  for (std::uint64_t i = 0; i < kMessages; ++i) {
    rig.send(a, b.id.value(), "message");
    rig.turn();
  }
  const std::uint64_t tries = rig.sum(&ShardCounters::receive_calls) - calls_before - kMessages;
  EXPECT_GE(tries, kMessages / 64);
  EXPECT_LE(tries, kMessages / 64 + 4);
}

TEST(RepeatedReceive, AnEndBehindWhatWasReadAgainIsSeenInTheNextTurn) {
  HubRig rig;
  FakeNode& a = rig.join(0);
  FakeNode& b = rig.join(0);
  for (int i = 0; i < 8; ++i) {
    rig.send(a, b.id.value(), "message");
    if (i == 7) a.pipe.close();
    rig.turn();
  }
  rig.settle();
  b.read();
  EXPECT_THAT(b.frames, SizeIs(8));
  EXPECT_TRUE(a.pipe.transport_gone());
}

}  // namespace
}  // namespace gimnet::hub
