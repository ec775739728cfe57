#include "base/endian.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <cstdint>

namespace gimnet {
namespace {

TEST(Endian, StoresTheLowestByteFirst) {
  std::array<std::byte, 5> bytes{};
  store_le(bytes.data() + 1, std::uint32_t{0x04030201});
  for (std::size_t i = 0; i < bytes.size(); ++i) EXPECT_EQ(bytes[i], static_cast<std::byte>(i));
}

TEST(Endian, LoadsAtAnyAlignment) {
  std::array<std::byte, 17> bytes{};
  for (std::size_t at = 0; at < 9; ++at) {
    store_le(bytes.data() + at, std::int64_t{-5});
    EXPECT_EQ(load_le<std::int64_t>(bytes.data() + at), -5);
  }
}

}  // namespace
}  // namespace gimnet
