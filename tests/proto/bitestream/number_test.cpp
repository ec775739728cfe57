#include "proto/bitestream/reader.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>

namespace gimnet::proto::bitestream {
namespace {

template <class T>
using Limits = std::numeric_limits<T>;

TEST(ConvertNumber, KeepsIntegersThatFit) {
  EXPECT_EQ((convert_number<std::uint8_t>(std::uint64_t{255})), 255);
  EXPECT_EQ((convert_number<std::uint8_t>(std::uint64_t{256})), std::nullopt);
  EXPECT_EQ((convert_number<std::int8_t>(std::int64_t{-128})), -128);
  EXPECT_EQ((convert_number<std::int8_t>(std::int64_t{-129})), std::nullopt);
  EXPECT_EQ((convert_number<std::uint64_t>(std::int8_t{-1})), std::nullopt);
  EXPECT_EQ((convert_number<std::int64_t>(Limits<std::uint64_t>::max())), std::nullopt);
  EXPECT_EQ((convert_number<std::int64_t>(std::uint64_t{1} << 62)), std::int64_t{1} << 62);
}

TEST(ConvertNumber, MakesIntegersFloatingWhereTheyAreExact) {
  EXPECT_EQ((convert_number<double>(std::uint64_t{1} << 53)), 0x1p53);
  EXPECT_EQ((convert_number<double>((std::uint64_t{1} << 53) + 1)), std::nullopt);
  EXPECT_EQ((convert_number<double>(std::uint64_t{1} << 63)), 0x1p63);
  EXPECT_EQ((convert_number<double>(Limits<std::uint64_t>::max())), std::nullopt);
  EXPECT_EQ((convert_number<double>(Limits<std::int64_t>::min())), -0x1p63);
  EXPECT_EQ((convert_number<double>(Limits<std::int64_t>::max())), std::nullopt);
  EXPECT_EQ((convert_number<float>(std::int32_t{-16777216})), -16777216.0f);
  EXPECT_EQ((convert_number<float>(std::int32_t{-16777217})), std::nullopt);
  EXPECT_EQ((convert_number<float>(std::int8_t{-128})), -128.0f);
}

TEST(ConvertNumber, MakesFloatingIntegersWhereTheyAreWhole) {
  EXPECT_EQ((convert_number<std::uint8_t>(255.0)), 255);
  EXPECT_EQ((convert_number<std::uint8_t>(255.5)), std::nullopt);
  EXPECT_EQ((convert_number<std::uint8_t>(256.0)), std::nullopt);
  EXPECT_EQ((convert_number<std::uint8_t>(-1.0f)), std::nullopt);
  EXPECT_EQ((convert_number<std::int64_t>(-0x1p63)), Limits<std::int64_t>::min());
  EXPECT_EQ((convert_number<std::int64_t>(0x1p63)), std::nullopt);
  EXPECT_EQ((convert_number<std::uint64_t>(0x1p64)), std::nullopt);
  EXPECT_EQ((convert_number<std::uint64_t>(0x1p63f)), std::uint64_t{1} << 63);
  EXPECT_EQ((convert_number<std::int32_t>(Limits<double>::quiet_NaN())), std::nullopt);
  EXPECT_EQ((convert_number<std::int32_t>(Limits<float>::infinity())), std::nullopt);
  EXPECT_EQ((convert_number<std::int32_t>(-0.0)), 0);
}

TEST(ConvertNumber, ShortensFloatingWhereItIsExact) {
  EXPECT_EQ((convert_number<float>(0.5)), 0.5f);
  EXPECT_EQ((convert_number<float>(0.1)), std::nullopt);
  EXPECT_EQ((convert_number<float>(1e300)), std::nullopt);
  EXPECT_EQ((convert_number<float>(Limits<double>::infinity())), Limits<float>::infinity());
  EXPECT_TRUE(std::isnan(*convert_number<float>(Limits<double>::quiet_NaN())));
  EXPECT_EQ((convert_number<double>(0.1f)), static_cast<double>(0.1f));
}

}  // namespace
}  // namespace gimnet::proto::bitestream
