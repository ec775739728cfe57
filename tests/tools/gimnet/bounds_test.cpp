#include "tools/gimnet/bounds.hpp"

#include <gtest/gtest.h>

namespace gimnet::tool {
namespace {

ToolOptions options(std::uint64_t count, double seconds) {
  ToolOptions options;
  options.count = count;
  options.seconds = seconds;
  return options;
}

TEST(Bounds, WithoutAnyItGoesOn) {
  const Bounds bounds(options(0, 0.0), 100);
  EXPECT_FALSE(bounds.enough(1'000'000));
  EXPECT_FALSE(bounds.late(INT64_MAX));
  EXPECT_EQ(bounds.wait(Timeout{500}, 100), Timeout{500});
}

TEST(Bounds, EndsAfterSoManyMessages) {
  const Bounds bounds(options(3, 0.0), 0);
  EXPECT_FALSE(bounds.enough(2));
  EXPECT_TRUE(bounds.enough(3));
  EXPECT_TRUE(bounds.missed(2));
  EXPECT_FALSE(bounds.missed(3));
}

TEST(Bounds, EndsAfterSoMuchTime) {
  const Bounds bounds(options(0, 0.5), 1'000);
  EXPECT_FALSE(bounds.late(500'000'999));
  EXPECT_TRUE(bounds.late(500'001'000));
  EXPECT_EQ(bounds.wait(Timeout{1000}, 1'000), Timeout{500});
  EXPECT_EQ(bounds.wait(Timeout{1000}, 500'000'999), Timeout{1}) << "not too early";
  EXPECT_EQ(bounds.wait(Timeout{1000}, 900'000'000), Timeout{0});
  EXPECT_TRUE(bounds.missed(0));
  EXPECT_FALSE(bounds.missed(1));
}

}  // namespace
}  // namespace gimnet::tool
