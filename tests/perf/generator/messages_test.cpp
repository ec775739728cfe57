#include "generator/messages.hpp"

#include <gtest/gtest.h>

#include <vector>

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
  return load_le<std::uint64_t>(block.bytes.data() + index * kMessageBytes + kStampAt);
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
  EXPECT_EQ(load_le<std::uint32_t>(block.bytes.data()), 1u);
  EXPECT_EQ(load_le<std::uint32_t>(block.bytes.data() + kMessageBytes), 2u);
  block.renew();
  EXPECT_EQ(load_le<std::uint32_t>(block.bytes.data()), 3u);
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

constexpr StreamId kStream = 3;
constexpr std::size_t kBytes = 64;
constexpr std::uint32_t kNumber = 9;

std::vector<std::byte> message(std::uint64_t sequence, StreamId stream = kStream,
                               std::size_t size = kBytes) {
  const auto pattern = pattern_payload(size);
  std::vector<std::byte> payload(pattern.begin(), pattern.end());
  store_le(payload.data(), make_stamp(stream, sequence));
  return payload;
}

Inbox inbox_for(std::size_t size) {
  Inbox inbox;
  inbox.expect(kStream, size);
  return inbox;
}

TEST(Inbox, CountsWhatArrivesInOrder) {
  for (const std::size_t size : {std::size_t{16}, std::size_t{17}, kBytes, std::size_t{65536}}) {
    Inbox inbox = inbox_for(size);
    for (std::uint64_t sequence = 0; sequence < 3; ++sequence)
      inbox.on_message(message(sequence, kStream, size));
    EXPECT_EQ(inbox.delivered(), 3u);
    EXPECT_EQ(inbox.lost(), 0u);
    EXPECT_EQ(inbox.wrong(), 0u);
  }
}

TEST(Inbox, CountsAGapAsLost) {
  Inbox inbox = inbox_for(kBytes);
  inbox.on_message(message(0));
  inbox.on_message(message(5));
  EXPECT_EQ(inbox.delivered(), 2u);
  EXPECT_EQ(inbox.lost(), 4u);
  EXPECT_EQ(inbox.settled(), 6u);
  EXPECT_EQ(inbox.wrong(), 0u);
}

TEST(Inbox, SeesRepeatedAndForeignMessages) {
  Inbox inbox = inbox_for(kBytes);
  inbox.on_message(message(0));
  inbox.on_message(message(0));
  inbox.on_message(message(1, kStream + 1));
  EXPECT_EQ(inbox.delivered(), 1u);
  EXPECT_EQ(inbox.wrong(), 2u);
}

TEST(Inbox, SeesEveryChangedByte) {
  for (std::size_t at = kStampBytes; at < kBytes; ++at) {
    Inbox inbox = inbox_for(kBytes);
    auto changed = message(0);
    changed[at] ^= std::byte{1};
    inbox.on_message(changed);
    EXPECT_EQ(inbox.wrong(), 1u) << "byte " << at;
  }
}

TEST(Inbox, SeesAnotherSize) {
  Inbox inbox = inbox_for(kBytes);
  inbox.on_message(message(0, kStream, kBytes - 1));
  inbox.on_message(message(0, kStream, kBytes + 1));
  EXPECT_EQ(inbox.wrong(), 2u);
}

TEST(Inbox, PutsPiecesTogether) {
  Inbox inbox = inbox_for(kBytes);
  const auto whole = message(0);
  const std::span<const std::byte> bytes(whole);
  inbox.on_piece(kNumber, 0, kBytes, bytes.first(20));
  EXPECT_EQ(inbox.delivered(), 0u);
  inbox.on_piece(kNumber, 20, kBytes, bytes.subspan(20));
  EXPECT_EQ(inbox.delivered(), 1u);
  EXPECT_EQ(inbox.wrong(), 0u);
}

TEST(Inbox, SeesAMissingARepeatedAndAChangedPiece) {
  const auto whole = message(0);
  const std::span<const std::byte> bytes(whole);
  Inbox missing = inbox_for(kBytes);
  missing.on_piece(kNumber, 0, kBytes, bytes.first(20));
  missing.on_piece(kNumber, 40, kBytes, bytes.subspan(40));
  EXPECT_EQ(missing.wrong(), 1u);
  EXPECT_EQ(missing.delivered(), 0u);

  Inbox repeated = inbox_for(kBytes);
  repeated.on_piece(kNumber, 0, kBytes, bytes.first(20));
  repeated.on_piece(kNumber, 20, kBytes, bytes.subspan(20, 20));
  repeated.on_piece(kNumber, 20, kBytes, bytes.subspan(20, 20));
  EXPECT_EQ(repeated.wrong(), 1u);

  Inbox changed = inbox_for(kBytes);
  auto other = whole;
  other[50] ^= std::byte{1};
  changed.on_piece(kNumber, 0, kBytes, bytes.first(20));
  changed.on_piece(kNumber, 20, kBytes, std::span<const std::byte>(other).subspan(20));
  EXPECT_EQ(changed.wrong(), 1u);
  EXPECT_EQ(changed.delivered(), 0u);
}

TEST(Inbox, SeesAPieceOfAnotherMessageWithTheSameBytes) {
  Inbox inbox = inbox_for(kBytes);
  const auto whole = message(0);
  const std::span<const std::byte> bytes(whole);
  inbox.on_piece(kNumber, 0, kBytes, bytes.first(20));
  inbox.on_piece(kNumber + 1, 20, kBytes, bytes.subspan(20));
  EXPECT_EQ(inbox.wrong(), 1u);
  EXPECT_EQ(inbox.delivered(), 0u);
}

TEST(Inbox, SeesPiecesThatLieAboutTheTotal) {
  Inbox inbox = inbox_for(kBytes);
  const auto whole = message(0);
  inbox.on_piece(kNumber, 0, kBytes - 1, whole);
  inbox.on_piece(kNumber, 0, kBytes + 1, whole);
  EXPECT_EQ(inbox.wrong(), 2u);
}

}  // namespace
}  // namespace gimnet::perf
