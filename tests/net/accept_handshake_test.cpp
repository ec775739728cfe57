#include "net/accept_handshake.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/net/support/link_frames.hpp"

namespace gimnet::net {
namespace {

using proto::GoodbyeCode;
using ::testing::HasSubstr;
using Verdict = AcceptHandshake::Verdict;

constexpr std::size_t kBytesMax = 1'024;

proto::Hello robot() {
  proto::Hello hello;
  hello.name = "robot";
  hello.epoch = 77;
  hello.resume = true;
  return hello;
}

Verdict feed(AcceptHandshake& handshake, std::span<const std::byte> bytes) {
  const std::span<std::byte> room = handshake.room();
  EXPECT_LE(bytes.size(), room.size());
  std::copy(bytes.begin(), bytes.end(), room.begin());
  return handshake.took(bytes.size());
}

Verdict feed(AcceptHandshake& handshake, std::string_view text) {
  return feed(handshake, std::as_bytes(std::span{text}));
}

TEST(AcceptHandshake, ReadsAHelloInOnePiece) {
  AcceptHandshake handshake(kBytesMax);
  EXPECT_EQ(feed(handshake, opening_and(robot())), Verdict::hello);
  EXPECT_EQ(handshake.hello(), robot());
}

TEST(AcceptHandshake, ReadsAHelloByteByByte) {
  AcceptHandshake handshake(kBytesMax);
  const std::vector<std::byte> bytes = opening_and(robot());
  for (std::size_t i = 0; i + 1 < bytes.size(); ++i) {
    ASSERT_EQ(feed(handshake, std::span{bytes}.subspan(i, 1)), Verdict::more) << "byte " << i;
  }
  EXPECT_EQ(feed(handshake, std::span{bytes}.last(1)), Verdict::hello);
  EXPECT_EQ(handshake.hello(), robot());
}

TEST(AcceptHandshake, TheFirstImpossibleByteEndsIt) {
  const std::vector<std::byte> bytes = opening_and(robot());
  // The opening, and all of the header but length and lane, can only be what they are; the minor
  // version may differ.
  for (std::size_t i = 0; i < proto::kOpeningSize + proto::kHeaderSize; ++i) {
    const std::size_t in_header = i - proto::kOpeningSize;
    if (i == 7 || (i >= 8 && in_header < 4)) continue;
    std::vector<std::byte> wrong(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(i) + 1);
    wrong[i] ^= std::byte{0x80};
    AcceptHandshake handshake(kBytesMax);
    const Verdict verdict = feed(handshake, wrong);
    EXPECT_EQ(verdict, i < 6 ? Verdict::garbage : Verdict::refused) << "byte " << i;
  }
}

TEST(AcceptHandshake, OtherProtocolsAreGarbage) {
  for (const std::string_view text :
       {"GET / HTTP/1.1\r\n\r\n", "GET", "\x16\x03\x01", "gimnet", "GIMneT"}) {
    AcceptHandshake handshake(kBytesMax);
    EXPECT_EQ(feed(handshake, text), Verdict::garbage);
  }
}

TEST(AcceptHandshake, AnotherMajorVersionIsRefusedAndAnotherMinorIsNot) {
  AcceptHandshake major(kBytesMax);
  EXPECT_EQ(feed(major, std::string_view{"GIMnet\2\0", 8}), Verdict::refused);
  EXPECT_EQ(major.refusal().code, GoodbyeCode::bad_version);
  EXPECT_THAT(major.refusal().sentence, HasSubstr("version 1"));
  std::vector<std::byte> bytes = opening_and(robot());
  bytes[7] = std::byte{9};
  AcceptHandshake minor(kBytesMax);
  EXPECT_EQ(feed(minor, bytes), Verdict::hello);
}

TEST(AcceptHandshake, FillsTheAllowedSizeAndNotOneByteMore) {
  const std::size_t most = kBytesMax - proto::kOpeningSize - proto::kHeaderSize;
  for (const std::size_t length : {most, most + 1}) {
    std::vector<std::byte> bytes(proto::kOpening.begin(), proto::kOpening.end());
    const std::vector<std::byte> frame = link_frame(std::vector<std::byte>(length));
    bytes.insert(bytes.end(), frame.begin(), frame.begin() + proto::kHeaderSize);
    AcceptHandshake handshake(kBytesMax);
    EXPECT_EQ(feed(handshake, bytes), length == most ? Verdict::more : Verdict::refused);
    if (length != most) {
      EXPECT_EQ(handshake.refusal().code, GoodbyeCode::malformed);
    }
    if (length == most) {
      EXPECT_EQ(handshake.room().size(), most);
    }
  }
}

TEST(AcceptHandshake, HugeLengthsAreRefused) {
  AcceptHandshake handshake(kBytesMax);
  EXPECT_EQ(feed(handshake, std::string_view{"GIMnet\1\0\xff\xff\xff\xff", 12}), Verdict::refused);
}

TEST(AcceptHandshake, NothingMayFollowHello) {
  std::vector<std::byte> bytes = opening_and(robot());
  bytes.push_back(std::byte{0});
  AcceptHandshake handshake(kBytesMax);
  EXPECT_EQ(feed(handshake, bytes), Verdict::refused);
  EXPECT_EQ(handshake.refusal().code, GoodbyeCode::malformed);
  EXPECT_THAT(handshake.refusal().sentence, HasSubstr("before WELCOME"));
}

TEST(AcceptHandshake, WhatIsNoHelloIsRefused) {
  for (const std::vector<std::byte>& payload :
       {std::vector<std::byte>{}, std::vector<std::byte>(3), proto::encode(proto::Goodbye{}),
        std::vector<std::byte>{std::byte{1}, std::byte{0}, std::byte{0}, std::byte{0},
                               std::byte{0xff}}}) {
    std::vector<std::byte> bytes(proto::kOpening.begin(), proto::kOpening.end());
    const std::vector<std::byte> frame = link_frame(payload);
    bytes.insert(bytes.end(), frame.begin(), frame.end());
    AcceptHandshake handshake(kBytesMax);
    EXPECT_EQ(feed(handshake, bytes), Verdict::refused);
    EXPECT_EQ(handshake.refusal().code, GoodbyeCode::malformed);
  }
}

TEST(AcceptHandshake, ReservedLaneBitsAreRefused) {
  std::vector<std::byte> bytes = opening_and(robot());
  bytes[proto::kOpeningSize + 15] = std::byte{4};
  AcceptHandshake handshake(kBytesMax);
  EXPECT_EQ(feed(handshake, bytes), Verdict::refused);
}

/// Every sequence of up to five of the things that a peer may say first: one of them alone is a
/// HELLO.
TEST(AcceptHandshake, OnlyTheOpeningAndThenHelloComeToAnEnd) {
  using Bytes = std::vector<std::byte>;
  const Bytes hello = link_frame(proto::encode(robot()));
  const Bytes opening(proto::kOpening.begin(), proto::kOpening.end());
  Bytes request = link_frame(proto::encode(proto::Goodbye{}));
  request[12] = static_cast<std::byte>(proto::Kind::ns);
  const std::vector<Bytes> words{opening, hello, link_frame(proto::encode(proto::Goodbye{})),
                                 request, link_frame(proto::encode(proto::Welcome{}))};
  constexpr std::size_t kLength = 5;
  std::size_t sequences = 0;
  for (std::size_t number = 0; number < 5 * 5 * 5 * 5 * 5; ++number) {
    AcceptHandshake handshake(kBytesMax);
    Verdict verdict = Verdict::more;
    std::vector<std::size_t> said;
    for (std::size_t i = 0, rest = number; i < kLength && verdict == Verdict::more;
         ++i, rest /= words.size()) {
      said.push_back(rest % words.size());
      verdict = feed(handshake, words[said.back()]);
      ++sequences;
    }
    const bool legal = said == std::vector<std::size_t>{0, 1};
    EXPECT_EQ(verdict == Verdict::hello, legal) << number;
    EXPECT_NE(verdict, Verdict::more) << number;
  }
  EXPECT_GT(sequences, 5u * 5 * 5 * 5 * 5);
}

}  // namespace
}  // namespace gimnet::net
