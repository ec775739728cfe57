#include "hub/data/fanout/mailbox.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>
#include <vector>

namespace gimnet::hub {
namespace {

constexpr ShardIndex kSender{1};

Mail frames(std::uint32_t size) {
  Mail mail;
  mail.size = size;
  mail.frames = 1;
  return mail;
}

std::size_t take(Mailbox& mailbox, std::size_t most = 100'000) {
  return mailbox.drain(most, [] {}, [](const Mail&) {});
}

TEST(Mailbox, IsFullAtItsBoundOfEntriesAndNotBefore) {
  Waker waker;
  Mailbox mailbox(2, {.entries = 4, .bytes = 1'000'000}, waker);
  for (int i = 0; i < 4; ++i) {
    EXPECT_FALSE(mailbox.full(kSender, 10));
    mailbox.post(kSender, frames(10));
  }
  EXPECT_TRUE(mailbox.full(kSender, 10));
  EXPECT_FALSE(mailbox.full(ShardIndex{0}, 10)) << "each pair has its own";
  EXPECT_EQ(take(mailbox, 1), 1u);
  EXPECT_FALSE(mailbox.full(kSender, 10));
}

TEST(Mailbox, IsFullAtItsBoundOfBytesAndNotBefore) {
  Waker waker;
  Mailbox mailbox(2, {.entries = 100, .bytes = 1'000}, waker);
  EXPECT_FALSE(mailbox.full(kSender, 5'000)) << "larger than the bound, but alone";
  mailbox.post(kSender, frames(600));
  EXPECT_FALSE(mailbox.full(kSender, 400));
  EXPECT_TRUE(mailbox.full(kSender, 401));
  EXPECT_TRUE(mailbox.full(kSender, 5'000));
}

TEST(Mailbox, IsCrowdedAtHalfItsBoundOfDeliveriesAndNeverFullForThem) {
  Waker waker;
  Mailbox mailbox(2, {.entries = 100, .bytes = 1'000'000, .deliveries = 1'000}, waker);
  for (const std::uint32_t deliveries : {499u, 1u}) {
    Mail mail = frames(10);
    mail.set_deliveries(deliveries);
    mailbox.post_to_many(kSender, mail);
    EXPECT_FALSE(mailbox.crowded(kSender)) << "half";
  }
  Mail one = frames(10);
  one.set_deliveries(1);
  mailbox.post_to_many(kSender, one);
  EXPECT_TRUE(mailbox.crowded(kSender));
  EXPECT_FALSE(mailbox.crowded(ShardIndex{0})) << "each pair has its own";
  one.set_deliveries(1'000'000);
  mailbox.post_to_many(kSender, one);
  EXPECT_FALSE(mailbox.full(kSender, 10));
  EXPECT_EQ(take(mailbox), 4u);
  EXPECT_FALSE(mailbox.crowded(kSender));
}

// Entries that were fetched and not taken wait in their order, and count as waiting.
TEST(Mailbox, StopsWhereItIsTold) {
  Waker waker;
  Mailbox mailbox(2, {.entries = 80, .bytes = 1'000'000}, waker);
  for (std::uint32_t number = 0; number < 80; ++number) {
    Mail mail = frames(1);
    mail.node = NodeId{number};
    mailbox.post(kSender, mail);
  }
  std::uint32_t next = 0;
  for (int call = 0; call < 16; ++call) {
    EXPECT_TRUE(mailbox.full(kSender, 0) == (call == 0));
    const std::size_t taken = mailbox.drain(
        1'000, [] {},
        [&](const Mail& mail) {
          EXPECT_EQ(mail.node.value(), next);
          return ++next % 5 != 0;
        });
    EXPECT_EQ(taken, 5u) << "the one that ends it is taken";
    EXPECT_EQ(mailbox.empty(), next == 80);
  }
  EXPECT_EQ(next, 80u);
}

TEST(Mailbox, TellsASenderThatFoundItCrowdedOnce) {
  Waker waker;
  Mailbox mailbox(2, {.entries = 8, .bytes = 1'000'000}, waker);
  std::vector<int> told;
  const auto tell = [&](ShardIndex shard) { told.push_back(shard.value()); };
  for (int i = 0; i < 4; ++i) mailbox.post(kSender, frames(1));
  EXPECT_FALSE(mailbox.crowded(kSender)) << "half full";
  mailbox.tell_room(tell);
  EXPECT_TRUE(told.empty());
  mailbox.post(kSender, frames(1));
  EXPECT_TRUE(mailbox.crowded(kSender));
  EXPECT_EQ(take(mailbox), 5u);
  mailbox.tell_room(tell);
  mailbox.tell_room(tell);
  EXPECT_EQ(told, std::vector<int>{1});
  EXPECT_FALSE(mailbox.crowded(kSender));
}

TEST(Mailbox, WakesOnlyASleeper) {
  Waker waker;
  Mailbox mailbox(1, {.entries = 8, .bytes = 1'000}, waker);
  EXPECT_FALSE(mailbox.post(ShardIndex{0}, frames(1)));
  waker.prepare_to_sleep();
  EXPECT_FALSE(mailbox.empty());
  EXPECT_TRUE(mailbox.post(ShardIndex{0}, frames(1)));
}

// Provable: what each sender posts arrives once, in its order; the bounds hold at every moment, as
// the sender sees them; a sender that waits for room is told, so nobody waits for ever.
TEST(Mailbox, KeepsOrderAndBoundsUnderThreads) {
  constexpr std::size_t kSenders = 2;
  constexpr std::uint32_t kMails = 30'000;
  Waker waker;
  Mailbox mailbox(kSenders, {.entries = 64, .bytes = 1'000'000}, waker);
  std::atomic<bool> room[kSenders];
  std::vector<std::thread> senders;
  for (std::size_t s = 0; s < kSenders; ++s) {
    room[s] = true;
    senders.emplace_back([&, s] {
      const ShardIndex self{static_cast<std::uint8_t>(s)};
      for (std::uint32_t i = 0; i < kMails; ++i) {
        // As a shard does: it goes on reading only when its mailboxes are not crowded, or it was
        // told.
        while (mailbox.crowded(self)) {
          while (!room[s].exchange(false)) std::this_thread::yield();
        }
        ASSERT_FALSE(mailbox.full(self, 8));
        Mail mail = frames(8);
        mail.frames = i;
        mail.node = NodeId{static_cast<std::uint32_t>(s)};
        mailbox.post(self, mail);
      }
    });
  }
  std::uint32_t next[kSenders] = {};
  while (next[0] + next[1] < kSenders * kMails) {
    std::size_t waiting = mailbox.drain(
        1'000, [] {}, [&](const Mail& mail) { ASSERT_EQ(mail.frames, next[mail.node.value()]++); });
    ASSERT_LE(waiting, 1'000u);
    mailbox.tell_room([&](ShardIndex sender) { room[sender.value()] = true; });
  }
  for (std::thread& sender : senders) sender.join();
  EXPECT_TRUE(mailbox.empty());
}

}  // namespace
}  // namespace gimnet::hub
