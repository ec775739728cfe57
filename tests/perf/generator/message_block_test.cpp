#include "generator/message_block.hpp"

#include <gtest/gtest.h>

namespace gimnet::perf {
namespace {

constexpr std::size_t kStampAt = 4;
constexpr std::size_t kMessageBytes = 12;

void append(MessageBlock& block, StreamId stream) {
  const std::size_t begin = block.bytes.size();
  block.bytes.resize(begin + kMessageBytes);
  block.mark_stamp(begin + kStampAt, stream);
  block.mark_number(begin);
  block.mark_end();
}

std::uint64_t stamp_of(const MessageBlock& block, std::size_t index) {
  return load_u64(block.bytes.data() + index * kMessageBytes + kStampAt);
}

TEST(MessageBlock, NumbersEachStreamByItself) {
  MessageBlock block;
  append(block, 1);
  append(block, 2);
  append(block, 1);
  block.renew();
  EXPECT_EQ(stamp_of(block, 0), make_stamp(1, 0));
  EXPECT_EQ(stamp_of(block, 1), make_stamp(2, 0));
  EXPECT_EQ(stamp_of(block, 2), make_stamp(1, 1));
  block.renew();
  EXPECT_EQ(stamp_of(block, 0), make_stamp(1, 2));
  EXPECT_EQ(stamp_of(block, 1), make_stamp(2, 1));
  EXPECT_EQ(stamp_of(block, 2), make_stamp(1, 3));
}

TEST(MessageBlock, NeverRepeatsAMessageNumber) {
  MessageBlock block;
  append(block, 1);
  append(block, 2);
  block.renew();
  EXPECT_EQ(load_u32(block.bytes.data()), 1u);
  EXPECT_EQ(load_u32(block.bytes.data() + kMessageBytes), 2u);
  block.renew();
  EXPECT_EQ(load_u32(block.bytes.data()), 3u);
}

TEST(MessageBlock, KnowsWhereMessagesEnd) {
  MessageBlock block;
  append(block, 1);
  append(block, 1);
  EXPECT_EQ(block.message_count(), 2u);
  EXPECT_EQ(block.message_bytes(), kMessageBytes);
  EXPECT_EQ(block.message_end(0), kMessageBytes);
  EXPECT_EQ(block.message_end(1), 2 * kMessageBytes);
}

}  // namespace
}  // namespace gimnet::perf
