#include "hub/network/state/network_state.hpp"

#include <gtest/gtest.h>

#include "tests/hub/network/state/support/hubs.hpp"

namespace gimnet::hub {
namespace {

using namespace test;

constexpr milliseconds kNow{1'000};

TEST(PartPace, TakesAPart20TimesASecondAndKeepsTheNewest) {
  PartPace pace;
  const auto hub = identity(1, 7);
  EXPECT_TRUE(pace.admit(part(hub, 1), kNow));
  EXPECT_FALSE(pace.next_due());
  EXPECT_FALSE(pace.admit(part(hub, 3), kNow + milliseconds(1)));
  EXPECT_FALSE(pace.admit(part(hub, 2), kNow + milliseconds(49)));
  EXPECT_TRUE(pace.take_due(kNow + milliseconds(49)).empty());
  EXPECT_EQ(pace.next_due(), kNow + PartPace::kPause);
  const auto due = pace.take_due(kNow + milliseconds(50));
  ASSERT_EQ(due.size(), 1u);
  EXPECT_EQ(due.front()->said.sequence, 3u);
  EXPECT_FALSE(pace.admit(part(hub, 4), kNow + milliseconds(99))) << "the next pause began";
}

TEST(PartPace, LetsOtherPartsPass) {
  PartPace pace;
  EXPECT_TRUE(pace.admit(part(identity(1, 7), 1), kNow));
  EXPECT_TRUE(pace.admit(part(identity(1, 7), 1, {}, 1), kNow));
  EXPECT_TRUE(pace.admit(part(identity(2, 7), 1), kNow));
  EXPECT_TRUE(pace.admit(part(identity(1, 7), 2), kNow + PartPace::kPause));
}

TEST(PartPace, TakesNothingAheadOfAPartThatWaits) {
  PartPace pace;
  const auto hub = identity(1, 7);
  EXPECT_TRUE(pace.admit(part(hub, 1), kNow));
  EXPECT_FALSE(pace.admit(part(hub, 3), kNow));
  EXPECT_FALSE(pace.admit(part(hub, 4), kNow + milliseconds(70))) << "until take_due()";
  EXPECT_EQ(pace.take_due(kNow + milliseconds(70)).front()->said.sequence, 4u);
}

TEST(PartPace, LooksOnlyAtPartsThatAreDue) {
  PartPace pace;
  const auto first = identity(1, 7);
  const auto second = identity(2, 7);
  EXPECT_TRUE(pace.admit(part(first, 1), kNow));
  EXPECT_TRUE(pace.admit(part(second, 1), kNow + milliseconds(10)));
  EXPECT_FALSE(pace.admit(part(second, 2), kNow + milliseconds(11)));
  EXPECT_TRUE(pace.admit(part(first, 2), kNow + milliseconds(55))) << "its pause is over";
  EXPECT_TRUE(pace.take_due(kNow + milliseconds(59)).empty());
  EXPECT_EQ(pace.next_due(), kNow + milliseconds(60));
  EXPECT_EQ(pace.take_due(kNow + milliseconds(60)).size(), 1u);
  EXPECT_FALSE(pace.next_due());
  EXPECT_FALSE(pace.admit(part(first, 3), kNow + milliseconds(104))) << "its second pause";
  EXPECT_EQ(pace.take_due(kNow + milliseconds(105)).front()->said.sequence, 3u);
}

}  // namespace
}  // namespace gimnet::hub
