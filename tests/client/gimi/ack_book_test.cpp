#include "client/gimi/ack_book.hpp"

#include <gtest/gtest.h>

namespace gimnet::gimi {
namespace {

constexpr StreamName kSender{Peer{1}, {2, 3}};
constexpr std::uint64_t kAll = ~std::uint64_t{0};

TEST(AckBook, KnowsNothingOfAStranger) {
  AckBook book;
  EXPECT_EQ(book.acknowledge(kSender).sequence, 0u);
  EXPECT_EQ(book.acknowledge(kSender).bitmap, 0u);
}

TEST(AckBook, IsDueOnceUntilItIsAcknowledged) {
  AckBook book;
  EXPECT_TRUE(book.take(kSender, 1));
  EXPECT_FALSE(book.take(kSender, 2));
  EXPECT_EQ(book.acknowledge(kSender).sequence, 2u);
  EXPECT_TRUE(book.take(kSender, 3));
}

TEST(AckBook, RemembersTheSixtyFourBeforeTheHighest) {
  AckBook book;
  for (std::uint32_t sequence = 1; sequence <= 65; ++sequence) book.take(kSender, sequence);
  EXPECT_EQ(book.acknowledge(kSender).bitmap, kAll);
  book.take(kSender, 67);
  EXPECT_EQ(book.acknowledge(kSender).sequence, 67u);
  EXPECT_EQ(book.acknowledge(kSender).bitmap, kAll << 1) << "66 did not come";
  book.take(kSender, 66);
  EXPECT_EQ(book.acknowledge(kSender).bitmap, kAll);
}

TEST(AckBook, ForgetsWhatIsFartherBack) {
  AckBook book;
  book.take(kSender, 1);
  book.take(kSender, 65);
  EXPECT_EQ(book.acknowledge(kSender).bitmap, std::uint64_t{1} << 63);
  book.take(kSender, 66);
  EXPECT_EQ(book.acknowledge(kSender).bitmap, 1u);
  book.take(kSender, 1000);
  EXPECT_EQ(book.acknowledge(kSender).bitmap, 0u);
}

TEST(AckBook, BeginsAgainWithASenderThatDoes) {
  AckBook book;
  for (std::uint32_t sequence = 1; sequence <= 5; ++sequence) book.take(kSender, sequence);
  book.take(kSender, 1);
  EXPECT_EQ(book.acknowledge(kSender).sequence, 1u);
  EXPECT_EQ(book.acknowledge(kSender).bitmap, 0u);
  book.take(kSender, 500);
  book.take(kSender, 400);
  EXPECT_EQ(book.acknowledge(kSender).sequence, 400u);
}

TEST(AckBook, CountsOnPastTheLargestNumber) {
  AckBook book;
  book.take(kSender, UINT32_MAX);
  book.take(kSender, 0);
  EXPECT_EQ(book.acknowledge(kSender).sequence, 0u);
  EXPECT_EQ(book.acknowledge(kSender).bitmap, 1u);
}

TEST(AckBook, KeepsStreamsApart) {
  AckBook book;
  book.take(kSender, 7);
  book.take({Peer{1}, {2, 4}}, 9);
  EXPECT_EQ(book.acknowledge(kSender).sequence, 7u);
}

TEST(AckBook, IsBounded) {
  AckBook book;
  for (std::uint32_t peer = 1; peer <= AckBook::kStreamsMax; ++peer) book.take({Peer{peer}, {}}, 1);
  EXPECT_EQ(book.size(), AckBook::kStreamsMax);
  book.take({Peer{AckBook::kStreamsMax + 1}, {}}, 1);
  EXPECT_EQ(book.size(), AckBook::kStreamsMax);
}

TEST(AckBook, WhoBeginsTooManyStreamsLosesItsOwn) {
  AckBook book;
  const StreamName last{Peer{9}, {2, 3}};
  book.take(kSender, 7);
  book.take(last, 8);
  for (std::uint32_t key = 0; key < 2 * AckBook::kStreamsMax; ++key)
    book.take({Peer{5}, {key, 0}}, 1);
  EXPECT_EQ(book.size(), AckBook::kStreamsMax);
  EXPECT_EQ(book.acknowledge(kSender).sequence, 7u);
  EXPECT_EQ(book.acknowledge(last).sequence, 8u);
}

}  // namespace
}  // namespace gimnet::gimi
