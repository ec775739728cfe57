#include "client/gimi/answer_queue.hpp"

#include <gtest/gtest.h>

#include <optional>
#include <string>
#include <thread>

#include "tests/client/gimi/support/made_message.hpp"
#include "tests/client/nif/support/fake_hub.hpp"

// The queue alone: mostly the uplink was never opened, so what it sends goes nowhere.

namespace gimnet::gimi {
namespace {

using proto::gimi::kFlagAgain;
using proto::gimi::kFlagRepeat;
using proto::gimi::kNoDeadline;
using proto::gimi::MessageHeader;
using proto::gimi::MessageOperation;

class AnswerQueueTest : public testing::Test {
 protected:
  /// Was it kept?
  bool ask(std::uint32_t sequence, std::uint8_t flags = 0, std::uint32_t left_ms = kNoDeadline) {
    Message message = gimnet::test::make_message(data_, sequence);
    return queue_.on_request({sequence, MessageOperation::request, flags, 0, 7}, message, left_ms);
  }
  static constexpr std::size_t kBytesMax = 1000;
  std::string data_ = "x";
  Uplink uplink_;
  AnswerQueue queue_{uplink_, "calc/add", kBytesMax};
};

TEST_F(AnswerQueueTest, GivesRequestsOutInOrderWithTheTimeThatIsLeft) {
  EXPECT_TRUE(ask(1));
  EXPECT_TRUE(ask(2, 0, 60'000));
  const auto first = queue_.receive(kNoWait).or_throw();
  EXPECT_EQ(first.name, (std::uint64_t{7} << 32) | 1);
  EXPECT_EQ(first.left_ms, -1);
  const auto second = queue_.receive(kNoWait).or_throw();
  EXPECT_EQ(static_cast<std::uint32_t>(second.name), 2u);
  EXPECT_GT(second.left_ms, 50'000);
  EXPECT_LE(second.left_ms, 60'000);
  EXPECT_TRUE(queue_.receive(kNoWait).is(Status::timeout));
}

TEST_F(AnswerQueueTest, RefusesMoreThanItsLimit) {
  for (std::uint32_t i = 1; i <= AnswerQueue::kWaitingMax; ++i) EXPECT_TRUE(ask(i));
  EXPECT_FALSE(ask(1000));
  static_cast<void>(queue_.receive(kNoWait).or_throw());
  EXPECT_TRUE(ask(1001));
}

TEST_F(AnswerQueueTest, RefusesNoneForThoseThatAreTooLate) {
  for (std::uint32_t i = 1; i <= AnswerQueue::kWaitingMax; ++i)
    EXPECT_TRUE(ask(i, 0, i % 2 * 60'000));
  EXPECT_TRUE(ask(1000));
  EXPECT_EQ(static_cast<std::uint32_t>(queue_.receive(kNoWait).or_throw().name), 1u);
  EXPECT_EQ(static_cast<std::uint32_t>(queue_.receive(kNoWait).or_throw().name), 3u);
}

TEST_F(AnswerQueueTest, RefusesMoreBytesThanItsLimit) {
  data_.assign(kBytesMax - 1, 'x');
  EXPECT_TRUE(ask(1));
  EXPECT_TRUE(ask(2)) << "one goes beyond";
  data_ = "x";
  EXPECT_FALSE(ask(3));
  static_cast<void>(queue_.receive(kNoWait).or_throw());
  EXPECT_TRUE(ask(4));
}

TEST_F(AnswerQueueTest, DoesNotGiveOutWhatIsTooLate) {
  EXPECT_TRUE(ask(1, 0, 0));
  EXPECT_TRUE(ask(2));
  EXPECT_EQ(static_cast<std::uint32_t>(queue_.receive(kNoWait).or_throw().name), 2u);
  EXPECT_TRUE(queue_.reply((std::uint64_t{7} << 32) | 1, "3", kNoWait).is(Status::closed));
}

TEST_F(AnswerQueueTest, ARequestIsAnsweredOnce) {
  EXPECT_TRUE(ask(1));
  const auto taken = queue_.receive(kNoWait).or_throw();
  EXPECT_FALSE(queue_.reply(taken.name, "3", kNoWait).is(Status::bad_argument));
  EXPECT_TRUE(queue_.reply(taken.name, "3", kNoWait).is(Status::closed));
  EXPECT_TRUE(queue_.fail(taken.name, {}).is(Status::closed));
}

TEST_F(AnswerQueueTest, OneThatIsAskedAgainIsDoneOnce) {
  EXPECT_TRUE(ask(1));
  EXPECT_FALSE(ask(1, kFlagAgain)) << "it waits";
  const auto taken = queue_.receive(kNoWait).or_throw();
  EXPECT_FALSE(ask(1, kFlagAgain)) << "the program has it";
  static_cast<void>(queue_.reply(taken.name, "3", kNoWait));
  EXPECT_FALSE(ask(1, kFlagAgain)) << "its answer is kept";
  EXPECT_TRUE(ask(2, kFlagAgain)) << "it never came";
}

TEST_F(AnswerQueueTest, TheFirstOneThatComesBehindTheSecondIsNotDone) {
  EXPECT_TRUE(ask(1, kFlagAgain));
  EXPECT_FALSE(ask(1)) << "it waits";
  const auto taken = queue_.receive(kNoWait).or_throw();
  EXPECT_FALSE(ask(1)) << "the program has it";
  static_cast<void>(queue_.reply(taken.name, "3", kNoWait));
  EXPECT_FALSE(ask(1)) << "it was answered";
}

TEST_F(AnswerQueueTest, OneOfWhichNothingIsKeptIsDoneAgainOnlyIfItMayBe) {
  EXPECT_TRUE(ask(1));
  static_cast<void>(queue_.reply(queue_.receive(kNoWait).or_throw().name, "3", kNoWait));
  for (std::uint32_t i = 2; i <= 1 + AnswerQueue::kAnswersMax; ++i) {
    EXPECT_TRUE(ask(i));
    static_cast<void>(queue_.reply(queue_.receive(kNoWait).or_throw().name, "3", kNoWait));
  }
  EXPECT_FALSE(ask(1, kFlagAgain));
  EXPECT_TRUE(ask(1, kFlagAgain | kFlagRepeat));
}

TEST_F(AnswerQueueTest, KeepsAnswersUpToSoManyBytes) {
  const std::string large(AnswerQueue::kAnswerBytesMax, 'x');
  EXPECT_TRUE(ask(1));
  static_cast<void>(queue_.reply(queue_.receive(kNoWait).or_throw().name, "3", kNoWait));
  EXPECT_TRUE(ask(2));
  static_cast<void>(queue_.reply(queue_.receive(kNoWait).or_throw().name, large, kNoWait));
  EXPECT_TRUE(ask(2, kFlagAgain | kFlagRepeat) == false) << "its answer is kept";
  EXPECT_TRUE(ask(1, kFlagAgain | kFlagRepeat)) << "the larger one took its place";
}

TEST_F(AnswerQueueTest, NothingIsTakenAfterItsEnd) {
  EXPECT_TRUE(ask(1));
  queue_.end(Ending::closed());
  EXPECT_TRUE(queue_.receive(kNoWait).is(Status::closed));
  EXPECT_FALSE(ask(2));
}

/// A request was taken, and the hub has paused the way to who asked.
class AnswersOnAFullWay : public testing::Test {
 protected:
  AnswersOnAFullWay() {
    uplink_.open(connected_.node.get());
    EXPECT_TRUE(ask());
    taken_ = queue_.receive(kNoWait).or_throw().name;
    connected_.hub.send(proto::flow::Pause{way()});
    connected_.hub.send(proto::flow::Ping{77, 1});
    while (const auto pong = connected_.hub.next_flow<proto::flow::Pong>())
      if (pong->sequence == 77) break;
  }
  ~AnswersOnAFullWay() override { connected_.hub.close(); }
  bool ask(std::uint8_t flags = 0) {
    Message message = gimnet::test::make_message("x", 1);
    from_ = message.from().id;
    return queue_.on_request({1, MessageOperation::request, flags, 0, 7}, message, kNoDeadline);
  }
  [[nodiscard]] proto::flow::Target way() const {
    return {proto::Kind::unicast, proto::Lane::bulk, from_};
  }
  void resume() { connected_.hub.send(proto::flow::Resume{way()}); }
  /// Of the next message.
  proto::gimi::MessageView next() {
    frame_ = connected_.hub.next_message();
    return proto::gimi::parse_message(frame_->view().payload).value();
  }

  nif::test::FakeHub hub_;
  nif::test::Connected connected_ =
      nif::test::connect_to(hub_, nif::test::default_options(), nif::test::make_welcome());
  Uplink uplink_;
  AnswerQueue queue_{uplink_, "calc/add", 1000};
  std::uint32_t from_ = 0;
  std::uint64_t taken_ = 0;
  std::optional<nif::test::Frame> frame_;
};

TEST_F(AnswersOnAFullWay, AReplyThatWasNotSentCanBeTriedAgain) {
  EXPECT_TRUE(queue_.reply(taken_, "3", kNoWait).is(Status::timeout));
  EXPECT_TRUE(queue_.reply(taken_, "3", Timeout{1}).is(Status::timeout));
  EXPECT_FALSE(ask(kFlagAgain)) << "the program has it";
  resume();
  queue_.reply(taken_, "3", kForever).or_throw();
  EXPECT_EQ(next().header.operation, MessageOperation::reply);
  EXPECT_TRUE(queue_.reply(taken_, "3", kNoWait).is(Status::closed));
}

TEST_F(AnswersOnAFullWay, AnErrorCanTakeThePlaceOfAReplyThatWasNotSent) {
  EXPECT_TRUE(queue_.reply(taken_, "3", kNoWait).is(Status::timeout));
  resume();
  EXPECT_TRUE(queue_.fail(taken_, {proto::gimi::RequestFault::failed, -7, "no numbers"}));
  EXPECT_EQ(next().header.operation, MessageOperation::error);
}

TEST_F(AnswersOnAFullWay, OneThatIsLetGoIsAnsweredWhenItIsAskedAgain) {
  EXPECT_TRUE(queue_.reply(taken_, "3", kNoWait).is(Status::timeout));
  queue_.let_go(taken_);
  EXPECT_TRUE(queue_.reply(taken_, "3", kNoWait).is(Status::closed));
  resume();
  connected_.hub.send(proto::flow::Ping{78, 1});
  while (const auto pong = connected_.hub.next_flow<proto::flow::Pong>())
    if (pong->sequence == 78) break;
  EXPECT_FALSE(ask(kFlagAgain));
  EXPECT_EQ(next().header.operation, MessageOperation::error);
}

TEST_F(AnswersOnAFullWay, OneThatIsAskedAgainMeanwhileIsAnsweredTwice) {
  std::thread answering([this] {
    while (!queue_.reply(taken_, "3", kForever)) {
    }
  });
  // The queue says so only while the other thread waits to send its answer.
  while (!queue_.reply(taken_, "3", kNoWait).is(Status::closed)) {
  }
  EXPECT_FALSE(ask(kFlagAgain));
  resume();
  EXPECT_EQ(next().header.operation, MessageOperation::reply);
  EXPECT_EQ(next().header.operation, MessageOperation::reply) << "the first may be lost";
  answering.join();
}

TEST(AnswerTable, FindsAServiceByItsKey) {
  Uplink uplink;
  AnswerTable table(uplink, 1000);
  const auto added = table.add("calc/add");
  EXPECT_NE(table.add("calc/multiply").key, added.key);
  EXPECT_NE(AnswerTable(uplink, 1000).add("calc/add").key, added.key)
      << "a program that was started anew";
  EXPECT_EQ(added.key.type, proto::gimi::kRequestType);
  EXPECT_EQ(table.find(added.key), added.queue);
  EXPECT_EQ(table.find({added.key.type + 1, added.key.instance}), nullptr);
  table.remove(added.key);
  EXPECT_EQ(table.find(added.key), nullptr);
}

}  // namespace
}  // namespace gimnet::gimi
