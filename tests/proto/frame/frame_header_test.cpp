#include "proto/frame/frame_header.hpp"

#include <gtest/gtest.h>

namespace gimnet::proto {
namespace {

TEST(FrameHeader, BlockIsAPolicyAndTheDefaultOfWhatGoesToOne) {
  FrameHeader header;
  EXPECT_TRUE(is_block(header));
  header.flags = static_cast<std::uint8_t>(Policy::drop);
  EXPECT_FALSE(is_block(header));
  header.flags = 0;
  header.kind = Kind::group;
  EXPECT_FALSE(is_block(header));
  header.flags = static_cast<std::uint8_t>(Policy::block);
  EXPECT_TRUE(is_block(header));
  header.flags = 0;
  header.kind = Kind::service;
  EXPECT_TRUE(is_block(header));
  header.kind = static_cast<Kind>(9);
  EXPECT_TRUE(is_block(header));
}

// As docs/protocol.md, section 2, has them: who looks at a few bytes only relies on it.
TEST(FrameHeader, FieldsAreWhereTheProtocolHasThem) {
  EXPECT_EQ(kAddressesOffset, 4u);
  EXPECT_EQ(kDstOffset, 4u);
  EXPECT_EQ(kSrcOffset, 8u);
  EXPECT_EQ(kKindOffset, 12u);
  EXPECT_EQ(kAttributesOffset, 12u);
  EXPECT_EQ(kLaneOffset, 15u);
}

}  // namespace
}  // namespace gimnet::proto
