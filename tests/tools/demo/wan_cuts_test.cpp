#include "tools/demo/wan_cuts.hpp"

#include <gtest/gtest.h>

#include <string>

namespace gimnet::demo {
namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000;
constexpr std::int64_t kMillisecond_ns = 1'000'000;
constexpr std::int64_t kStart_ns = 1'700'000'000 * kSecond_ns;

using Change = WanCuts::Change;

/// Steps each 20 ms, as the demo does. Returns the number of cuts that began.
int run(WanCuts& cuts, std::int64_t from_ns, std::int64_t until_ns) {
  int begun = 0;
  for (std::int64_t now_ns = from_ns; now_ns < until_ns; now_ns += 20 * kMillisecond_ns)
    begun += cuts.step(now_ns) == Change::cut ? 1 : 0;
  return begun;
}

std::string text(const WanCuts& cuts, std::int64_t now_ns,
                 std::optional<std::int64_t> round_trip_ns = std::nullopt) {
  LabsView view;
  cuts.show(view, now_ns, round_trip_ns);
  return view.wan_text;
}

TEST(WanCuts, ACutLastsAndIsTold) {
  WanCuts cuts;
  EXPECT_EQ(cuts.step(kStart_ns), Change::none) << "nothing is planned";
  cuts.plan(kStart_ns, std::nullopt);
  EXPECT_EQ(text(cuts, kStart_ns), "up");
  EXPECT_EQ(text(cuts, kStart_ns, 81 * kMillisecond_ns), "up, 81 ms");
  const std::int64_t cut_ns = kStart_ns + WanCuts::kFirst_ns;
  EXPECT_EQ(cuts.step(cut_ns - 1), Change::none);
  EXPECT_TRUE(cuts.quiet(cut_ns - 1));
  EXPECT_EQ(cuts.step(cut_ns), Change::cut);
  EXPECT_FALSE(cuts.quiet(cut_ns));
  EXPECT_EQ(text(cuts, cut_ns + 700 * kMillisecond_ns, 81), "CUT for 0.7 s");
  const std::int64_t back_ns = cut_ns + WanCuts::kCut_ns;
  EXPECT_EQ(cuts.step(back_ns - 1), Change::none);
  EXPECT_EQ(cuts.step(back_ns), Change::back);
  EXPECT_EQ(text(cuts, back_ns), "back");
  EXPECT_FALSE(cuts.quiet(back_ns + WanCuts::kAfter_ns));
  EXPECT_TRUE(cuts.quiet(back_ns + WanCuts::kAfter_ns + 1));
  EXPECT_EQ(text(cuts, back_ns + WanCuts::kAfter_ns + 1), "up");
  EXPECT_EQ(cuts.count(), 1u);
}

TEST(WanCuts, ExplainWhatWasSentInOneOrSoonAfterIt) {
  WanCuts cuts;
  EXPECT_FALSE(cuts.explain(kStart_ns));
  cuts.plan(kStart_ns, std::nullopt);
  const std::int64_t cut_ns = kStart_ns + WanCuts::kFirst_ns;
  const std::int64_t back_ns = cut_ns + WanCuts::kCut_ns;
  // Asked before the cut, in it, and after it: the answer is the same.
  for (const std::int64_t now_ns : {cut_ns - 1, cut_ns, back_ns}) {
    static_cast<void>(cuts.step(now_ns));
    EXPECT_FALSE(cuts.explain(cut_ns - WanCuts::kUnderWay_ns - 1));
    EXPECT_TRUE(cuts.explain(cut_ns - WanCuts::kUnderWay_ns)) << "it was on the WAN";
    EXPECT_TRUE(cuts.explain(back_ns - 1));
  }
  EXPECT_TRUE(cuts.explain(back_ns + WanCuts::kAfter_ns));
  EXPECT_FALSE(cuts.explain(back_ns + WanCuts::kAfter_ns + 1));
}

TEST(WanCuts, ARunEndsAfterItsLastCut) {
  for (const auto& [seconds, number] : {std::pair{2.0, 1}, {20.0, 2}, {60.0, 6}, {120.0, 12}}) {
    WanCuts cuts;
    cuts.plan(kStart_ns, seconds);
    const std::int64_t end_ns = kStart_ns + static_cast<std::int64_t>(seconds * 1e9);
    EXPECT_EQ(run(cuts, kStart_ns, end_ns), number) << seconds;
    EXPECT_EQ(cuts.quiet(end_ns), seconds > 10.0) << seconds;
  }
}

TEST(WanCuts, NoneBeginsAfterAStop) {
  WanCuts cuts;
  cuts.plan(kStart_ns, std::nullopt);
  EXPECT_EQ(cuts.step(kStart_ns + WanCuts::kFirst_ns), Change::cut);
  cuts.stop();
  EXPECT_EQ(cuts.step(kStart_ns + WanCuts::kFirst_ns + WanCuts::kCut_ns), Change::back);
  EXPECT_EQ(run(cuts, kStart_ns + WanCuts::kEvery_ns, kStart_ns + 10 * WanCuts::kEvery_ns), 0);
}

TEST(WanCuts, OnlyTheLastOnesExplain) {
  WanCuts cuts;
  cuts.plan(kStart_ns, std::nullopt);
  const auto number = static_cast<std::int64_t>(WanCuts::kCutsKept) + 1;
  run(cuts, kStart_ns, kStart_ns + WanCuts::kFirst_ns + number * WanCuts::kEvery_ns);
  EXPECT_EQ(cuts.count(), WanCuts::kCutsKept + 1);
  EXPECT_FALSE(cuts.explain(kStart_ns + WanCuts::kFirst_ns));
  EXPECT_TRUE(cuts.explain(kStart_ns + WanCuts::kFirst_ns + WanCuts::kEvery_ns));
}

}  // namespace
}  // namespace gimnet::demo
