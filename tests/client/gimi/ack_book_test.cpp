#include "client/gimi/ack_book.hpp"

#include <gtest/gtest.h>

namespace gimnet::gimi {
namespace {

constexpr StreamName kSender{Peer{1}, {2, 3}};
constexpr std::uint64_t kAll = ~std::uint64_t{0};

proto::gimi::MessageHeader data(std::uint32_t sequence, std::uint32_t epoch = 1) {
  return {sequence, proto::gimi::Operation::data, 0, 0, epoch};
}

TEST(AckBook, KnowsNothingOfAStranger) {
  AckBook book;
  EXPECT_EQ(book.acknowledge(kSender).sequence, 0u);
  EXPECT_EQ(book.acknowledge(kSender).bitmap, 0u);
}

TEST(AckBook, IsDueOnceUntilItIsAcknowledged) {
  AckBook book;
  EXPECT_TRUE(book.take(kSender, data(1)));
  EXPECT_FALSE(book.take(kSender, data(2)));
  EXPECT_EQ(book.acknowledge(kSender).sequence, 2u);
  EXPECT_TRUE(book.take(kSender, data(3)));
}

TEST(AckBook, RemembersTheSixtyFourBeforeTheHighest) {
  AckBook book;
  for (std::uint32_t sequence = 1; sequence <= 65; ++sequence) book.take(kSender, data(sequence));
  EXPECT_EQ(book.acknowledge(kSender).bitmap, kAll);
  book.take(kSender, data(67));
  EXPECT_EQ(book.acknowledge(kSender).sequence, 67u);
  EXPECT_EQ(book.acknowledge(kSender).bitmap, kAll << 1) << "66 did not come";
  book.take(kSender, data(66));
  EXPECT_EQ(book.acknowledge(kSender).bitmap, kAll);
}

TEST(AckBook, ForgetsWhatIsFartherBack) {
  AckBook book;
  book.take(kSender, data(1));
  book.take(kSender, data(65));
  EXPECT_EQ(book.acknowledge(kSender).bitmap, std::uint64_t{1} << 63);
  book.take(kSender, data(66));
  EXPECT_EQ(book.acknowledge(kSender).bitmap, 1u);
  book.take(kSender, data(1000));
  EXPECT_EQ(book.acknowledge(kSender).bitmap, 0u);
}

TEST(AckBook, BeginsAgainWithAnotherEpoch) {
  AckBook book;
  for (std::uint32_t sequence = 1; sequence <= 5; ++sequence) book.take(kSender, data(sequence));
  book.take(kSender, data(3, 2));
  const AckBook::Entry taken = book.acknowledge(kSender);
  EXPECT_EQ(taken.epoch, 2u);
  EXPECT_EQ(taken.sequence, 3u);
  EXPECT_EQ(taken.bitmap, 0u);
}

TEST(AckBook, AnOldSequenceOfTheSameEpochChangesNothing) {
  AckBook book;
  book.take(kSender, data(500));
  book.take(kSender, data(400));
  EXPECT_EQ(book.acknowledge(kSender).sequence, 500u);
  EXPECT_EQ(book.acknowledge(kSender).bitmap, 0u);
}

TEST(AckBook, CountsOnPastTheLargestNumber) {
  AckBook book;
  book.take(kSender, data(UINT32_MAX));
  book.take(kSender, data(0));
  EXPECT_EQ(book.acknowledge(kSender).sequence, 0u);
  EXPECT_EQ(book.acknowledge(kSender).bitmap, 1u);
}

TEST(AckBook, KeepsStreamsApart) {
  AckBook book;
  book.take(kSender, data(7));
  book.take({Peer{1}, {2, 4}}, data(9));
  EXPECT_EQ(book.acknowledge(kSender).sequence, 7u);
}

TEST(AckBook, HoldsWhatCouldNotBeSent) {
  AckBook book;
  EXPECT_TRUE(book.take(kSender, data(7)));
  EXPECT_EQ(book.acknowledge(kSender).sequence, 7u);
  EXPECT_FALSE(book.hold(kSender));
  EXPECT_FALSE(book.take(kSender, data(8))) << "it is due already";
  EXPECT_EQ(book.acknowledge(kSender).sequence, 8u);
  EXPECT_TRUE(book.take(kSender, data(9)));
  EXPECT_TRUE(book.hold(kSender)) << "it became due anew meanwhile";
}

TEST(AckBook, IsBounded) {
  AckBook book;
  for (std::uint32_t peer = 1; peer <= AckBook::kStreamsMax; ++peer)
    book.take({Peer{peer}, {}}, data(1));
  EXPECT_EQ(book.size(), AckBook::kStreamsMax);
  book.take({Peer{AckBook::kStreamsMax + 1}, {}}, data(1));
  EXPECT_EQ(book.size(), AckBook::kStreamsMax);
}

TEST(AckBook, WhoBeginsTooManyStreamsLosesItsOwn) {
  AckBook book;
  const StreamName last{Peer{9}, {2, 3}};
  book.take(kSender, data(7));
  book.take(last, data(8));
  for (std::uint32_t key = 0; key < 2 * AckBook::kStreamsMax; ++key)
    book.take({Peer{5}, {key, 0}}, data(1));
  EXPECT_EQ(book.size(), AckBook::kStreamsMax);
  EXPECT_EQ(book.acknowledge(kSender).sequence, 7u);
  EXPECT_EQ(book.acknowledge(last).sequence, 8u);
}

}  // namespace
}  // namespace gimnet::gimi
