#include "hub/crypto/hmac.hpp"

#include <gtest/gtest.h>

#include <string>
#include <string_view>

namespace gimnet::hub {
namespace {

std::span<const std::byte> bytes_of(std::string_view text) {
  return std::as_bytes(std::span{text});
}

std::string hex(const Digest& digest) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string text;
  for (const std::byte byte : digest) {
    text += kDigits[static_cast<std::size_t>(byte) >> 4];
    text += kDigits[static_cast<std::size_t>(byte) & 15];
  }
  return text;
}

// FIPS 180-4, example of one block.
TEST(Hmac, Sha256IsThatOfTheStandard) {
  EXPECT_EQ(hex(sha256(bytes_of("abc"))),
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(hex(sha256({})), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
}

// RFC 4231, test case 1; its key of 20 bytes is the same as one filled up with zeros.
TEST(Hmac, HmacIsThatOfTheStandard) {
  Secret key{};
  for (std::size_t i = 0; i < 20; ++i) key[i] = std::byte{0x0b};
  EXPECT_EQ(hex(hmac_sha256(key, bytes_of("Hi There"))),
            "b0344c61d8db38535ca8afceaf0bf12b881dc200c9833da726e9376c2e32cff7");
}

TEST(Hmac, ComparesEveryByteAndTheSize) {
  const Digest a = sha256(bytes_of("a"));
  for (std::size_t i = 0; i < a.size(); ++i) {
    Digest b = a;
    b[i] ^= std::byte{0x80};
    EXPECT_FALSE(same_bytes(a, b)) << i;
  }
  EXPECT_TRUE(same_bytes(a, a));
  EXPECT_FALSE(same_bytes(a, std::span{a}.first(31)));
  EXPECT_FALSE(same_bytes(a, {}));
}

}  // namespace
}  // namespace gimnet::hub
