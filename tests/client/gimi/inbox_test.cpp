#include "client/gimi/inbox.hpp"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <string>
#include <thread>
#include <vector>

#include "tests/client/gimi/support/made_message.hpp"

namespace gimnet::gimi {
namespace {

using test::make_counted;
using test::make_message;

struct CountingReceipt final : Receipt {
  void on_kept() override { ++kept; }
  int kept = 0;
};

class InboxTest : public testing::Test {
 protected:
  bool put(MessageKey key, std::uint32_t sequence = 1) {
    Message message = make_message("x", sequence, key);
    return inbox_.put(key, message, nullptr);
  }
  std::atomic<int> rooms_{0};
  Inbox inbox_{2, 1000, [this] { ++rooms_; }};
};

TEST_F(InboxTest, KeepsKeysApart) {
  EXPECT_TRUE(put({1, 0}, 10));
  EXPECT_TRUE(put({1, 1}, 20));
  EXPECT_EQ(inbox_.receive(inbox_.queue({1, 1}, nullptr), kNoWait)->sequence(), 20u);
  EXPECT_EQ(inbox_.receive(inbox_.queue({1, 0}, nullptr), kNoWait)->sequence(), 10u);
}

TEST_F(InboxTest, GivesWhatWaitedLongestOfAll) {
  EXPECT_TRUE(put({1, 0}, 1));
  EXPECT_TRUE(put({2, 0}, 2));
  EXPECT_TRUE(put({1, 0}, 3));
  for (std::uint32_t sequence = 1; sequence <= 3; ++sequence) {
    EXPECT_EQ(inbox_.receive_any(kNoWait)->sequence(), sequence);
  }
  EXPECT_TRUE(inbox_.receive_any(kNoWait).is(Status::timeout));
}

TEST_F(InboxTest, SaysWhenTheTimeIsUp) {
  EXPECT_TRUE(inbox_.receive(inbox_.queue({1, 0}, nullptr), Timeout{1}).is(Status::timeout));
  EXPECT_FALSE(inbox_.try_receive(inbox_.queue({1, 0}, nullptr)));
}

class GrowingQueuesTest : public InboxTest {
 protected:
  static constexpr std::size_t kSize = 100'000;
  static constexpr std::size_t kPlace = 160;  ///< that a message takes beside its bytes

  MessageQueue& add() { return inbox_.add_queue({{}, true}); }
  void fill(MessageQueue& queue) {
    for (int i = 0; i < 200; ++i) {
      Message message = test::make_stored(kSize, nullptr);
      ASSERT_TRUE(inbox_.put(queue, message, nullptr));
    }
  }
};

TEST_F(GrowingQueuesTest, TakeSoManyBytesAlone) {
  MessageQueue& queue = add();
  fill(queue);
  EXPECT_EQ(queue.size(), GrowingQueues::kQueueBytesMax / (kSize + kPlace));
  EXPECT_EQ(queue.overwritten(), 200 - queue.size());
  for (int i = 0; i < 200; ++i) EXPECT_TRUE(put({1, 0}));
  EXPECT_EQ(inbox_.queue({1, 0}, nullptr).size(), 2u) << "one of a key does not grow";
}

TEST_F(GrowingQueuesTest, ShareTheBytesOfAllOfThem) {
  std::vector<MessageQueue*> queues;
  for (int i = 0; i < 4; ++i) queues.push_back(&add());
  for (MessageQueue* queue : queues) fill(*queue);
  EXPECT_EQ(queues.back()->size(), GrowingQueues::kQueueBytesMax / (kSize + kPlace));
  for (int i = 0; i < 4; ++i) queues.push_back(&add());
  const std::size_t half = GrowingQueues::kQueueBytesMax / 2 / (kSize + kPlace);
  EXPECT_EQ(queues.front()->size(), half) << "at once";
  for (int i = 0; i < 992; ++i) queues.push_back(&add());
  EXPECT_EQ(queues.front()->size(), kQueueMessagesDefault) << "so many in any case";
  for (; queues.size() > 8; queues.pop_back()) inbox_.remove(*queues.back());
  fill(*queues.front());
  EXPECT_EQ(queues.front()->size(), half);
  for (; queues.size() > 2; queues.pop_back()) inbox_.resize(*queues.back(), 10);
  fill(*queues.front());
  EXPECT_EQ(queues.front()->size(), 2 * half + 1) << "those with a wish do not count";
}

TEST(PacedQueue, GetsTheNewestAtEachDueTime) {
  std::atomic<int> roused = 0;
  Inbox inbox(2, 1000, [] {}, {}, {[&] { ++roused; }, [] {}});
  MessageQueue& paced = inbox.add_queue({});
  MessageQueue& plain = inbox.add_queue({});
  const auto put = [&](std::uint32_t sequence) {
    const std::array<MessageQueue*, 2> both{&paced, &plain};
    Message message = make_message("x", sequence);
    EXPECT_TRUE(inbox.put_in_all(both, message));
  };
  inbox.pace(paced, 2.0);
  EXPECT_EQ(inbox.due_ns(), INT64_MAX);
  put(1);
  EXPECT_EQ(inbox.try_receive(paced)->sequence(), 1u) << "the first comes at once";
  put(2);
  put(3);
  EXPECT_EQ(inbox.counts(plain).size, 3u);
  EXPECT_EQ(inbox.counts(paced).left_out, 1u);
  EXPECT_EQ(roused, 1);
  EXPECT_FALSE(inbox.try_receive(paced)) << "it is not due yet";
  const std::int64_t due = inbox.due_ns();
  while (!is_over(due)) std::this_thread::yield();
  static_cast<void>(inbox.tick());
  EXPECT_EQ(inbox.due_ns(), INT64_MAX);
  EXPECT_EQ(inbox.receive(paced, kNoWait)->sequence(), 3u);
  put(4);
  inbox.end(Ending::closed());
  EXPECT_EQ(inbox.receive(paced, kNoWait)->sequence(), 4u) << "what came is given out";
}

TEST(PacedQueue, GivesOutWhatFoundNoRoomBeforeTheEnd) {
  Inbox inbox(2, 1000, [] {});
  MessageQueue& paced = inbox.add_queue({{1, AtFullQueue::stop_reading}});
  inbox.pace(paced, 0.001);
  for (std::uint32_t sequence = 1; sequence <= 2; ++sequence) {
    Message message = make_message("x", sequence);
    EXPECT_TRUE(inbox.put(paced, message, nullptr));
  }
  inbox.end(Ending::closed());
  EXPECT_EQ(inbox.receive(paced, kNoWait)->sequence(), 1u);
  const auto held = inbox.receive(paced, kNoWait);
  ASSERT_TRUE(held) << "it is not due for a long time, but nothing else comes";
  EXPECT_EQ(held->sequence(), 2u);
  EXPECT_TRUE(inbox.receive(paced, kNoWait).is(Status::closed));
}

TEST(PacedQueue, EndsWithAMessage) {
  Inbox inbox(2, 1000, [] {});
  MessageQueue& paced = inbox.add_queue({});
  inbox.pace(paced, 0.001);
  for (std::uint32_t sequence = 1; sequence <= 3; ++sequence) {
    Message message = make_message("x", sequence);
    EXPECT_TRUE(inbox.put(paced, message, nullptr));
  }
  inbox.remove(paced);
  EXPECT_EQ(inbox.queues(), 0u);
  EXPECT_FALSE(inbox.tick());
}

TEST_F(InboxTest, WakesWhoWaits) {
  MessageQueue& queue = inbox_.queue({1, 0}, nullptr);
  std::uint32_t got = 0;
  std::thread waiter([&] { got = inbox_.receive(queue, kForever)->sequence(); });
  EXPECT_TRUE(put({1, 0}, 5));
  waiter.join();
  EXPECT_EQ(got, 5u);
  std::thread any([&] { got = inbox_.receive_any(kForever)->sequence(); });
  EXPECT_TRUE(put({9, 9}, 6));
  any.join();
  EXPECT_EQ(got, 6u);
}

TEST_F(InboxTest, AQueueThatNobodyReadsAnyMoreHoldsNobodyUp) {
  const QueueOptions options{1, AtFullQueue::stop_reading};
  MessageQueue& queue = inbox_.add_queue({options});
  Message first = make_message("x", 1);
  Message second = make_message("x", 2);
  EXPECT_TRUE(inbox_.put(queue, first, nullptr));
  EXPECT_FALSE(inbox_.put(queue, second, nullptr));
  inbox_.remove(queue);
  EXPECT_EQ(rooms_, 1);
  EXPECT_EQ(inbox_.queues(), 0u);
  EXPECT_TRUE(inbox_.receive_any(kNoWait).is(Status::timeout)) << "what waited is dropped";
}

TEST_F(InboxTest, TellsSilenceOnceInItsTimeWhileNothingComes) {
  MessageQueue& silent = inbox_.add_queue({}, Timeout{1});
  for (int i = 0; i < 2; ++i) {
    const auto nothing = inbox_.receive(silent, kForever);
    ASSERT_TRUE(nothing.is(Status::silence));
    EXPECT_EQ(nothing.failure().sentence, "nothing came for 1 ms");
  }
  MessageQueue& expecting = inbox_.add_queue({}, std::chrono::hours{1});
  EXPECT_TRUE(inbox_.receive(expecting, kNoWait).is(Status::timeout));
  Message message = make_message("x");
  EXPECT_TRUE(inbox_.put(silent, message, nullptr));
  EXPECT_TRUE(inbox_.receive(silent, kForever)) << "it waits, however long nothing else came";
}

TEST(Inbox, CountsWhatWaitsInAQueueThatGoesAsTaken) {
  std::uint32_t taken = 0;
  Inbox inbox(2, 1000, [] {}, [&taken](const TakenMessages& some, bool) { taken += some.count; });
  MessageQueue& queue = inbox.add_queue({});
  Message message = make_counted(11, 1);
  EXPECT_TRUE(inbox.put(queue, message, nullptr));
  EXPECT_EQ(taken, 0u);
  inbox.remove(queue);
  EXPECT_EQ(taken, 1u);
}

TEST(Inbox, PutsAMessageIntoAllQueuesOrNone) {
  std::uint32_t taken = 0;
  Inbox inbox(2, 1000, [] {}, [&taken](const TakenMessages& some, bool) { taken += some.count; });
  MessageQueue& one = inbox.add_queue({{4, AtFullQueue::stop_reading}});
  MessageQueue& other = inbox.add_queue({{1, AtFullQueue::stop_reading}});
  const std::array queues{&one, &other};
  Message message = make_counted(11, 1);
  EXPECT_TRUE(inbox.put_in_all(queues, message));
  EXPECT_EQ(taken, 1u) << "once, when it is in all";
  Message next = make_message("text", 2);
  EXPECT_FALSE(inbox.put_in_all(queues, next)) << "there is no room in one of them";
  EXPECT_EQ(next.text(), "text");
  EXPECT_EQ(inbox.counts(one).size, 1u);
  EXPECT_TRUE(inbox.try_receive(other));
  EXPECT_TRUE(inbox.put_in_all(queues, next));
  EXPECT_TRUE(inbox.try_receive(one));
  EXPECT_EQ(inbox.try_receive(one)->text(), "text");
  EXPECT_EQ(inbox.try_receive(other)->text(), "text");
  EXPECT_EQ(taken, 1u);
}

TEST_F(InboxTest, ClosingEndsAllWaits) {
  MessageQueue& queue = inbox_.queue({1, 0}, nullptr);
  std::thread one([&] { EXPECT_TRUE(inbox_.receive(queue, kForever).is(Status::closed)); });
  std::thread any([&] { EXPECT_TRUE(inbox_.receive_any(kForever).is(Status::closed)); });
  inbox_.end(Ending::closed());
  one.join();
  any.join();
}

TEST_F(InboxTest, WhatCameBeforeClosingIsStillThere) {
  EXPECT_TRUE(put({1, 0}, 5));
  inbox_.end(Ending::closed());
  EXPECT_EQ(inbox_.receive(inbox_.queue({1, 0}, nullptr), kForever)->sequence(), 5u);
}

TEST_F(InboxTest, ARefusingQueueTellsWhenItIsHalfEmpty) {
  const QueueOptions options{4, AtFullQueue::stop_reading};
  MessageQueue& queue = inbox_.queue({1, 0}, &options);
  for (int i = 0; i < 4; ++i) EXPECT_TRUE(put({1, 0}));
  EXPECT_FALSE(put({1, 0}));
  EXPECT_TRUE(inbox_.try_receive(queue));
  EXPECT_EQ(rooms_, 0);
  EXPECT_TRUE(inbox_.try_receive(queue));
  EXPECT_EQ(rooms_, 1);
  EXPECT_TRUE(inbox_.try_receive(queue));
  EXPECT_EQ(rooms_, 1) << "once";
}

TEST_F(InboxTest, AMessageThatIsRefusedIsUnchanged) {
  const QueueOptions options{1, AtFullQueue::stop_reading};
  inbox_.queue({1, 0}, &options);
  EXPECT_TRUE(put({1, 0}));
  Message message = make_message("text");
  CountingReceipt receipt;
  EXPECT_FALSE(inbox_.put(MessageKey{1, 0}, message, &receipt));
  EXPECT_EQ(message.text(), "text");
  EXPECT_EQ(receipt.kept, 0);
  EXPECT_TRUE(inbox_.put(MessageKey{2, 0}, message, &receipt));
  EXPECT_EQ(receipt.kept, 1);
}

TEST(Inbox, TellsWhatWasTakenOfAWindowWhicheverWayItWent) {
  std::vector<std::string> told;
  Inbox inbox(
      2, 1000, [] {},
      [&](const TakenMessages& taken, bool more) {
        told.push_back(std::to_string(taken.group) + "x" + std::to_string(taken.count) +
                       (more ? "+" : ""));
      });
  MessageQueue& queue = inbox.add_queue({{2, AtFullQueue::overwrite_oldest}});
  const auto put = [&](std::uint32_t group) {
    Message message = make_counted(group, 1);
    EXPECT_TRUE(inbox.put(queue, message, nullptr));
  };
  put(5);
  put(5);
  EXPECT_TRUE(told.empty());
  put(5);  // overwrites
  EXPECT_TRUE(inbox.receive(queue, kNoWait));
  EXPECT_TRUE(inbox.try_receive(queue));
  EXPECT_EQ(told, (std::vector<std::string>{"5x1", "5x1+", "5x1"})) << "+: others wait";
  told.clear();
  put(6);
  put(6);
  EXPECT_TRUE(inbox.take_newest(queue));
  put(7);
  put(7);
  inbox.resize(queue, 1);
  EXPECT_TRUE(inbox.receive_any(kNoWait));
  EXPECT_EQ(told, (std::vector<std::string>{"6x2", "7x1+", "7x1"}));
}

TEST(Inbox, TellsWhatWasMissedAtMostOnceASecond) {
  int begun = 0;
  int told = 0;
  Inbox inbox(2, 1000, [] {}, {}, {[&begun] { ++begun; }, [&told] { ++told; }});
  MessageQueue& queue = inbox.add_queue({{1, AtFullQueue::overwrite_oldest}});
  const auto put = [&] {
    Message message = make_message("x", 1, {});
    EXPECT_TRUE(inbox.put(queue, message, nullptr));
  };
  put();
  EXPECT_EQ(begun, 0);
  for (int i = 0; i < 3; ++i) put();
  EXPECT_EQ(begun, 1);
  EXPECT_FALSE(inbox.tick());
  EXPECT_EQ(told, 1);
  put();
  EXPECT_EQ(begun, 2);
  EXPECT_TRUE(inbox.tick()) << "it will have to be told";
  EXPECT_EQ(told, 1) << "but not yet";
}

// Or 1,024 messages of a stranger would close the node to new keys for ever.
TEST_F(InboxTest, OfTooManyKeysForgetsAnEmptyQueueOrTheOldest) {
  for (std::uint32_t type = 0; type < Inbox::kUnaskedKeysMax; ++type) EXPECT_TRUE(put({type, 0}));
  EXPECT_EQ(inbox_.dropped(), 0u);
  EXPECT_TRUE(put({5000, 0}));
  EXPECT_EQ(inbox_.dropped(), 1u) << "that of the first key";
  EXPECT_EQ(inbox_.queues(), Inbox::kUnaskedKeysMax);
  EXPECT_EQ(inbox_.receive_any(kNoWait)->key().type, 1u);
  EXPECT_TRUE(put({5001, 0}));
  EXPECT_EQ(inbox_.dropped(), 1u) << "an empty queue went";
  const QueueOptions options;
  MessageQueue& asked = inbox_.queue({2, 0}, &options);
  EXPECT_EQ(inbox_.counts(asked).size, 1u);
  for (std::uint32_t type = 6000; type < 6000 + 2 * Inbox::kUnaskedKeysMax; ++type)
    EXPECT_TRUE(put({type, 0}));
  EXPECT_EQ(inbox_.counts(asked).size, 1u) << "that of a key which is asked for stays";
  EXPECT_EQ(inbox_.queues(), Inbox::kUnaskedKeysMax + 1);
  EXPECT_EQ(inbox_.receive_any(kNoWait)->key().type, 2u);
  EXPECT_EQ(inbox_.receive_any(kNoWait)->key().type, 6000 + Inbox::kUnaskedKeysMax);
}

TEST_F(InboxTest, BoundsTheBytesForWhichNobodyAsked) {
  const std::string text(Inbox::kUnaskedBytesMax / 4, 'x');
  const auto put_large = [&](std::uint32_t type) {
    Message message = make_message(text, type, {type, 0});
    EXPECT_TRUE(inbox_.put(MessageKey{type, 0}, message, nullptr));
  };
  const QueueOptions options;
  inbox_.queue({100, 0}, &options);
  put_large(100);
  for (std::uint32_t type = 1; type <= 4; ++type) put_large(type);
  EXPECT_TRUE(put({5, 0}));
  for (const std::uint32_t type : {100, 2, 3, 4, 1}) {
    EXPECT_EQ(inbox_.receive_any(kNoWait)->key().type, type == 1 ? 5 : type)
        << "the oldest one went, not that of the key which was asked for";
  }
  const std::string huge(Inbox::kUnaskedBytesMax + 1, 'x');
  Message message = make_message(huge, 1, {6, 0});
  EXPECT_TRUE(inbox_.put(MessageKey{6, 0}, message, nullptr));
  EXPECT_EQ(inbox_.receive_any(kNoWait)->size(), huge.size()) << "the newest one stays";
}

}  // namespace
}  // namespace gimnet::gimi
