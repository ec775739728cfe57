#include "client/gimi/clerk.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstddef>

#include "tests/client/gimi/support/conversation.hpp"

namespace gimnet::gimi {
namespace {

using test::Conversation;
using test::kOwnId;
using test::kPeerId;
using test::MessageOperation;
using test::Taken;

class ClerkTest : public Conversation {
 protected:
  static constexpr std::uint32_t kSlow = kPeerId + 1;

  void pause(std::uint32_t node) {
    for (std::uint8_t lane = 0; lane < proto::kLaneCount; ++lane) {
      hub_.send(proto::flow::Pause{{proto::Kind::unicast, static_cast<proto::Lane>(lane), node}});
    }
  }

  void resume(std::uint32_t node) {
    for (std::uint8_t lane = 0; lane < proto::kLaneCount; ++lane) {
      hub_.send(proto::flow::Resume{{proto::Kind::unicast, static_cast<proto::Lane>(lane), node}});
    }
  }

  /// A DATA that asks for an ACK.
  void send_data(std::uint32_t from) {
    std::array<std::byte, proto::gimi::kMessagePrefixMax> prefix;
    const proto::gimi::MessageHeader header{1, MessageOperation::data, proto::gimi::kFlagAckWanted,
                                            0};
    const std::size_t size = proto::gimi::write_message_prefix(header, std::nullopt, prefix);
    proto::FrameParts parts;
    parts.header.kind = proto::Kind::unicast;
    parts.header.dst = kOwnId;
    parts.header.src = from;
    parts.key = proto::gimi::StreamKey{test::kKey.type, test::kKey.instance}.value();
    hub_.send(parts, {reinterpret_cast<const char*>(prefix.data()), size});
  }
};

TEST_F(ClerkTest, LooksAfterStreamsWhileAnAckWaitsForItsWay) {
  const Sender stream = sender(3);
  pause(kSlow);
  send_data(kSlow);
  send_data(kPeerId);
  const Taken ack = next();
  ASSERT_EQ(ack.header.operation, MessageOperation::ack);
  ASSERT_EQ(ack.frame.dst, kPeerId) << "the ACK for the other one was tried before";
  stream.send("is not acknowledged").or_throw();
  EXPECT_EQ(next().header.operation, MessageOperation::data);
  EXPECT_EQ(next().header.operation, MessageOperation::ping) << "asks for the ACK";
}

TEST_F(ClerkTest, AnAckThatWaitsForItsWayIsOne) {
  pause(kSlow);
  for (int i = 0; i < 5; ++i) {
    send_data(kSlow);
    send_data(kPeerId);
    ASSERT_EQ(next().frame.dst, kPeerId) << "the ACK for the other one was tried before";
  }
  resume(kSlow);
  EXPECT_EQ(next().frame.dst, kSlow);
  send_data(kPeerId);
  EXPECT_EQ(next().frame.dst, kPeerId);
}

}  // namespace

namespace {

constexpr StreamName kSender{Peer{1}, {2, 3}};
constexpr std::uint64_t kAll = ~std::uint64_t{0};

proto::gimi::MessageHeader data(std::uint32_t sequence, std::uint32_t epoch = 1) {
  return {sequence, proto::gimi::MessageOperation::data, 0, 0, epoch};
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
  book.hold(kSender);
  EXPECT_FALSE(book.take(kSender, data(8))) << "it is due already";
  EXPECT_EQ(book.acknowledge(kSender).sequence, 8u);
  EXPECT_TRUE(book.take(kSender, data(9)));
  book.hold({Peer{9}, {2, 3}});
  EXPECT_EQ(book.size(), 1u) << "what it does not know it cannot hold";
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
