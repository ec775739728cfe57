#include "base/log.hpp"

#include <gtest/gtest.h>

namespace gimnet {
namespace {

using namespace std::chrono_literals;

TEST(LogBudget, TakesABurstAndThenARate) {
  LogBudget budget;
  int taken = 0;
  for (int i = 0; i < 300; ++i) taken += budget.take(100, 5s) ? 1 : 0;
  EXPECT_EQ(taken, 200);
  EXPECT_EQ(budget.take_left_out(), 100u);
  EXPECT_EQ(budget.take_left_out(), 0u);
  taken = 0;
  for (int i = 0; i < 300; ++i) taken += budget.take(100, 6s) ? 1 : 0;
  EXPECT_EQ(taken, 100);
}

TEST(LogBudget, StandsAClockThatGoesBack) {
  LogBudget budget;
  EXPECT_TRUE(budget.take(100, 10s));
  EXPECT_TRUE(budget.take(100, 1s));
}

int written(LogThrottle& throttle, std::string_view reason, std::string_view peer, int lines,
            std::chrono::milliseconds now) {
  int count = 0;
  for (int i = 0; i < lines; ++i) count += throttle.take(reason, peer, 10, now).write ? 1 : 0;
  return count;
}

TEST(LogThrottle, OfAMillionLinesTenASecondAreWrittenAndTheOthersCounted) {
  LogThrottle throttle;
  EXPECT_EQ(written(throttle, "refused", "10.0.0.1", 1'000'000, 1s), 10);
  EXPECT_EQ(written(throttle, "refused", "10.0.0.1", 1, 1'099ms), 0);
  const LogThrottle::Verdict next = throttle.take("refused", "10.0.0.1", 10, 1'200ms);
  EXPECT_TRUE(next.write);
  EXPECT_EQ(next.left_out, 1'000'000u - 10 + 1);
  EXPECT_EQ(throttle.take("refused", "10.0.0.1", 10, 2'000ms).left_out, 0u);
}

TEST(LogThrottle, NobodyKeepsOtherPeersOrReasonsOut) {
  LogThrottle throttle;
  EXPECT_EQ(written(throttle, "refused", "10.0.0.1", 100, 1s), 10);
  EXPECT_EQ(written(throttle, "refused", "10.0.0.2", 100, 1s), 10);
  EXPECT_EQ(written(throttle, "closed", "10.0.0.1", 100, 1s), 10);
  EXPECT_EQ(written(throttle, "refused10.0.0.1", "", 100, 1s), 10)
      << "reason and peer are two things";
}

TEST(LogThrottle, KnowsSoManySubjectsAndNotOneMore) {
  LogThrottle throttle;
  EXPECT_EQ(written(throttle, "refused", "first", 15, 1s), 10);
  for (std::size_t i = 1; i < LogThrottle::kSubjectsMax; ++i) {
    EXPECT_TRUE(throttle.take("refused", std::to_string(i), 10, 1s).write);
  }
  EXPECT_EQ(written(throttle, "refused", "first", 1, 1s), 0) << "it is still known";
  EXPECT_EQ(throttle.take_forgotten(), 0u);
  for (std::size_t i = 0; i < LogThrottle::kSubjectsMax; ++i) {
    EXPECT_TRUE(throttle.take("closed", std::to_string(i), 10, 1s).write);
    EXPECT_LE(throttle.subjects(), LogThrottle::kSubjectsMax);
  }
  EXPECT_EQ(throttle.take_forgotten(), 6u) << "what was left out is told all the same";
  EXPECT_EQ(throttle.take_forgotten(), 0u);
  EXPECT_EQ(written(throttle, "refused", "first", 1, 1s), 1);
}

}  // namespace
}  // namespace gimnet
