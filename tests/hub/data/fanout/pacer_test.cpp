#include "hub/data/fanout/pacer.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/hub/data/support/pacer_rig.hpp"

namespace gimnet::hub {
namespace {

using proto::DropReason;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using testing::kGroup;
using testing::kStartMs;
using testing::PacerTest;

TEST_F(PacerTest, LetsThroughAWindowAndHoldsTheNewest) {
  PacedSubscription& one = subscribe({.window = 2});
  offer(one, {"1", "2", "3", "4", "5"});
  EXPECT_THAT(sent(), ElementsAre("1", "2"));
  EXPECT_EQ(dropped(DropReason::replaced), 2u);
  EXPECT_TRUE(rig.pacer.on_credit(recipient, {kGroup, 1}));
  EXPECT_THAT(sent(), ElementsAre("5"));
  offer(one, {"6"});
  EXPECT_THAT(sent(), IsEmpty());
  EXPECT_TRUE(rig.pacer.on_credit(recipient, {kGroup, 3}));
  EXPECT_THAT(sent(), ElementsAre("6"));
  offer(one, {"7"});
  EXPECT_THAT(sent(), ElementsAre("7"));
}

TEST_F(PacerTest, HoldsTheNewestOfItsDepthInOrder) {
  PacedSubscription& one = subscribe({.window = 1, .depth = 3});
  offer(one, {"1", "2", "3", "4", "5"});
  EXPECT_THAT(sent(), ElementsAre("1"));
  for (std::uint64_t total = 1; total <= 3; ++total) {
    EXPECT_TRUE(rig.pacer.on_credit(recipient, {kGroup, total}));
    EXPECT_THAT(sent(), ElementsAre(std::to_string(total + 2)));
  }
  subscribe({.window = 1, .depth = 3});
  offer(one, {"6", "7", "8"});
  subscribe({.window = 1, .depth = 1});
  EXPECT_EQ(one.held(), 1u) << "fewer from now on";
  subscribe({.window = 2, .depth = 1});
  EXPECT_THAT(sent(), ElementsAre("8")) << "a larger window opens at once";
}

TEST_F(PacerTest, TheWindowOfALinkIsWhatWaitsInItsQueue) {
  PacedSubscription& one = subscribe({.window = 2});
  one.by_queue = true;
  offer(one, {"1", "2", "3", "4"});
  rig.pacer.on_written(recipient);
  EXPECT_THAT(sent(), ElementsAre("1", "2")) << "nothing was written before";
  rig.pacer.on_written(recipient);
  EXPECT_THAT(sent(), ElementsAre("4")) << "the newest follows";
  offer(one, {"5"});
  EXPECT_THAT(sent(), ElementsAre("5"));
  offer(one, {"6", "7"});
  EXPECT_THAT(sent(), IsEmpty()) << "a message does not look through the queue";
  rig.pacer.on_written(recipient);
  EXPECT_THAT(sent(), ElementsAre("7")) << "those before were written: nobody credits them";
  EXPECT_EQ(dropped(DropReason::replaced), 2u);
}

TEST_F(PacerTest, GivesTheNewestAtEachDueTime) {
  PacedSubscription& one = subscribe({.interval_us = 20'000});
  offer(one, {"1"});
  EXPECT_THAT(sent(), ElementsAre("1"));
  for (int i = 2; i < 6; ++i) {
    pass_ms(4);
    offer(one, {std::to_string(i)});
  }
  EXPECT_THAT(sent(), IsEmpty());
  EXPECT_EQ(rig.pacer.next_due_ms(), kStartMs + 20);
  pass_ms(4);
  EXPECT_THAT(sent(), ElementsAre("5"));
  EXPECT_EQ(rig.pacer.next_due_ms(), Pacer::kNever) << "nothing is held";
  pass_ms(100);
  offer(one, {"6"});
  EXPECT_THAT(sent(), ElementsAre("6"));
}

TEST_F(PacerTest, ARateNeverLetsMoreThrough) {
  PacedSubscription& one = subscribe({.interval_us = 10'000});
  std::size_t got = 0;
  for (int ms = 0; ms < 1'000; ++ms) {
    offer(one, {"x", "y"});
    pass_ms(1);
    got += sent().size();
  }
  EXPECT_EQ(got, 101u) << "the first, and one each 10 ms";
}

TEST_F(PacerTest, AHigherRateHoldsFromTheMessageBefore) {
  PacedSubscription& one = subscribe({.interval_us = 1'000'000'000});
  offer(one, {"1", "2"});
  EXPECT_THAT(sent(), ElementsAre("1"));
  pass_ms(6);
  subscribe({.interval_us = 10'000});
  EXPECT_THAT(sent(), IsEmpty()) << "6 ms after the first";
  EXPECT_EQ(rig.pacer.next_due_ms(), kStartMs + 10);
  pass_ms(4);
  EXPECT_THAT(sent(), ElementsAre("2"));
  offer(one, {"3"});
  EXPECT_EQ(rig.pacer.next_due_ms(), kStartMs + 20);
  pass_ms(3);
  subscribe({.interval_us = 2'000});
  EXPECT_THAT(sent(), ElementsAre("3")) << "what may go by the new terms goes first";
  EXPECT_EQ(rig.pacer.next_due_ms(), Pacer::kNever);
}

TEST_F(PacerTest, ALowerRateHoldsFromTheMessageBefore) {
  PacedSubscription& one = subscribe({.interval_us = 10'000});
  offer(one, {"1", "2"});
  subscribe({.interval_us = 50'000});
  EXPECT_EQ(rig.pacer.next_due_ms(), kStartMs + 50);
  pass_ms(49);
  EXPECT_THAT(sent(), ElementsAre("1"));
  pass_ms(1);
  EXPECT_THAT(sent(), ElementsAre("2"));
}

TEST_F(PacerTest, ARateBehindNoneDoesNotRememberTheOneBefore) {
  PacedSubscription& one = subscribe({.interval_us = 1'000'000'000});
  offer(one, {"1", "2"});
  subscribe({});
  EXPECT_THAT(sent(), ElementsAre("1", "2"));
  EXPECT_EQ(rig.pacer.next_due_ms(), Pacer::kNever);
  offer(one, {"3", "4"});
  pass_ms(10);
  subscribe({.interval_us = 10'000});
  offer(one, {"5"});
  EXPECT_THAT(sent(), ElementsAre("3", "4", "5"));
}

TEST_F(PacerTest, ASubscriptionThatBeginsAgainIsDueAtOnce) {
  offer(subscribe({.interval_us = 1'000'000'000}), {"1", "2"});
  rig.pacer.unsubscribe(recipient, kGroup);
  EXPECT_EQ(rig.pacer.next_due_ms(), Pacer::kNever);
  PacedSubscription& again = subscribe({.interval_us = 1'000'000'000});
  offer(again, {"3", "4"});
  EXPECT_THAT(sent(), ElementsAre("1", "3"));
  EXPECT_EQ(rig.pacer.next_due_ms(), kStartMs + 1'000'000);
}

// It was its time, and the message that came then went before the pacer had looked.
TEST_F(PacerTest, OneThatHasJustGoneHoldsUpNoOther) {
  constexpr GroupId kOther{7u << 20 | 6};
  PacedSubscription& slow = subscribe({.interval_us = 100'000});
  PacedSubscription& other = rig.pacer.subscribe(recipient, kOther, {.interval_us = 101'000});
  offer(slow, {"1", "2"});
  offer(other, {"a", "b"});
  EXPECT_THAT(sent(), ElementsAre("1", "a"));
  rig.egress.context.now_ms += 100;
  offer(slow, {"3"});
  EXPECT_THAT(sent(), ElementsAre("3"));
  offer(slow, {"4"});
  pass_ms(1);
  EXPECT_THAT(sent(), ElementsAre("b"));
  EXPECT_EQ(rig.pacer.next_due_ms(), kStartMs + 200);
  pass_ms(99);
  EXPECT_THAT(sent(), ElementsAre("4"));
}

TEST_F(PacerTest, WholeMessagesOfManyFragmentsCountOnce) {
  PacedSubscription& one = subscribe({.window = 1});
  offer_fragment(one, 1, 0, 4, "ab");
  EXPECT_THAT(sent(), ElementsAre("ab")) << "it goes as it comes";
  offer_fragment(one, 1, 2, 4, "cd");
  EXPECT_THAT(sent(), ElementsAre("cd"));
  offer_fragment(one, 2, 0, 4, "ef");
  EXPECT_THAT(sent(), IsEmpty());
  EXPECT_TRUE(rig.pacer.on_credit(recipient, {kGroup, 1}));
  EXPECT_THAT(sent(), ElementsAre("ef")) << "what has come of it goes, and the rest as it comes";
  offer_fragment(one, 2, 2, 4, "gh");
  EXPECT_THAT(sent(), ElementsAre("gh"));
  offer_fragment(one, 3, 0, 4, "ij");
  offer_fragment(one, 3, 2, 4, "kl");
  EXPECT_TRUE(rig.pacer.on_credit(recipient, {kGroup, 2}));
  EXPECT_THAT(sent(), ElementsAre("ij", "kl"));
}

TEST_F(PacerTest, AMessageThatIsStillComingDoesNotReplaceAWholeOne) {
  PacedSubscription& one = subscribe({.window = 1});
  offer(one, {"1", "2"});
  offer_fragment(one, 9, 0, 4, "ab");
  EXPECT_THAT(sent(), ElementsAre("1"));
  offer(one, {"3"});  // it has no end
  EXPECT_EQ(dropped(DropReason::cut_message), 1u);
  offer_fragment(one, 9, 2, 4, "cd");
  EXPECT_EQ(dropped(DropReason::cut_message), 2u) << "the rest of it";
  EXPECT_TRUE(rig.pacer.on_credit(recipient, {kGroup, 1}));
  EXPECT_THAT(sent(), ElementsAre("3"));
}

TEST_F(PacerTest, AMessageWithoutAnEndGivesItsPlaceBack) {
  PacedSubscription& one = subscribe({.window = 1});
  offer_fragment(one, 1, 0, 4, "ab");
  offer(one, {"next"});
  EXPECT_THAT(sent(), ElementsAre("ab", "next")) << "of the same lane: the next message shows it";
  EXPECT_TRUE(rig.pacer.on_credit(recipient, {kGroup, 1}));
  offer_fragment(one, 2, 0, 4, "cd", 2);
  offer(one, {"other"});
  EXPECT_THAT(sent(), ElementsAre("cd"));
  rig.egress.context.now_ms += rig.egress.limits.block_ms;
  offer(one, {"later"});
  EXPECT_THAT(sent(), ElementsAre("later")) << "of another lane: the time";
}

TEST_F(PacerTest, AMessageThatBeganBeforeThePaceIsNotCut) {
  const hub::Run beginning = fragment(1, 0, 6, "ab", 1);
  rig.fanout.deliver(recipient, beginning, beginning.header(), {});
  EXPECT_THAT(sent(), ElementsAre("ab"));
  PacedSubscription& one = rig.pacer.subscribe(recipient, kGroup, {.interval_us = 20'000}, true);
  offer_fragment(one, 1, 2, 6, "cd");
  offer_fragment(one, 1, 4, 6, "ef");
  EXPECT_THAT(sent(), ElementsAre("cd", "ef")) << "it has the beginning";
  EXPECT_EQ(dropped(DropReason::cut_message), 0u);
  offer_fragment(one, 2, 2, 4, "gh");
  EXPECT_EQ(dropped(DropReason::cut_message), 1u) << "what has no beginning now never had one";
  offer(one, {"other"}, 2);
  offer_fragment(one, 3, 2, 4, "ij", 2);
  offer_fragment(one, 4, 0, 4, "kl", 3);
  offer_fragment(one, 5, 2, 4, "mn", 3);
  EXPECT_EQ(dropped(DropReason::cut_message), 4u) << "in other lanes the next message has begun";
  EXPECT_THAT(sent(), ElementsAre("other"));
  // New terms change nothing, and another beginning of the subscription is none of the pace.
  rig.pacer.subscribe(recipient, kGroup, {.interval_us = 10'000}, true);
  offer_fragment(one, 6, 2, 4, "op");
  rig.pacer.unsubscribe(recipient, kGroup);
  PacedSubscription& anew = subscribe({.interval_us = 10'000});
  offer_fragment(anew, 7, 2, 4, "qr");
  EXPECT_EQ(dropped(DropReason::cut_message), 6u);
}

TEST_F(PacerTest, HoldsWithinTheLaneAndTheBudget) {
  PacedSubscription& one = subscribe({.window = 1, .depth = 64});
  const std::string large(60'000, 'x');
  for (int i = 0; i < 40; ++i) offer(one, {large});
  EXPECT_LE(one.held_bytes(), rig.egress.limits.lane1_bytes);
  EXPECT_GT(dropped(DropReason::queue_full), 0u);
  EXPECT_GT(rig.egress.pool.pinned_bytes(), one.held_bytes()) << "what is held is charged";
  rig.egress.lease.take(rig.egress.limits.budget_bytes);
  offer(one, {"x"});
  EXPECT_EQ(dropped(DropReason::over_budget), 1u);
  rig.egress.lease.give_back(rig.egress.limits.budget_bytes);
}

TEST_F(PacerTest, WhileMemoryIsScarceHoldsWithinTheShare) {
  PacedSubscription& one = subscribe({.window = 1, .depth = 64});
  offer(one, {"open"});
  EXPECT_THAT(sent(), ElementsAre("open"));
  BudgetLease& lease = rig.egress.lease;
  lease.take(rig.egress.limits.budget_bytes * 7 / 8);
  lease.begin_turn(0);
  const std::uint64_t share = lease.share_bytes();
  const Outbox& outbox = recipient.outbox;
  const auto sized = [](std::uint64_t size) { return std::string(size - proto::kHeaderSize, 'x'); };
  offer(one, {sized(share / 2), sized(share / 2)});
  EXPECT_EQ(outbox.held_bytes(), share);
  EXPECT_EQ(one.held(), 2u);
  offer(one, {sized(proto::kHeaderSize)});
  EXPECT_EQ(dropped(DropReason::over_budget), 1u) << "the oldest goes";
  EXPECT_EQ(one.held(), 2u);
  offer(one, {sized(share + 1)});
  EXPECT_EQ(dropped(DropReason::over_budget), 4u) << "what is larger is not held";
  const auto half = static_cast<std::uint32_t>(share / 2);
  offer_fragment(one, 7, 0, 4 * half, std::string(half, 'x'));
  EXPECT_LE(rig.egress.pool.pinned_bytes(), share) << "copied out of the read buffer";
  offer_fragment(one, 7, half, 4 * half, std::string(half, 'x'));
  EXPECT_EQ(dropped(DropReason::over_budget), 5u) << "the part that came";
  EXPECT_EQ(outbox.held_bytes(), 0u);
  lease.give_back(rig.egress.limits.budget_bytes * 7 / 8);
}

TEST_F(PacerTest, OfALongRunOnlyWhatStaysIsCopied) {
  std::vector<std::string> texts(1'000, "new!");
  for (std::size_t i = 0; i < 998; ++i) texts[i].resize(i % 5);
  for (const std::uint32_t depth : {1u, 2u}) {
    PacedSubscription& one = subscribe({.window = 1, .depth = depth});
    offer(one, {"open"});
    const std::uint64_t copied = rig.egress.tally.copied_bytes;
    offer(one, texts);
    EXPECT_EQ(rig.egress.tally.copied_bytes - copied, depth * (proto::kHeaderSize + 4));
    subscribe({.window = 3, .depth = depth});
    EXPECT_EQ(sent().size(), 1 + depth);
    rig.pacer.unsubscribe(recipient, kGroup);
  }
  EXPECT_EQ(dropped(DropReason::replaced), 999u + 998u);
}

// Each of a long run would be refused by itself, and leave the window open.
TEST_F(PacerTest, WhatAFullOutboxRefusesOfARunTakesTheRestAlong) {
  constexpr std::uint8_t kDrop = 2;
  rig.egress.limits.lane1_bytes = 100;
  PacedSubscription& one = subscribe({.window = 2});
  offer(one, {std::string(64, 'x')}, 1, kDrop);
  offer(one, {"12345", "1234", "1"}, 1, kDrop);
  offer(one, {"1234", "1", "2"}, 1, kDrop);
  EXPECT_EQ(dropped(DropReason::queue_full), 3u);
  EXPECT_EQ(dropped(DropReason::replaced), 1u) << "the window is used up";
  EXPECT_THAT(sent(), ElementsAre(std::string(64, 'x'), "1234"));
}

TEST_F(PacerTest, ForASubscriberThatIsAway) {
  PacedSubscription& one = subscribe({.window = 1});
  offer(one, {"1", "2"});
  recipient.connected = false;
  recipient.outbox.drop_all(DropReason::link_lost, rig.egress.context);
  rig.pacer.on_away(recipient);
  rig.pacer.release_due();
  offer(one, {"3"});
  EXPECT_EQ(dropped(DropReason::away), 1u);
  recipient.connected = true;
  rig.pacer.on_new_epoch(recipient);
  offer(one, {"4", "5"});
  EXPECT_THAT(sent(), ElementsAre("4"));
}

}  // namespace
}  // namespace gimnet::hub
