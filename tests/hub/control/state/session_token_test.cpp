#include "hub/control/state/session_token.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "proto/control/link.hpp"

namespace gimnet::hub {
namespace {

using namespace std::chrono_literals;

constexpr TokenHolder kHolder{HubId{7}, "robot1/base", Identity::of_user(1000)};

Secret secret_of(int value) {
  Secret secret{};
  secret.fill(static_cast<std::byte>(value));
  return secret;
}

TEST(SessionToken, SaysWhatWasWritten) {
  const SessionToken token{NodeIndex{17}, first_number(3) + 5, 1'700'000'000'000ms};
  const std::vector<std::byte> bytes = write_token(token, kHolder, secret_of(1));
  EXPECT_EQ(bytes.size(), kSessionTokenBytes);
  EXPECT_LE(bytes.size(), proto::kTokenBytesMax);
  EXPECT_EQ(read_token(bytes), token);
  EXPECT_TRUE(is_genuine(bytes, kHolder, secret_of(1)));
}

// By another implementation, from what docs/protocol.md says: a hub that wrote other bytes after an
// update would know none of its nodes again.
TEST(SessionToken, IsWhatTheDocumentSays) {
  constexpr std::uint8_t kDue[] = {
      0x01, 0x00, 0x00, 0x00, 0x11, 0x00, 0x00, 0x00, 0x05, 0x00, 0x00, 0x00, 0x00, 0x03,
      0x00, 0x00, 0x00, 0x68, 0xe5, 0xcf, 0x8b, 0x01, 0x00, 0x00, 0x71, 0xcf, 0x1d, 0x36,
      0x4f, 0x34, 0xa3, 0xad, 0x31, 0xee, 0x7e, 0x01, 0xf0, 0xa3, 0xd0, 0xa2, 0x1f, 0x85,
      0x11, 0xa8, 0x90, 0xc5, 0x80, 0xa5, 0xed, 0x1d, 0xa9, 0xd6, 0x71, 0x39, 0xa3, 0x71};
  const SessionToken said{NodeIndex{17}, first_number(3) + 5, 1'700'000'000'000ms};
  std::vector<std::uint8_t> token;
  for (const std::byte each : write_token(said, kHolder, secret_of(1)))
    token.push_back(std::to_integer<std::uint8_t>(each));
  EXPECT_THAT(token, ::testing::ElementsAreArray(kDue));
}

TEST(SessionToken, OneBitChangedIsNotGenuine) {
  const std::vector<std::byte> token = write_token({NodeIndex{17}, 5, 1s}, kHolder, secret_of(1));
  for (std::size_t bit = 0; bit < token.size() * 8; ++bit) {
    std::vector<std::byte> forged = token;
    forged[bit / 8] ^= static_cast<std::byte>(1u << (bit % 8));
    EXPECT_FALSE(is_genuine(forged, kHolder, secret_of(1))) << "bit " << bit;
  }
}

TEST(SessionToken, IsForItsHolderAndItsHubOnly) {
  const std::vector<std::byte> token = write_token({NodeIndex{17}, 5, 1s}, kHolder, secret_of(1));
  EXPECT_FALSE(is_genuine(token, kHolder, secret_of(2)));
  EXPECT_FALSE(is_genuine(token, {HubId{8}, "robot1/base", Identity::of_user(1000)}, secret_of(1)));
  EXPECT_FALSE(is_genuine(token, {HubId{7}, "robot1", Identity::of_user(1000)}, secret_of(1)));
  EXPECT_FALSE(is_genuine(token, {HubId{7}, "robot1/base", Identity::of_user(100)}, secret_of(1)));
  EXPECT_FALSE(is_genuine(token, {HubId{7}, "robot1/base", Identity::open()}, secret_of(1)));
}

TEST(SessionToken, OtherLengthsAndVersionsAreNone) {
  std::vector<std::byte> token = write_token({NodeIndex{17}, 5, 1s}, kHolder, secret_of(1));
  EXPECT_FALSE(read_token(std::span{token}.first(token.size() - 1)));
  EXPECT_FALSE(is_genuine(std::span{token}.first(token.size() - 1), kHolder, secret_of(1)));
  token.push_back(std::byte{});
  EXPECT_FALSE(read_token(token));
  EXPECT_FALSE(is_genuine(token, kHolder, secret_of(1)));
  token.pop_back();
  token[0] = std::byte{2};
  EXPECT_FALSE(read_token(token));
  EXPECT_FALSE(read_token({}));
}

TEST(SessionToken, NumbersOfALaterStartAreHigher) {
  EXPECT_GT(first_number(2), first_number(1) + 1'000'000'000);
  EXPECT_GT(first_number(kBootMax), first_number(kBootMax - 1));
}

}  // namespace
}  // namespace gimnet::hub
