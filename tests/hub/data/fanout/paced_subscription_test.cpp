#include "hub/data/fanout/paced_subscription.hpp"

#include <gtest/gtest.h>

#include "hub/data/fanout/recipient.hpp"
#include "tests/hub/data/support/egress_rig.hpp"

namespace gimnet::hub {
namespace {

constexpr GroupId kGroup{7u << 20 | 5};

class PacedSubscriptionTest : public ::testing::Test {
 protected:
  KeptMessage message(const std::string& text) {
    KeptMessage kept;
    kept.append(rig.run({text}), false, rig.lease, rig.context);
    return kept;
  }
  testing::EgressRig rig;
  Recipient recipient;
};

TEST_F(PacedSubscriptionTest, CountsWhatIsOnItsWay) {
  PacedSubscription subscription(recipient, kGroup, {.window = 3});
  EXPECT_EQ(subscription.space(), 3u);
  subscription.on_sent(2);
  EXPECT_EQ(subscription.space(), 1u);
  subscription.open(1).state = PacedSubscription::Open::State::passing;
  EXPECT_EQ(subscription.space(), 0u) << "a message that is just going counts";
  EXPECT_TRUE(subscription.on_credit(1));
  EXPECT_EQ(subscription.space(), 1u);
  EXPECT_TRUE(subscription.on_credit(1)) << "CREDIT may be repeated";
  EXPECT_EQ(subscription.space(), 1u);
  subscription.on_lost(1);
  EXPECT_EQ(subscription.space(), 2u);
}

TEST_F(PacedSubscriptionTest, WithoutAWindowThereIsAlwaysSpace) {
  PacedSubscription subscription(recipient, kGroup, {});
  subscription.on_sent(1'000'000);
  EXPECT_EQ(subscription.space(), UINT64_MAX);
}

TEST_F(PacedSubscriptionTest, DoesNotBelieveALyingTotal) {
  PacedSubscription subscription(recipient, kGroup, {.window = 2});
  subscription.on_sent(2);
  EXPECT_FALSE(subscription.on_credit(UINT64_MAX));
  EXPECT_EQ(subscription.space(), 2u) << "all that was sent, and not one more";
  subscription.on_sent(2);
  EXPECT_EQ(subscription.space(), 0u);
  EXPECT_FALSE(subscription.on_credit(1)) << "less than before";
  EXPECT_EQ(subscription.space(), 0u);
  // It credited what never left.
  subscription.on_lost(2);
  EXPECT_EQ(subscription.uncredited(), 0u);
  EXPECT_EQ(subscription.space(), 2u);
}

TEST_F(PacedSubscriptionTest, BeginsToCountAnew) {
  PacedSubscription subscription(recipient, kGroup, {.window = 4});
  subscription.on_sent(4);
  subscription.begin_counts(0, 1);
  EXPECT_EQ(subscription.uncredited(), 1u) << "what waits will be written";
  EXPECT_TRUE(subscription.on_credit(1));
}

TEST_F(PacedSubscriptionTest, IsDueByItsRate) {
  PacedSubscription subscription(recipient, kGroup, {.interval_us = 100});
  EXPECT_TRUE(subscription.is_due(1'000));
  subscription.on_begun(1'000);
  EXPECT_FALSE(subscription.is_due(1'099));
  EXPECT_TRUE(subscription.is_due(1'100));
  subscription.on_begun(1'130);
  EXPECT_TRUE(subscription.is_due(1'200)) << "30 us late: the rate holds on average";
  subscription.on_begun(5'000);
  EXPECT_FALSE(subscription.is_due(5'099)) << "a pause is not made up for";
}

TEST_F(PacedSubscriptionTest, AnotherRateHoldsFromTheMessageBefore) {
  PacedSubscription subscription(recipient, kGroup, {.interval_us = 1'000'000});
  EXPECT_TRUE(subscription.is_due(0));
  subscription.set_terms({.interval_us = 500'000});
  EXPECT_TRUE(subscription.is_due(0)) << "none has begun";
  subscription.on_begun(1'000);
  EXPECT_EQ(subscription.due_us(), 501'000u);
  subscription.set_terms({.interval_us = 100});
  EXPECT_EQ(subscription.due_us(), 1'100u);
  subscription.set_terms({});
  EXPECT_TRUE(subscription.is_due(1'000));
  subscription.set_terms({.interval_us = 1'000});
  EXPECT_EQ(subscription.due_us(), 2'000u);
}

TEST_F(PacedSubscriptionTest, HoldsTheNewestInOrder) {
  PacedSubscription subscription(recipient, kGroup, {.depth = 2});
  for (const char* text : {"one", "two"}) {
    KeptMessage kept = message(text);
    subscription.push_newest(kept);
    EXPECT_TRUE(kept.empty());
  }
  EXPECT_EQ(subscription.held(), 2u);
  subscription.set_terms({.depth = 4});
  subscription.pop_oldest();
  KeptMessage three = message("three!");
  const std::uint64_t bytes = three.bytes();
  subscription.push_newest(three);
  subscription.pop_oldest();
  EXPECT_EQ(subscription.held(), 1u);
  EXPECT_EQ(subscription.held_bytes(), bytes);
  EXPECT_EQ(subscription.oldest().bytes(), bytes);
}

}  // namespace
}  // namespace gimnet::hub
