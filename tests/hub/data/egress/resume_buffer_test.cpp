#include "hub/data/egress/resume_buffer.hpp"

#include <gtest/gtest.h>

#include "tests/hub/data/support/egress_rig.hpp"

namespace gimnet::hub {
namespace {

using testing::EgressRig;

constexpr std::uint8_t kDrop = 2;

class ResumeBufferTest : public ::testing::Test {
 protected:
  /// Frames of 100 bytes each.
  hub::Run frames(std::size_t count, std::uint8_t flags = 0) {
    return rig.run(std::vector<std::string>(count, std::string(84, 'x')), {.flags = flags});
  }
  EgressRig rig;
  ResumeBuffer buffer{1'000};
  hub::RunQueue replay;
};

TEST_F(ResumeBufferTest, ConfirmsAtAnyFrame) {
  buffer.wrote(frames(5));
  EXPECT_EQ(buffer.unconfirmed(), 5u);
  EXPECT_EQ(buffer.confirm(2), 2u);
  EXPECT_EQ(buffer.bytes(), 300u);
  EXPECT_EQ(buffer.confirm(1), 0u) << "less than it said before";
  EXPECT_EQ(buffer.confirm(6), 0u) << "more than was written";
  EXPECT_EQ(buffer.confirm(5), 3u);
  EXPECT_EQ(buffer.bytes(), 0u);
}

TEST_F(ResumeBufferTest, HoldsItsBoundAndNotAByteMore) {
  buffer.wrote(frames(9));
  EXPECT_TRUE(buffer.make_room(0, 100));
  EXPECT_FALSE(buffer.make_room(0, 101)) << "BLOCK is waited for";
  EXPECT_FALSE(buffer.make_room(1, 100)) << "what is planned counts";
  EXPECT_EQ(buffer.confirm(1), 1u);
  EXPECT_TRUE(buffer.make_room(100, 100));
}

TEST_F(ResumeBufferTest, LetsDroppableFramesGo) {
  buffer.wrote(frames(10, kDrop));
  EXPECT_TRUE(buffer.make_room(0, 150));
  EXPECT_EQ(buffer.bytes(), 800u);
  EXPECT_EQ(buffer.unconfirmed(), 10u) << "let go is not lost: the peer may have them";
  EXPECT_EQ(buffer.confirm(10), 10u);
}

TEST_F(ResumeBufferTest, LetsNothingGoForWhatNeverFits) {
  buffer.wrote(frames(10, kDrop));
  EXPECT_FALSE(buffer.make_room(0, 1'001));
  EXPECT_EQ(buffer.bytes(), 1'000u);
}

TEST_F(ResumeBufferTest, HoldsALowerBoundToo) {
  buffer.wrote(frames(5, kDrop));
  EXPECT_TRUE(buffer.make_room(0, 100, nullptr, 600)) << "exactly";
  EXPECT_EQ(buffer.bytes(), 500u);
  EXPECT_TRUE(buffer.make_room(0, 101, nullptr, 600));
  EXPECT_EQ(buffer.bytes(), 400u);
}

TEST_F(ResumeBufferTest, LetsAsManyBytesGoAsItMust) {
  buffer.wrote(frames(4, kDrop));
  buffer.wrote(frames(2));
  buffer.wrote(frames(1, kDrop));
  buffer.let_go(100, nullptr);
  EXPECT_EQ(buffer.bytes(), 600u);
  buffer.let_go(101, nullptr);
  EXPECT_EQ(buffer.bytes(), 400u);
  buffer.let_go(UINT64_MAX, nullptr);
  EXPECT_EQ(buffer.bytes(), 300u) << "BLOCK is waited for";
  EXPECT_EQ(buffer.rewind(0, replay).gap, 4u) << "SKIP tells it";
}

TEST_F(ResumeBufferTest, RewindsToEveryCount) {
  for (std::uint64_t count = 0; count <= 5; ++count) {
    ResumeBuffer fresh(1'000);
    hub::RunQueue again;
    fresh.wrote(frames(3));
    fresh.wrote(frames(2, kDrop));
    const auto rewind = fresh.rewind(count, again);
    EXPECT_TRUE(rewind.possible);
    EXPECT_EQ(rewind.confirmed, count);
    EXPECT_EQ(rewind.gap, 0u);
    std::uint64_t waiting = 0;
    for (; !again.empty(); again.runs().pop_front()) waiting += again.runs().front().frames;
    EXPECT_EQ(waiting, 5 - count);
    EXPECT_EQ(fresh.written(), count);
  }
}

TEST_F(ResumeBufferTest, RefusesACountThatCannotBe) {
  buffer.wrote(frames(5));
  EXPECT_EQ(buffer.confirm(2), 2u);
  EXPECT_FALSE(buffer.rewind(6, replay).possible);
  EXPECT_FALSE(buffer.rewind(1, replay).possible);
  EXPECT_TRUE(replay.empty());
  EXPECT_EQ(buffer.unconfirmed(), 3u);
}

TEST_F(ResumeBufferTest, TellsTheGapUntilItWasHeardAndTheLossOnce) {
  buffer.wrote(frames(10, kDrop));
  EXPECT_TRUE(buffer.make_room(0, 300));
  auto rewind = buffer.rewind(1, replay);
  EXPECT_EQ(rewind.confirmed, 1u);
  EXPECT_EQ(rewind.gap, 2u);
  EXPECT_EQ(rewind.lost, 2u);
  // The SKIP was lost: the peer still counts 1.
  for (; !replay.empty(); replay.runs().pop_front()) buffer.wrote(replay.runs().front().share());
  rewind = buffer.rewind(1, replay);
  EXPECT_TRUE(rewind.possible);
  EXPECT_EQ(rewind.gap, 2u);
  EXPECT_EQ(rewind.lost, 0u);
  EXPECT_EQ(rewind.confirmed, 0u);
  // Now it came: 3, and then all the rest.
  for (; !replay.empty(); replay.runs().pop_front()) buffer.wrote(replay.runs().front().share());
  EXPECT_EQ(buffer.unconfirmed(), 7u);
  EXPECT_EQ(buffer.confirm(10), 7u);
}

TEST_F(ResumeBufferTest, ClearTellsWhatWasNeverConfirmed) {
  buffer.wrote(frames(4));
  EXPECT_EQ(buffer.confirm(1), 1u);
  std::uint64_t kept = 0;
  EXPECT_EQ(buffer.clear([&](const hub::Run& run) { kept += run.frames; }), 0u);
  EXPECT_EQ(kept, 3u);
  EXPECT_EQ(buffer.written(), 0u);
  EXPECT_EQ(buffer.bytes(), 0u);
}

TEST_F(ResumeBufferTest, ClearTellsWhatItLetGo) {
  buffer.wrote(frames(10, kDrop));
  ASSERT_TRUE(buffer.make_room(0, 250));
  EXPECT_EQ(buffer.confirm(1), 1u);
  std::uint64_t kept = 0;
  EXPECT_EQ(buffer.clear([&](const hub::Run& run) { kept += run.frames; }), 2u);
  EXPECT_EQ(kept, 7u);
  EXPECT_EQ(buffer.unconfirmed(), 0u);
}

}  // namespace
}  // namespace gimnet::hub
