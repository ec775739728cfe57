#include "client/nif/storage.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <utility>
#include <vector>

namespace gimnet::nif {
namespace {

constexpr std::size_t kMin = SpareBuffers::kMessageBytesMin;

ByteBuffer with_memory(std::size_t bytes) {
  ByteBuffer buffer;
  EXPECT_TRUE(buffer.reserve(bytes));
  return buffer;
}

TEST(SpareBuffers, GivesOutTheMemoryThatCameBackLast) {
  SpareBuffers spares;
  ByteBuffer cold = with_memory(kMin);
  ByteBuffer warm = with_memory(2 * kMin);
  ASSERT_TRUE(warm.append(std::vector<std::byte>(100)));
  spares.give(std::move(cold));
  spares.give(std::move(warm));
  EXPECT_EQ(spares.bytes(), 3 * kMin);

  ByteBuffer taken = spares.take(kMin, 20);
  EXPECT_EQ(taken.capacity(), 2 * kMin);
  EXPECT_TRUE(taken.empty());
  EXPECT_EQ((reinterpret_cast<std::uintptr_t>(taken.data()) + 20) % ByteBuffer::kAlignment, 0u);
  EXPECT_EQ(spares.bytes(), kMin);
  EXPECT_EQ(spares.take(kMin, 0).capacity(), kMin);
  EXPECT_EQ(spares.take(kMin, 0).capacity(), 0u) << "there is none";
}

TEST(SpareBuffers, LeavesSmallMessagesAlone) {
  SpareBuffers spares;
  spares.give(with_memory(kMin - 1));
  EXPECT_EQ(spares.bytes(), 0u);
  spares.give(with_memory(kMin));
  EXPECT_EQ(spares.bytes(), kMin);
  EXPECT_EQ(spares.take(kMin - 1, 0).capacity(), 0u);
  EXPECT_EQ(spares.take(kMin, 0).capacity(), kMin);
}

TEST(SpareBuffers, KeepsAtMostItsLimit) {
  SpareBuffers spares;
  spares.give(with_memory(SpareBuffers::kBytesMax - kMin));
  spares.give(with_memory(kMin));
  EXPECT_EQ(spares.bytes(), SpareBuffers::kBytesMax);
  spares.give(with_memory(kMin));
  EXPECT_EQ(spares.bytes(), SpareBuffers::kBytesMax);

  SpareBuffers others;
  others.give(with_memory(SpareBuffers::kBytesMax + 1));
  EXPECT_EQ(others.bytes(), 0u);
}

}  // namespace
}  // namespace gimnet::nif
