#include "proto/bitestream/format.hpp"

#include <gtest/gtest.h>

namespace gimnet::proto::bitestream {
namespace {

TEST(BitestreamFormat, ValuesHaveFromOneByteToAGibibyte) {
  EXPECT_FALSE(size_fits(BITESTREAM_OPAQUE, 0));
  EXPECT_TRUE(size_fits(BITESTREAM_OPAQUE, 1));
  EXPECT_TRUE(size_fits(BITESTREAM_OPAQUE, 1u << 30));
  EXPECT_FALSE(size_fits(BITESTREAM_OPAQUE, (1u << 30) + 1));
}

TEST(BitestreamFormat, ValuesOfAFixedSizeHaveExactlyIt) {
  EXPECT_TRUE(size_fits(BITESTREAM_U32, 4));
  EXPECT_FALSE(size_fits(BITESTREAM_U32, 8));
  EXPECT_TRUE(size_fits(BITESTREAM_U32_ARRAY, 8));
  EXPECT_FALSE(size_fits(BITESTREAM_U32_ARRAY, 6));
  EXPECT_TRUE(size_fits(BITESTREAM_TIME_ARRAY, 16));
}

TEST(BitestreamFormat, KnowsItsTypes) {
  for (const unsigned type : {15u, 16u, 28u, 30u, 31u, 32u})
    EXPECT_FALSE(is_known_type(type)) << type;
  for (unsigned type = 0; type <= 14; ++type) EXPECT_TRUE(is_known_type(type)) << type;
  for (unsigned type = 17; type <= 27; ++type) EXPECT_TRUE(is_known_type(type)) << type;
  EXPECT_TRUE(is_known_type(29));
}

}  // namespace
}  // namespace gimnet::proto::bitestream
