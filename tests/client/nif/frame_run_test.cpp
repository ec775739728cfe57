#include "client/nif/frame_run.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <memory>

#include "proto/frame/frame_header.hpp"

namespace gimnet::nif::test {
namespace {

/// `count` frames of 16 bytes in one chunk.
FrameRun run_of(std::uint32_t count, proto::Policy policy = proto::Policy::kind_default) {
  auto chunk = std::make_shared<Chunk>(count * proto::kHeaderSize);
  for (std::uint32_t i = 0; i < count; ++i) {
    proto::FrameHeader header;
    header.dst = i;
    header.flags = static_cast<std::uint8_t>(policy);
    proto::store_header(chunk->memory.get() + i * proto::kHeaderSize, header);
  }
  return {chunk, 0, count * proto::kHeaderSize, count, 1, FrameRun::Sort::data};
}

TEST(RetainedFrames, ConfirmationsDropFromTheFront) {
  RetainedFrames retained(1000);
  retained.written(run_of(3), true);
  EXPECT_EQ(retained.bytes(), 48u);
  EXPECT_TRUE(retained.confirm(1, 0));
  EXPECT_EQ(retained.bytes(), 32u);
  EXPECT_TRUE(retained.confirm(1, 0)) << "repeated";
  EXPECT_TRUE(retained.confirm(0, 0)) << "late";
  EXPECT_EQ(retained.bytes(), 32u);
  EXPECT_TRUE(retained.confirm(3, 0));
  EXPECT_EQ(retained.bytes(), 0u);
  EXPECT_FALSE(retained.confirm(4, 0));
}

TEST(RetainedFrames, GivesBackWhatThePeerMissed) {
  RetainedFrames retained(1000);
  retained.written(run_of(4), true);
  std::deque<FrameRun> again;
  EXPECT_EQ(retained.take_after(1, again), 0u);
  ASSERT_EQ(again.size(), 1u);
  EXPECT_EQ(again.front().frames, 3u);
  EXPECT_EQ(again.front().first_header().dst, 1u);
  EXPECT_EQ(retained.next_count(), 1u);
}

TEST(RetainedFrames, NeighboursOfOneLaneAreOneRunAndThoseOfTwoAreNot) {
  RetainedFrames retained(1000);
  FrameRun rest = run_of(4);
  retained.written(rest.split(proto::kHeaderSize, 1), true);
  retained.written(rest.split(proto::kHeaderSize, 1), true);
  rest.lane = 3;
  retained.written(rest.split(proto::kHeaderSize, 1), true);
  rest.lane = 1;
  retained.written(rest, true);
  std::deque<FrameRun> again;
  EXPECT_EQ(retained.take_after(0, again), 0u);
  ASSERT_EQ(again.size(), 3u);
  EXPECT_EQ(again[0].frames, 2u);
  EXPECT_EQ(again[0].lane, 1u);
  EXPECT_EQ(again[1].lane, 3u);
  EXPECT_EQ(again[2].lane, 1u);
}

TEST(RetainedFrames, OnlyCountsWithoutResume) {
  RetainedFrames retained(1000);
  retained.written(run_of(4), false);
  EXPECT_EQ(retained.next_count(), 4u);
  EXPECT_EQ(retained.bytes(), 0u);
}

TEST(RetainedFrames, MakesRoomOnlyByWhatMayGo) {
  RetainedFrames retained(64);
  retained.written(run_of(2, proto::Policy::drop), true);
  retained.written(run_of(2, proto::Policy::block), true);
  EXPECT_FALSE(retained.make_room(33)) << "the two dropped make room for 32 bytes";
  EXPECT_EQ(retained.let_go(), 2u);
  EXPECT_TRUE(retained.make_room(32));
  std::deque<FrameRun> again;
  EXPECT_EQ(retained.take_after(0, again), 2u);
}

TEST(RetainedFrames, ANewEpochForgets) {
  RetainedFrames retained(64);
  retained.written(run_of(2), true);
  retained.restart();
  EXPECT_EQ(retained.bytes(), 0u);
  EXPECT_FALSE(retained.confirm(1, 0));
}

}  // namespace
}  // namespace gimnet::nif::test
