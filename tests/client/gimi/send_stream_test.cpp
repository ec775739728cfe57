#include "client/gimi/send_stream.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <optional>
#include <thread>
#include <vector>

#include "gimnet/gimi.hpp"
#include "proto/frame/taken.hpp"
#include "tests/client/gimi/support/conversation.hpp"

// Streams as they are seen on the wire, by a hub that answers what the test wants.

namespace gimnet::gimi {
namespace {

using test::Conversation;
using test::Frame;
using test::kAll;
using test::kKey;
using test::kPeerId;
using test::MessageOperation;
using test::Taken;

using SendStreamTest = Conversation;

TEST_F(SendStreamTest, AsksForAnAckOnlyWhenSynchronized) {
  sender(0).send("free").or_throw();
  const Taken taken = next();
  EXPECT_EQ(taken.data, "free");
  EXPECT_EQ(taken.header.sequence, 1u);
  EXPECT_FALSE(taken.header.has(proto::gimi::kFlagAckWanted));
  SendOptions options;
  options.window = 1;
  options.key = {9, 9};
  node_->send(Peer{kPeerId}, "asked", options).or_throw();
  const Taken asked = next();
  EXPECT_TRUE(asked.header.has(proto::gimi::kFlagAckWanted));
  EXPECT_TRUE(asked.frame.has(proto::kFlagReport));
}

TEST_F(SendStreamTest, NeverHasMoreThanItsWindowUnderWay) {
  const Sender stream = sender(5);
  std::thread sending([&] {
    for (int i = 0; i < 50; ++i) stream.send("x").or_throw();
  });
  std::uint32_t acknowledged = 0;
  while (acknowledged < 50 && !HasFailure()) {
    const Taken taken = next();
    if (taken.header.operation != MessageOperation::data) continue;
    EXPECT_LE(taken.header.sequence, acknowledged + 5);
    if (taken.header.sequence == acknowledged + 5) acknowledge(acknowledged += 5);
  }
  sending.join();
  EXPECT_TRUE(stream.settle());
  EXPECT_EQ(stream.counts().acknowledged, 50u);
}

TEST_F(SendStreamTest, TheCallerChoosesWhatHappensAtAFullWindow) {
  const Sender waiting = sender(1);
  waiting.send("1").or_throw();
  EXPECT_TRUE(waiting.send("2", Timeout{1}).is(Status::timeout));
  EXPECT_EQ(waiting.counts().sent, 1u);
}

TEST_F(SendStreamTest, Skips) {
  const Sender stream = sender(1, AtFullWindow::skip);
  stream.send("1").or_throw();
  EXPECT_TRUE(stream.send("2").is(Status::window_full));
  EXPECT_EQ(next_data().data, "1");
  acknowledge(1);
  EXPECT_TRUE(stream.settle());
  stream.send("3").or_throw();
  EXPECT_EQ(next_data().header.sequence, 2u) << "what was skipped has no number";
  EXPECT_EQ(stream.counts().skipped, 1u);
}

TEST_F(SendStreamTest, HoldsOnlyTheLatest) {
  const Sender stream = sender(1, AtFullWindow::hold_latest);
  for (const char* text : {"1", "2", "3", "4"}) stream.send(text).or_throw();
  EXPECT_EQ(next_data().data, "1");
  acknowledge(1);
  Taken taken = next_data();
  EXPECT_EQ(taken.data, "4");
  EXPECT_EQ(taken.header.sequence, 2u);
  acknowledge(2);
  EXPECT_TRUE(stream.settle());
  EXPECT_EQ(stream.counts().skipped, 2u);
}

TEST_F(SendStreamTest, AsksForAMissingAckAndGivesUpWhatThePongDoesNotKnow) {
  const Sender stream = sender(3);
  stream.send("1").or_throw();
  stream.send("2").or_throw();
  next_data();
  next_data();
  const Taken ping = next();
  EXPECT_EQ(ping.header.operation, MessageOperation::ping);
  EXPECT_TRUE(ping.header.has(proto::gimi::kFlagAckWanted));
  const Taken again = next();
  EXPECT_EQ(again.header.sequence, ping.header.sequence) << "not answered: repeated";
  acknowledge(2, 0, ping.header.sequence);
  const auto settled = stream.settle();
  EXPECT_TRUE(settled.is(Status::not_delivered));
  EXPECT_EQ(stream.counts().acknowledged, 1u);
  EXPECT_EQ(stream.counts().lost, 1u);
}

TEST_F(SendStreamTest, AReportOfOneMessageFreesIt) {
  const Sender stream = sender(3);
  stream.send("1").or_throw();
  stream.send("2").or_throw();
  const auto first = hub_.next_message();
  ASSERT_TRUE(first);
  report(proto::DropReason::queue_full, 1, *first);
  next_data();
  acknowledge(2, 0);
  EXPECT_TRUE(stream.settle().is(Status::not_delivered));
  EXPECT_EQ(stream.counts().lost, 1u);
  EXPECT_NE(stream.counts().loss.find("queue_full"), std::string::npos);
  EXPECT_EQ(stream.counts().loss_reason, LossReason::queue_full);
}

TEST_F(SendStreamTest, AReportOfAFragmentFreesItsMessage) {
  const Sender stream = sender(3);
  for (const std::size_t size : {4'090u, 20'000u}) {  // whole with a fragment header, and in pieces
    stream.send(std::string(size, 'x')).or_throw();
    const auto lost = hub_.next_message();
    ASSERT_TRUE(lost);
    ASSERT_TRUE(lost->header.has(proto::kFlagFragment));
    report(proto::DropReason::timed_out, 1, *lost);
    EXPECT_TRUE(stream.settle(Timeout{20'000}).is(Status::not_delivered))
        << "and nobody asks for it";
    EXPECT_EQ(stream.counts().loss,
              "the hub reports timed_out: it took nothing for as long as the hub waits");
  }
  EXPECT_EQ(stream.counts().lost, 2u);
}

TEST_F(SendStreamTest, AReportThatNamesNoMessageIsTheReasonOfWhatTheReceiverMisses) {
  SendOptions options;
  options.key = kKey;
  options.window = 3;
  options.age_ms_max =
      60'000;  // stands before the fragment header in the bytes that a report repeats
  const Sender stream = node_->sender(Peer{kPeerId}, options).or_throw();
  stream.send(std::string(5'000, 'x')).or_throw();
  const auto lost = hub_.next_message();
  ASSERT_TRUE(lost);
  report(proto::DropReason::too_old, 1, *lost);
  report(proto::DropReason::cut_message, 1, *lost);
  const Taken ping = next();
  EXPECT_EQ(ping.header.operation, MessageOperation::ping);
  acknowledge(0, 0, ping.header.sequence);
  EXPECT_TRUE(stream.settle().is(Status::not_delivered));
  EXPECT_EQ(stream.counts().loss, "the hub reports too_old");
}

TEST_F(SendStreamTest, AReportOfAGoneRouteFreesEverythingThere) {
  const Sender stream = sender(3);
  stream.send("1").or_throw();
  stream.send("2").or_throw();
  const auto first = hub_.next_message();
  ASSERT_TRUE(first);
  report(proto::DropReason::no_such_node, 1, *first);
  EXPECT_TRUE(stream.settle().is(Status::not_delivered));
  EXPECT_EQ(stream.counts().lost, 2u);
}

// The receiver died: a hub does not know whether it took the first, and then nobody has that id.
TEST_F(SendStreamTest, AMessageThatMayHaveArrivedIsNotLostByTheNextReport) {
  const Sender stream = sender(3);
  stream.send("1").or_throw();
  stream.send("2").or_throw();
  const auto first = hub_.next_message();
  ASSERT_TRUE(first);
  report(proto::DropReason::link_unsure, 1, *first);
  report(proto::DropReason::no_such_node, 1, *first);
  EXPECT_TRUE(stream.settle().is(Status::not_delivered));
  EXPECT_EQ(stream.counts().lost, 2u);
  EXPECT_EQ(stream.counts().loss_reason, LossReason::link_unsure);
}

TEST_F(SendStreamTest, EndsAtALossWhereTheCallerWantsThat) {
  SendOptions options;
  options.key = kKey;
  options.window = 3;
  options.end_at_loss = true;
  const Sender stream = node_->sender(Peer{kPeerId}, options).or_throw();
  stream.send("1").or_throw();
  stream.send("2").or_throw();
  const auto first = next_data_frame();
  ASSERT_TRUE(first);
  EXPECT_EQ(next_data().data, "2");
  report(proto::DropReason::queue_full, 1, *first);
  acknowledge(2, 0);
  EXPECT_TRUE(stream.settle().is(Status::not_delivered));
  const auto refused = stream.send("3");
  EXPECT_TRUE(refused.is(Status::not_delivered));
  EXPECT_NE(refused.failure().sentence.find("queue_full"), std::string::npos)
      << refused.failure().sentence;
  EXPECT_EQ(stream.counts().sent, 2u) << "nothing more is sent";
  EXPECT_EQ(stream.counts().acknowledged, 1u);
}

TEST_F(SendStreamTest, ARefusalFreesTheMessageAndSaysWhy) {
  const Sender stream = sender(3);
  stream.send("1").or_throw();
  next_data();
  answer({1, MessageOperation::error, 0, 0},
         proto::gimi::encode_error({6, "it is \x1b too large"}));
  EXPECT_TRUE(stream.settle().is(Status::not_delivered));
  EXPECT_EQ(stream.counts().loss, "the receiver refused it: it is ? too large");
  EXPECT_EQ(stream.counts().loss_reason, LossReason::refused);
}

TEST_F(SendStreamTest, AnErrorOfAnotherKindFreesNothing) {
  const Sender stream = sender(3);
  stream.send("1").or_throw();
  next_data();
  answer({1, MessageOperation::error, 0, 0}, proto::gimi::encode_error({3, "what of it"}));
  answer({1, MessageOperation::error, 0, 0}, {});
  acknowledge(1);
  EXPECT_TRUE(stream.settle());
  EXPECT_EQ(stream.counts().lost, 0u);
}

TEST_F(SendStreamTest, AReportOfManyMakesItAskAtOnce) {
  const Sender stream = sender(3);
  stream.send("1").or_throw();
  stream.send("2").or_throw();
  next_data();
  const auto second = next_data_frame();
  ASSERT_TRUE(second);
  report(proto::DropReason::shard_full, 2, *second);
  const Taken ping = next();
  EXPECT_EQ(ping.header.operation, MessageOperation::ping);
  acknowledge(0, 0, ping.header.sequence);
  EXPECT_TRUE(stream.settle().is(Status::not_delivered));
  EXPECT_EQ(stream.counts().lost, 2u);
  EXPECT_EQ(stream.counts().loss, "the hub reports shard_full");
}

/// NIF asked on its own whether a receiver is still there, and the hub merged what it has to say of
/// that with the loss.
TEST_F(SendStreamTest, AReportThatNamesAnotherFrameMakesItAskAtOnce) {
  const Sender stream = sender(3);
  stream.send("1").or_throw();
  next_data();
  Frame question;
  question.bytes.resize(proto::kHeaderSize + proto::kTakenSize);
  question.header.kind = proto::Kind::taken;
  question.header.dst = kPeerId + 1;
  question.header.length = proto::kTakenSize;
  proto::store_header(question.bytes.data(), question.header);
  report(proto::DropReason::shard_full, 2, question);
  acknowledge(0, 0, next().header.sequence);
  EXPECT_TRUE(stream.settle().is(Status::not_delivered));
  EXPECT_EQ(stream.counts().loss, "the hub reports shard_full");
}

class SettledDoubt : public Conversation {
 protected:
  SettledDoubt() : stream_(sender(3)) {}

  /// Two messages, of which a report says that the second was lost, and something else.
  void lose_the_second() {
    stream_.send("1").or_throw();
    stream_.send("2").or_throw();
    first_ = next_data_frame();
    const auto second = next_data_frame();
    ASSERT_TRUE(first_ && second);
    report(proto::DropReason::shard_full, 2, *second);
    ping_ = next_ping();
  }
  /// The number of the next PING that is not that one again.
  std::uint32_t next_ping() {
    for (;;) {
      const Taken taken = next();
      if (HasFailure()) return 0;
      if (taken.header.operation == MessageOperation::ping && taken.header.sequence != ping_)
        return taken.header.sequence;
    }
  }
  /// The third one is lost, and nobody says why.
  void expect_no_reason() {
    acknowledge(1, 0, next_ping());
    EXPECT_TRUE(stream_.settle().is(Status::not_delivered));
    EXPECT_EQ(stream_.counts().loss,
              "the receiver answered a later question, but this did not arrive");
    EXPECT_EQ(stream_.counts().loss_reason, LossReason::not_received);
  }

  Sender stream_;
  std::uint32_t ping_ = 0;
  std::optional<nif::test::Frame> first_;
};

TEST_F(SettledDoubt, IsNoReasonAfterThePong) {
  lose_the_second();
  stream_.send("3").or_throw();  // the window is never empty
  acknowledge(1, 0, ping_);
  expect_no_reason();
}

TEST_F(SettledDoubt, IsNoReasonWhenNothingWaitsAnyMore) {
  lose_the_second();
  acknowledge(1, 0);
  EXPECT_TRUE(stream_.settle().is(Status::not_delivered));
  stream_.send("3").or_throw();
  expect_no_reason();
}

TEST_F(SettledDoubt, IsNoReasonWhenAReportTookTheLast) {
  lose_the_second();
  report(proto::DropReason::queue_full, 1, *first_);
  EXPECT_TRUE(stream_.settle().is(Status::not_delivered));
  EXPECT_EQ(stream_.counts().lost, 2u);
  stream_.send("3").or_throw();
  expect_no_reason();
}

TEST_F(SendStreamTest, ABrokenConnectionFreesEverything) {
  const Sender stream = sender(1);
  stream.send("1").or_throw();
  hub_.close();
  EXPECT_TRUE(stream.settle().is(Status::not_delivered));
  EXPECT_FALSE(stream.send("2"));
}

TEST_F(SendStreamTest, ClosingTheNodeEndsAllWaits) {
  const Sender stream = sender(1);
  stream.send("1").or_throw();
  std::thread sending([&] { EXPECT_TRUE(stream.send("2").is(Status::closed)); });
  std::thread settling([&] { EXPECT_FALSE(stream.settle()); });
  next_data();
  node_->close();
  sending.join();
  settling.join();
  EXPECT_FALSE(stream.send("3"));
}

TEST_F(SendStreamTest, AnswersPingsByItself) {
  answer({77, MessageOperation::ping, 0, 0}, std::as_bytes(std::span("time....echo", 12)));
  const Taken pong = next();
  EXPECT_EQ(pong.header.operation, MessageOperation::pong);
  EXPECT_EQ(pong.header.sequence, 77u);
  EXPECT_EQ(pong.data, "time....echo");
}

TEST_F(SendStreamTest, AcknowledgesWhatItTookAndAgainBeforeAPong) {
  const std::array<std::byte, 8> data{};
  answer({1, MessageOperation::data, proto::gimi::kFlagAckWanted, 0}, data);
  const Taken ack = next();
  EXPECT_EQ(ack.header.operation, MessageOperation::ack);
  EXPECT_EQ(ack.header.sequence, 1u);
  answer({5, MessageOperation::ping, proto::gimi::kFlagAckWanted, 0}, data);
  const Taken repeated = next();
  EXPECT_EQ(repeated.header.operation, MessageOperation::ack);
  const auto bytes = std::as_bytes(std::span(repeated.data.data(), repeated.data.size()));
  EXPECT_EQ(proto::gimi::decode_ack(bytes)->pong_sequence, 5u);
  EXPECT_EQ(next().header.operation, MessageOperation::pong);
}

TEST_F(SendStreamTest, RefusesWhatCannotBe) {
  EXPECT_TRUE(node_->sender(Peer{}).is(Status::bad_argument));
  SendOptions options;
  options.window = kWindowMax + 1;
  EXPECT_TRUE(node_->sender(Peer{kPeerId}, options).is(Status::bad_argument));
}

}  // namespace
}  // namespace gimnet::gimi
