#include "base/random.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <set>

namespace gimnet {
namespace {

TEST(Random, GivesOtherBitsEachTime) {
  std::set<std::uint64_t> seen;
  for (int i = 0; i < 100; ++i) EXPECT_TRUE(seen.insert(random_bits()).second);
}

// More than the 256 bytes that one call of the system is sure to give.
TEST(Random, FillsAllOfAnySize) {
  std::array<std::byte, 4096> memory{};
  fill_randomly(memory);
  for (std::size_t at = 0; at < memory.size(); at += 64) {
    const auto part = std::span(memory).subspan(at, 64);
    EXPECT_TRUE(std::ranges::any_of(part, [](std::byte each) { return each != std::byte{0}; }))
        << at;
  }
  fill_randomly({});
}

}  // namespace
}  // namespace gimnet
