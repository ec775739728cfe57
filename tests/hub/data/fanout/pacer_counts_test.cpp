#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/hub/data/support/pacer_rig.hpp"

// The counts of a paced subscription, and their begin and end.

namespace gimnet::hub {
namespace {

using proto::DropReason;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using testing::kGroup;
using testing::PacerTest;

TEST_F(PacerTest, WhatTheOutboxDropsCountsAsTaken) {
  PacedSubscription& one = subscribe({.window = 2});
  offer(one, {"1", "2", "3"});
  recipient.outbox.drop_all(DropReason::link_lost, rig.egress.context);
  EXPECT_EQ(one.uncredited(), 0u);
  EXPECT_EQ(rig.pacer.next_due_ms(), 0u);
  rig.pacer.release_due();
  EXPECT_THAT(sent(), ElementsAre("3"));
}

TEST_F(PacerTest, WhatIsTooLargeForTheSubscriberIsNotWaitedFor) {
  recipient.frame_bytes = 100;
  PacedSubscription& one = subscribe({.window = 1});
  offer(one, {std::string(101, 'x')});
  rig.pacer.release_due();
  EXPECT_EQ(dropped(DropReason::too_large), 1u);
  EXPECT_EQ(one.space(), 1u);
}

TEST_F(PacerTest, CountsEndWithTheSubscriptionAndBeginWithANumber) {
  PacedSubscription& one = subscribe({.window = 2});
  offer(one, {"1", "2", "3"});
  rig.pacer.unsubscribe(recipient, kGroup);
  EXPECT_EQ(Pacer::find(recipient, kGroup), nullptr);
  EXPECT_EQ(dropped(DropReason::no_subscriber), 1u);
  EXPECT_FALSE(rig.pacer.on_credit(recipient, {kGroup, 1})) << "nobody knows that group";
  PacedSubscription& again = subscribe({.window = 2});
  EXPECT_EQ(again.space(), 0u) << "what waits will be written, and counted";
  offer(again, {"4"});
  EXPECT_TRUE(rig.pacer.on_credit(recipient, {kGroup, 2}));
  EXPECT_THAT(sent(), ElementsAre("1", "2", "4"));
  rig.pacer.begin_counts(recipient, kGroup, 7);
  EXPECT_EQ(again.space(), 2u) << "nothing waits";
  offer(again, {"5", "6", "7"});
  EXPECT_THAT(sent(), ElementsAre("5", "6"));
  EXPECT_TRUE(rig.pacer.on_credit(recipient, {kGroup, 2, 6})) << "of former counts";
  EXPECT_THAT(sent(), IsEmpty());
  EXPECT_TRUE(rig.pacer.on_credit(recipient, {kGroup, 1, 7}));
  EXPECT_THAT(sent(), ElementsAre("7"));
}

TEST_F(PacerTest, AnotherProviderDoesNotEndAFormerOnesMessage) {
  PacedSubscription& one = subscribe({.window = 1});
  offer_fragment(one, 1, 0, 6, "ab");
  EXPECT_THAT(sent(), ElementsAre("ab"));
  EXPECT_EQ(one.space(), 0u);
  hub::Run run = fragment(1, 2, 6, "cd", 1);
  proto::FrameHeader header = run.header();
  header.src += 1;
  EXPECT_TRUE(rig.pacer.offer(one, run, header, {}));
  EXPECT_EQ(dropped(DropReason::cut_message), 1u);
  EXPECT_EQ(one.space(), 1u) << "the message that was begun takes no place any more";
}

}  // namespace
}  // namespace gimnet::hub
