#include "base/byte_buffer.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>

namespace gimnet {
namespace {

std::span<const std::byte> bytes(std::string_view text) { return std::as_bytes(std::span(text)); }

std::string_view text(const ByteBuffer& buffer) {
  return {reinterpret_cast<const char*>(buffer.data()), buffer.size()};
}

TEST(ByteBuffer, AppendsInOrder) {
  ByteBuffer buffer;
  ASSERT_TRUE(buffer.append(bytes("GIM")));
  ASSERT_TRUE(buffer.append(bytes("")));
  ASSERT_TRUE(buffer.append(bytes("net")));
  EXPECT_EQ(text(buffer), "GIMnet");
}

TEST(ByteBuffer, GrowsByDoublingUpToTheMaximum) {
  ByteBuffer buffer;
  const std::array<std::byte, 200> some{};
  ASSERT_TRUE(buffer.append(some, 500));
  EXPECT_EQ(buffer.capacity(), 256u);
  ASSERT_TRUE(buffer.append(some, 500));
  EXPECT_EQ(buffer.capacity(), 500u);
  ASSERT_TRUE(buffer.append(some, 500));
  EXPECT_EQ(buffer.size(), 600u)
      << "the maximum bounds what is reserved ahead, not what is asked for";
}

TEST(ByteBuffer, MovesItsMemory) {
  ByteBuffer from;
  ASSERT_TRUE(from.append(bytes("GIMnet")));
  const std::byte* memory = from.data();
  ByteBuffer to(std::move(from));
  EXPECT_EQ(to.data(), memory);
  ByteBuffer assigned;
  assigned = std::move(to);
  EXPECT_EQ(text(assigned), "GIMnet");
}

TEST(ByteBuffer, AlignsOneByteHoweverItGrows) {
  for (const std::size_t aligned_at : {0u, 1u, 12u, 20u, 64u, 1000u}) {
    ByteBuffer buffer(aligned_at);
    std::string all;
    for (std::size_t i = 0; i < 40; ++i) {
      const std::string more(i * i * 20 + 1, static_cast<char>('a' + i));
      ASSERT_TRUE(buffer.append(bytes(more), 300'000));
      all += more;
      const auto address = reinterpret_cast<std::uintptr_t>(buffer.data()) + aligned_at;
      EXPECT_EQ(address % ByteBuffer::kAlignment, 0u) << buffer.size();
    }
    EXPECT_TRUE(text(buffer) == all) << aligned_at;
    ByteBuffer moved;
    moved = std::move(buffer);
    ASSERT_TRUE(moved.reserve(1'000'000));
    EXPECT_EQ((reinterpret_cast<std::uintptr_t>(moved.data()) + aligned_at) % 64, 0u);
    EXPECT_TRUE(text(moved) == all) << aligned_at;
  }
}

TEST(ByteBuffer, KeepsItsMemoryWhenCleared) {
  ByteBuffer buffer;
  ASSERT_TRUE(buffer.append(bytes("GIMnet")));
  const std::size_t capacity = buffer.capacity();
  buffer.clear();
  EXPECT_TRUE(buffer.empty());
  EXPECT_EQ(buffer.capacity(), capacity);
}

TEST(ByteBuffer, AlignsAnotherByteInTheSameMemory) {
  ByteBuffer buffer(12);
  ASSERT_TRUE(buffer.append(bytes(std::string(1'000, 'a'))));
  const std::size_t capacity = buffer.capacity();
  for (const std::size_t aligned_at : {0u, 20u, 24u}) {
    buffer.clear();
    buffer.align(aligned_at);
    const std::string text_of(capacity, 'b');
    ASSERT_TRUE(buffer.append(bytes(text_of)));
    EXPECT_EQ((reinterpret_cast<std::uintptr_t>(buffer.data()) + aligned_at) % 64, 0u);
    EXPECT_TRUE(text(buffer) == text_of);
    EXPECT_EQ(buffer.capacity(), capacity) << "as it fits";
  }
  ByteBuffer none;
  none.align(20);
  EXPECT_TRUE(none.empty());
}

TEST(ByteBuffer, SaysWhenThereIsNoMemory) {
  ByteBuffer buffer;
  ASSERT_TRUE(buffer.append(bytes("GIMnet")));
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__) && !defined(__clang__)
  EXPECT_FALSE(buffer.reserve(SIZE_MAX / 4));
#endif
  EXPECT_EQ(text(buffer), "GIMnet");
}

}  // namespace
}  // namespace gimnet
