#include "tools/gimnet/news_pace.hpp"

#include <gtest/gtest.h>

namespace gimnet::tool {
namespace {

TEST(NewsPace, IsDueAtOnceAndThenAfterEachPeriod) {
  NewsPace pace;
  EXPECT_TRUE(pace.due(100));
  EXPECT_FALSE(pace.due(100));
  EXPECT_FALSE(pace.due(100 + NewsPace::kPeriodNs - 1));
  EXPECT_TRUE(pace.due(100 + NewsPace::kPeriodNs));
  EXPECT_FALSE(pace.due(101 + NewsPace::kPeriodNs));
}

}  // namespace
}  // namespace gimnet::tool
