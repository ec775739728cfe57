#include "hub/data/egress/frame_starts.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "base/endian.hpp"
#include "tests/hub/data/support/egress_rig.hpp"

namespace gimnet::hub {
namespace {

using testing::EgressRig;

constexpr std::uint32_t kFrames = 100;

class FrameStartsTest : public ::testing::Test {
 protected:
  /// 100 frames of 16, 17, 18, 16 ... bytes.
  hub::Run make_run() {
    std::vector<std::string> payloads;
    for (std::uint32_t i = 0; i < kFrames; ++i) payloads.emplace_back(i % 3, 'x');
    return rig.run(payloads);
  }
  /// Whoever looks at a frame's length from here on gets nonsense.
  static void make_unreadable(const hub::Run& run) {
    for (std::uint32_t offset = 0; offset != run.size;) {
      auto* const frame = const_cast<std::byte*>(run.bytes + offset);
      offset += static_cast<std::uint32_t>(proto::load_header(frame).frame_size());
      store_le(frame, ~std::uint32_t{0});
    }
  }

  EgressRig rig;
  FrameStarts starts;
};

TEST_F(FrameStartsTest, LooksAtARunOnce) {
  hub::Run run = make_run();
  ASSERT_NE(starts.find(run), nullptr);
  make_unreadable(run);
  for (int queue = 0; queue < 3; ++queue) {
    const auto* known = starts.find(run);
    ASSERT_NE(known, nullptr);
    EXPECT_EQ(known->leading_frames(run, 0).size, 0u);
    EXPECT_EQ(known->leading_frames(run, 2).size, 33u);
    EXPECT_EQ(known->leading_frames(run, kFrames - 1).size, run.size - 16);
    EXPECT_EQ(known->leading_from(run, 1).size, 16u);
    EXPECT_EQ(known->leading_from(run, 16).frames, 1u);
    EXPECT_EQ(known->leading_from(run, 17).frames, 2u);
    EXPECT_EQ(known->leading_from(run, 34).size, 51u);
    EXPECT_EQ(known->leading_from(run, run.size - 1).frames, kFrames);
    EXPECT_EQ(known->leading_within(run, 15).frames, 0u);
    EXPECT_EQ(known->leading_within(run, 50).size, 33u);
    EXPECT_EQ(known->leading_within(run, 51).frames, 3u);
    EXPECT_EQ(known->leading_within(run, run.size - 1).frames, kFrames - 1);
    EXPECT_EQ(known->last(run), run.bytes + run.size - 16);
  }
}

TEST_F(FrameStartsTest, KnowsWhatIsLeftOfARun) {
  hub::Run run = make_run();
  ASSERT_NE(starts.find(run), nullptr);
  make_unreadable(run);
  const hub::Run front = run.take_front(4, 67);
  hub::Run middle = run.take_front(60, 60 * 17);
  const auto* known = starts.find(middle);
  ASSERT_NE(known, nullptr);
  EXPECT_EQ(known->leading_frames(middle, 3).size, 17u + 18u + 16u);
  EXPECT_EQ(known->leading_from(middle, 18).size, 17u + 18u);
  EXPECT_EQ(known->leading_from(middle, middle.size - 1).size, middle.size)
      << "the next frame is not one of it";
  EXPECT_EQ(known->leading_within(middle, middle.size - 1).frames, 59u);
  EXPECT_EQ(known->last(middle), middle.bytes + middle.size - 16);
  EXPECT_EQ(starts.find(front), nullptr) << "not worth it";
}

TEST_F(FrameStartsTest, KeepsTheBufferUntilTheTurnIsOver) {
  hub::Run run = make_run();
  const hub::Buffer* const buffer = run.buffer.get();
  ASSERT_NE(starts.find(run), nullptr);
  const std::uint32_t references = buffer->references;
  starts.forget();
  EXPECT_EQ(buffer->references, references - 1);
  // What lies there now has other lengths: the first frame has taken in the second.
  store_le(const_cast<std::byte*>(run.bytes), std::uint32_t{17});
  --run.frames;
  const auto* known = starts.find(run);
  ASSERT_NE(known, nullptr);
  EXPECT_EQ(known->leading_from(run, 1).size, 33u);
}

TEST_F(FrameStartsTest, ForgetsTheOldestOfManyRuns) {
  std::vector<hub::Run> runs;
  for (std::size_t i = 0; i <= FrameStarts::kStretches; ++i) {
    runs.push_back(make_run());
    ASSERT_NE(starts.find(runs.back()), nullptr);
  }
  for (std::size_t i = 1; i < runs.size(); ++i) make_unreadable(runs[i]);
  for (std::size_t i = 1; i < runs.size(); ++i)
    EXPECT_EQ(starts.find(runs[i])->leading_from(runs[i], 17).size, 33u);
  EXPECT_EQ(starts.find(runs[0])->leading_from(runs[0], 17).size, 33u) << "looked at again";
}

TEST_F(FrameStartsTest, LeavesOutWhatIsShorterOrLongerThanItIsFor) {
  hub::Run run = make_run();
  run.frames = FrameStarts::kFramesMin - 1;
  EXPECT_EQ(starts.find(run), nullptr);
  run.frames = FrameStarts::kFramesMax + 1;
  EXPECT_EQ(starts.find(run), nullptr);
}

}  // namespace
}  // namespace gimnet::hub
