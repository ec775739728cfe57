#include "tools/gimnet/decimal.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace gimnet::tool {
namespace {

TEST(Decimal, HasThePlacesThatAreWanted) {
  EXPECT_EQ(decimal(1.0 / 3.0, 3), "0.333");
  EXPECT_EQ(decimal(2.5), "2.5");
  EXPECT_EQ(decimal(10.0), "10");
  EXPECT_EQ(decimal(std::numeric_limits<double>::max(), 0).size(), 309u);
}

TEST(ByteCount, TakesTheUnitThatSuits) {
  EXPECT_EQ(byte_count(0), "0 B");
  EXPECT_EQ(byte_count(999), "999 B");
  EXPECT_EQ(byte_count(1000), "1.0 kB");
  EXPECT_EQ(byte_count(999'949), "999.9 kB");
  EXPECT_EQ(byte_count(999'960), "1.0 MB");
  EXPECT_EQ(byte_count(2.5e9), "2.5 GB");
  EXPECT_EQ(byte_count(5e15), "5000.0 TB");
}

}  // namespace
}  // namespace gimnet::tool
