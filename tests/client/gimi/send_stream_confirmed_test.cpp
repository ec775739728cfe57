#include <gtest/gtest.h>

#include <algorithm>
#include <future>
#include <map>
#include <string>
#include <vector>

#include "client/gimi/send_stream.hpp"
#include "tests/client/gimi/support/conversation.hpp"

// Messages to be confirmed, each by itself, among others of their stream.

namespace gimnet::gimi {
namespace {

using test::Conversation;
using test::Frame;
using test::kAll;
using test::MessageOperation;
using test::Taken;

class ConfirmedSend : public Conversation {
 protected:
  using Fate = std::future<Outcome<void>>;

  [[nodiscard]] static Fate confirm(const Sender& stream, std::string text,
                                    Timeout timeout = kForever) {
    return std::async(std::launch::async, [&stream, text = std::move(text), timeout] {
      return stream.send_confirmed(text, timeout);
    });
  }
  static void expect_lost(Fate fate, const std::string& why) {
    const auto lost = fate.get();
    EXPECT_TRUE(lost.is(Status::not_delivered));
    EXPECT_NE(lost.failure().sentence.find(why), std::string::npos) << lost.failure().sentence;
  }
  std::uint32_t streams_ = 0;

  std::uint32_t next_ping() {
    for (;;) {
      const Taken taken = next();
      if (HasFailure() || taken.header.operation == MessageOperation::ping)
        return taken.header.sequence;
    }
  }
};

TEST_F(ConfirmedSend, HasItsPlaceAmongTheOthersOfItsStream) {
  const Sender stream = sender(0);
  stream.send("1").or_throw();
  const Taken before = next();
  Fate fate = confirm(stream, "2");
  const Taken asked = next_data();
  EXPECT_EQ(asked.data, "2");
  EXPECT_EQ(asked.header.sequence, 2u);
  EXPECT_EQ(asked.header.epoch, before.header.epoch) << "not a stream of its own";
  EXPECT_TRUE(asked.header.has(proto::gimi::kFlagAckWanted));
  EXPECT_TRUE(asked.frame.has(proto::kFlagReport));
  stream.send("3").or_throw();
  const Taken after = next_data();
  EXPECT_EQ(after.header.sequence, 3u);
  EXPECT_FALSE(after.header.has(proto::gimi::kFlagAckWanted));
  EXPECT_FALSE(after.frame.has(proto::kFlagReport));
  acknowledge(2, 0);
  EXPECT_TRUE(fate.get());
  EXPECT_EQ(stream.counts().sent, 3u);
  EXPECT_EQ(stream.counts().acknowledged, 1u);
}

TEST_F(ConfirmedSend, TellsEachThreadOfItsOwnMessage) {
  const Sender stream = sender(0);
  std::map<std::string, Fate> fates;
  for (int i = 0; i < 30; ++i) fates[std::to_string(i)] = confirm(stream, std::to_string(i));
  std::map<std::string, std::uint32_t> acknowledged;
  std::map<std::string, std::string> lost;
  for (int i = 0; i < 30; ++i) {
    const auto frame = next_data_frame();
    ASSERT_TRUE(frame);
    const Taken taken = taken_of(*frame);
    const auto reason = i % 3 == 1 ? proto::DropReason::queue_full : proto::DropReason::over_budget;
    if (i % 3 == 0) {
      acknowledged[taken.data] = taken.header.sequence;
    } else {
      report(reason, 1, *frame);
      lost[taken.data] = i % 3 == 1 ? "queue_full" : "over_budget";
    }
  }
  for (const auto& [text, sequence] : acknowledged) acknowledge(sequence, 0);
  for (const auto& [text, sequence] : acknowledged) EXPECT_TRUE(fates[text].get()) << text;
  for (const auto& [text, why] : lost) expect_lost(std::move(fates[text]), why);
  EXPECT_EQ(stream.counts().acknowledged, 10u);
  EXPECT_EQ(stream.counts().lost, 20u);
}

TEST_F(ConfirmedSend, SaysAfterItsTimeThatTheMessageMayStillArrive) {
  const Sender stream = sender(0);
  const auto late = stream.send_confirmed("1", Timeout{1});
  EXPECT_TRUE(late.is(Status::timeout));
  EXPECT_NE(late.failure().sentence.find("may still arrive"), std::string::npos)
      << late.failure().sentence;
  EXPECT_EQ(next_data().data, "1");
  Fate fate = confirm(stream, "2");
  EXPECT_EQ(next_data().data, "2") << "the first one was sent once";
  acknowledge(1, 0);
  acknowledge(2, 0);
  EXPECT_TRUE(fate.get());
  EXPECT_EQ(stream.counts().acknowledged, 2u);
}

TEST_F(ConfirmedSend, LearnsByAQuestionThatTheReceiverDoesNotHaveIt) {
  const Sender stream = sender(0);
  Fate fate = confirm(stream, "1");
  next_data();
  acknowledge(0, 0, next_ping());
  expect_lost(std::move(fate), "this did not arrive");
}

TEST_F(ConfirmedSend, LearnsThatTheReceiverRefusedIt) {
  const Sender stream = sender(0);
  Fate fate = confirm(stream, "1");
  next_data();
  answer({1, MessageOperation::error, 0, 0}, proto::gimi::encode_error({6, "it is too large"}));
  expect_lost(std::move(fate), "the receiver refused it: it is too large");
}

// An ACK speaks of 65 messages: one that is further back could be taken for lost.
TEST_F(ConfirmedSend, WaitsUntilTheOldestIsInReachOfAnyAck) {
  const Sender stream = sender(0);
  Fate first = confirm(stream, "first");
  next_data();
  for (int i = 0; i < 64; ++i) stream.send("free").or_throw();
  const auto full = stream.send_confirmed("second", Timeout{1});
  EXPECT_TRUE(full.is(Status::timeout));
  EXPECT_EQ(full.failure().sentence.rfind("not sent", 0), 0u) << full.failure().sentence;
  for (int i = 0; i < 64; ++i) EXPECT_EQ(next_data().data, "free");
  Fate second = confirm(stream, "second");
  acknowledge(1, 0);
  EXPECT_TRUE(first.get());
  const Taken taken = next_data();
  EXPECT_EQ(taken.data, "second");
  EXPECT_EQ(taken.header.sequence, 66u);
  acknowledge(66, 0);
  EXPECT_TRUE(second.get());
}

TEST_F(ConfirmedSend, WaitsWhereOthersAreHeldOrSkipped) {
  for (const AtFullWindow at_full : {AtFullWindow::skip, AtFullWindow::hold_latest}) {
    const Sender stream =
        node_
            ->sender(Peer{test::kPeerId},
                     {.key = {3, 10 + streams_++}, .window = 1, .at_full = at_full})
            .or_throw();
    stream.send("1").or_throw();
    EXPECT_TRUE(stream.send_confirmed("2", Timeout{1}).is(Status::timeout));
    EXPECT_EQ(stream.counts().skipped, 0u);
    EXPECT_EQ(stream.counts().waiting, 1u);
  }
}

TEST_F(ConfirmedSend, EndsWithTheConnectionAndWithTheNode) {
  const Sender stream = sender(0);
  Fate fate = confirm(stream, "1");
  next_data();
  hub_.close();
  EXPECT_FALSE(fate.get());
  EXPECT_FALSE(stream.send_confirmed("2"));
  node_->close();
  EXPECT_TRUE(stream.send_confirmed("3").is(Status::closed));
}

TEST_F(ConfirmedSend, SaysThatTheNodeWasClosedWhileItWaited) {
  const Sender stream = sender(0);
  Fate fate = confirm(stream, "1");
  next_data();
  node_->close();
  const auto closed = fate.get();
  EXPECT_FALSE(closed);
  EXPECT_NE(closed.failure().sentence.find("closed"), std::string::npos)
      << closed.failure().sentence;
}

}  // namespace
}  // namespace gimnet::gimi
