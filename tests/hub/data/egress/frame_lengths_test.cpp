#include "hub/data/egress/frame_lengths.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "proto/frame/frame_parser.hpp"
#include "tests/hub/data/support/egress_rig.hpp"

namespace gimnet::hub {
namespace {

using testing::EgressRig;

constexpr std::uint32_t kHeader = proto::kHeaderSize;

std::string told(const Leading& leading) {
  return std::to_string(leading.frames) + " of " + std::to_string(leading.size);
}

hub::Run run_of(EgressRig& rig, const std::vector<std::uint32_t>& sizes) {
  std::vector<std::string> payloads;
  for (const std::uint32_t size : sizes) payloads.emplace_back(size - kHeader, 'x');
  return rig.run(payloads);
}

// Nothing but the first frame is looked at: the others say nonsense about their length.
hub::Run unreadable_run(EgressRig& rig, std::uint32_t frames, std::uint32_t frame_size) {
  hub::Run run = run_of(rig, std::vector<std::uint32_t>(frames, frame_size));
  for (std::uint32_t frame = 1; frame < frames; ++frame) {
    store_le(const_cast<std::byte*>(run.bytes) + std::size_t{frame} * frame_size,
             ~std::uint32_t{0});
  }
  return run;
}

TEST(FrameLengths, CountsFramesThatAreEquallyLongWithoutLooking) {
  EgressRig rig;
  FrameStarts starts;
  const hub::Run run = unreadable_run(rig, 1'000, 20);
  EXPECT_EQ(told(leading_frames_of(run, 20, 0, starts)), "0 of 0");
  EXPECT_EQ(told(leading_frames_of(run, 20, 999, starts)), "999 of 19980");
  EXPECT_EQ(told(leading_frames_of(run, 20, 1'000, starts)), "1000 of 20000");
  EXPECT_EQ(told(leading_frames_of(run, 20, UINT64_MAX, starts)), "1000 of 20000");
  EXPECT_EQ(told(leading_from(run, 20, 1, starts)), "1 of 20");
  EXPECT_EQ(told(leading_from(run, 20, 20, starts)), "1 of 20");
  EXPECT_EQ(told(leading_from(run, 20, 21, starts)), "2 of 40");
  EXPECT_EQ(told(leading_from(run, 20, 19'980, starts)), "999 of 19980");
  EXPECT_EQ(told(leading_from(run, 20, 19'981, starts)), "1000 of 20000");
  EXPECT_EQ(told(leading_from(run, 20, 1 << 30, starts)), "1000 of 20000");
  EXPECT_EQ(told(leading_within(run, 20, 19, starts)), "0 of 0");
  EXPECT_EQ(told(leading_within(run, 20, 20, starts)), "1 of 20");
  EXPECT_EQ(told(leading_within(run, 20, 19'999, starts)), "999 of 19980");
  EXPECT_EQ(told(leading_within(run, 20, 20'000, starts)), "1000 of 20000");
  EXPECT_EQ(told(leading_up_to(run, 20, 19)), "0 of 0");
  EXPECT_EQ(told(leading_up_to(run, 20, 20)), "1000 of 20000");
  EXPECT_EQ(told(leading_beyond(run, 20, 19)), "1000 of 20000");
  EXPECT_EQ(told(leading_beyond(run, 20, 20)), "0 of 0");
  EXPECT_EQ(told(all_but_last(run, 20, starts)), "999 of 19980");
  EXPECT_EQ(last_frame(run, 20, starts), run.bytes + 19'980);
}

TEST(FrameLengths, LooksAtFramesOfAnyLengthOneByOne) {
  EgressRig rig;
  FrameStarts starts;
  const hub::Run run = run_of(rig, {30, 20, 40, 16, 50});
  EXPECT_EQ(told(leading_frames_of(run, 16, 3, starts)), "3 of 90");
  EXPECT_EQ(told(leading_from(run, 16, 30, starts)), "1 of 30");
  EXPECT_EQ(told(leading_from(run, 16, 31, starts)), "2 of 50");
  EXPECT_EQ(told(leading_from(run, 16, 107, starts)), "5 of 156");
  EXPECT_EQ(told(leading_within(run, 16, 89, starts)), "2 of 50");
  EXPECT_EQ(told(leading_within(run, 16, 29, starts)), "0 of 0");
  EXPECT_EQ(told(leading_up_to(run, 16, 30)), "2 of 50");
  EXPECT_EQ(told(leading_up_to(run, 16, 50)), "5 of 156");
  EXPECT_EQ(told(leading_beyond(run, 16, 16)), "3 of 90");
  EXPECT_EQ(told(leading_beyond(run, 16, 30)), "0 of 0");
  EXPECT_EQ(told(all_but_last(run, 16, starts)), "4 of 106");
}

// What a queue needs for a small frame does not depend on how many wait.
TEST(FrameLengths, FewFramesAreFoundWithoutLookingAtTheRest) {
  EgressRig rig;
  FrameStarts starts;
  std::vector<std::uint32_t> sizes;
  for (std::uint32_t i = 0; i < 1'000; ++i) sizes.push_back(16 + i % 2);
  hub::Run run = run_of(rig, sizes);
  for (std::uint32_t offset = 66; offset != run.size;) {
    auto* const frame = const_cast<std::byte*>(run.bytes + offset);
    offset += static_cast<std::uint32_t>(proto::load_header(frame).frame_size());
    store_le(frame, ~std::uint32_t{0});
  }
  EXPECT_EQ(told(leading_from(run, 16, 40, starts)), "3 of 49");
  EXPECT_EQ(told(leading_within(run, 16, 40, starts)), "2 of 33");
  EXPECT_EQ(told(leading_frames_of(run, 16, 4, starts)), "4 of 66");
}

TEST(FrameLengths, WhatIsTooShortForTheShortestIsNotLookedFor) {
  EgressRig rig;
  FrameStarts starts;
  hub::Run run = run_of(rig, {30, 20, 40});
  store_le(const_cast<std::byte*>(run.bytes), ~std::uint32_t{0});
  EXPECT_EQ(told(leading_within(run, 20, 19, starts)), "0 of 0");
  EXPECT_EQ(told(leading_beyond(run, 20, 19)), "3 of 90");
}

// Whatever is known of the shortest frame, the answers are the same.
TEST(FrameLengths, KnowingMoreChangesNothing) {
  for (std::uint32_t seed = 1; seed <= 200; ++seed) {
    EgressRig rig;
    FrameStarts starts;
    std::mt19937 random(seed);
    std::vector<std::uint32_t> sizes(1 + random() % (seed % 10 == 0 ? 80 : 20));
    const auto spread = static_cast<std::uint32_t>(1 + random() % 3);
    for (std::uint32_t& size : sizes)
      size = kHeader + 4 + static_cast<std::uint32_t>(random() % spread);
    const hub::Run run = run_of(rig, sizes);
    const auto found = proto::next_run(run.bytes, run.bytes + run.size, proto::kFrameLengthDefault);
    ASSERT_EQ(found.run.frames, run.frames);
    EXPECT_EQ(found.shortest_bytes, *std::min_element(sizes.begin(), sizes.end()));
    for (std::uint32_t bytes = 1; bytes < run.size + 30; ++bytes) {
      const std::uint32_t known = found.shortest_bytes;
      EXPECT_EQ(told(leading_from(run, known, bytes, starts)),
                told(leading_from(run, kHeader, bytes, starts)));
      EXPECT_EQ(told(leading_within(run, known, bytes, starts)),
                told(leading_within(run, kHeader, bytes, starts)));
      EXPECT_EQ(told(leading_frames_of(run, known, bytes, starts)),
                told(leading_frames_of(run, kHeader, bytes, starts)));
      EXPECT_EQ(told(leading_up_to(run, known, bytes)), told(leading_up_to(run, kHeader, bytes)));
      EXPECT_EQ(told(leading_beyond(run, known, bytes)), told(leading_beyond(run, kHeader, bytes)));
      EXPECT_EQ(told(all_but_last(run, known, starts)), told(all_but_last(run, kHeader, starts)));
    }
  }
}

TEST(FrameLengths, AReportShowsTheLastFrameWithoutLookingAtTheOthers) {
  EgressRig rig;
  std::vector<std::string> payloads(100, "same");
  payloads.back() = "last";
  const hub::Run run = rig.run(payloads, {.flags = proto::kFlagReport});
  for (std::uint32_t frame = 1; frame + 1 < run.frames; ++frame) {
    store_le(const_cast<std::byte*>(run.bytes) + std::size_t{frame} * 20, ~std::uint32_t{0});
  }
  rig.context.drop(run, 20, proto::DropReason::queue_full);
  int reports = 0;
  rig.drops.flush(1'000'000, [&](NodeId, std::span<const std::byte> payload) {
    const auto report = proto::decode_report(payload);
    ASSERT_TRUE(report);
    EXPECT_EQ(report->count, 100u);
    EXPECT_EQ(std::memcmp(report->following.data(), "last", 4), 0);
    ++reports;
  });
  EXPECT_EQ(reports, 1);
}

}  // namespace
}  // namespace gimnet::hub
