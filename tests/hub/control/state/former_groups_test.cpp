#include <gtest/gtest.h>

#include <chrono>
#include <memory>
#include <span>
#include <string>

#include "hub/control/state/services.hpp"

// Who gets a group that a service had before its hub was killed.

namespace gimnet::hub {
namespace {

using namespace std::chrono_literals;

constexpr HubId kHub{7};
constexpr NodeIndex kOwner{1};
constexpr NodeIndex kThief{2};
constexpr NodeIndex kOther{3};

/// A hub that is killed now and then, and goes on from what it kept.
class FormerGroupsTest : public ::testing::Test {
 protected:
  FormerGroupsTest() { secret_.fill(std::byte{0x11}); }

  /// A start of which newcomers get indices from `first` on, and none of `used`.
  void start(std::uint32_t first, const IndexSet& used = {}) {
    IndexRange range{first, IndexPool::kBlock, used, forgettings_, outlasting_};
    services_ = std::make_unique<Services>(kHub, limits_, range, 0ms, secret_);
  }
  /// The hub keeps what it has to.
  IndexPool::Grant keep() {
    const IndexPool::Grant grant = services_->group_indices().next_grant(now_);
    services_->group_indices().grant(grant);
    forgettings_ = grant.forgettings;
    outlasting_ = grant.outlasting;
    return grant;
  }
  /// The same, and as few are left it forgets groups.
  void forget() {
    static_cast<void>(services_->group_indices().ready(now_));  // what has rested is nobody's
    ASSERT_TRUE(services_->group_indices().keeping_due(now_));
    const std::uint64_t before = forgettings_;
    ASSERT_TRUE(keep().forgets_gone);
    ASSERT_EQ(forgettings_, before + 1);
  }
  Services::Advertised advertise(NodeIndex node, const std::string& name,
                                 GroupIndex group = kNoGroup,
                                 std::span<const std::byte> proof = {}) {
    const auto done = services_->advertise(node, name, {}, now_, effects_, {group, proof});
    EXPECT_TRUE(done);
    return done ? *done : Services::Advertised{};
  }
  Services::Advertised come_back(NodeIndex node, const std::string& name,
                                 const Services::Advertised& before) {
    return advertise(node, name, before.group, before.proof);
  }
  void withdraw(NodeIndex node, GroupIndex group) {
    ASSERT_EQ(services_->withdraw(node, group, now_, effects_), std::nullopt);
    now_ += 1h;  // long enough at rest
  }
  /// So many that the hub forgets what nobody has.
  static IndexSet more_than_half() {
    IndexSet used;
    for (std::uint32_t index = 1; index <= 600'000; ++index) used.insert(index);
    return used;
  }

  Limits limits_;
  Secret secret_{};
  std::unique_ptr<Services> services_;
  Effects effects_;
  std::chrono::milliseconds now_{0};
  std::uint64_t forgettings_ = 0;
  IndexSet outlasting_;
};

TEST_F(FormerGroupsTest, TheOwnerHasItsGroupAndAThiefThatCameFirstAnother) {
  start(1);
  const auto mine = advertise(kOwner, "robot/odom");
  start(5'000);
  const auto others = advertise(kThief, "thief/odom");
  start(10'000);
  EXPECT_NE(advertise(kThief, "thief/a", mine.group).group, mine.group) << "no proof";
  EXPECT_NE(advertise(kThief, "thief/odom", mine.group, others.proof).group, mine.group)
      << "that of its own group";
  EXPECT_NE(advertise(kThief, "thief/b", mine.group, mine.proof).group, mine.group)
      << "another service's";
  EXPECT_EQ(come_back(kOwner, "robot/odom", mine).group, mine.group);
}

TEST_F(FormerGroupsTest, AProofOfAnotherSecretIsNone) {
  start(1);
  const auto mine = advertise(kOwner, "robot/odom");
  secret_.fill(std::byte{0x12});
  start(5'000);
  EXPECT_EQ(come_back(kOwner, "robot/odom", mine).group, GroupIndex{5'000});
}

TEST_F(FormerGroupsTest, EachAnswerBringsAProofThatCounts) {
  start(1);
  const auto first = advertise(kOwner, "robot/odom");
  EXPECT_EQ(advertise(kOwner, "robot/odom").proof, first.proof) << "nothing changed";
  ServiceTerms others;
  others.message_type = 9;
  const auto done = services_->advertise(kOwner, "robot/odom", others, now_, effects_);
  ASSERT_TRUE(done);
  ASSERT_NE(done->group, first.group);
  start(5'000);
  EXPECT_EQ(come_back(kOwner, "robot/odom", *done).group, done->group);
}

TEST_F(FormerGroupsTest, AGroupThatRestsOrThatTheServiceHasAnotherOneForIsNotGivenBack) {
  start(1);
  const auto mine = advertise(kOwner, "robot/odom");
  ASSERT_EQ(services_->withdraw(kOwner, mine.group, now_, effects_), std::nullopt);
  const auto second = come_back(kOwner, "robot/odom", mine);
  EXPECT_EQ(second.group, GroupIndex{2}) << "the first one rests";
  now_ += 1h;
  EXPECT_EQ(come_back(kOwner, "robot/odom", mine).group, GroupIndex{2})
      << "a service has one group";
}

// Of two that had the same group one after the other the later one has it, whoever comes first.
TEST_F(FormerGroupsTest, WhoseGroupWasForgottenLosesIt) {
  start(700'001, more_than_half());
  const auto old = advertise(kOwner, "robot/odom");
  const auto held = advertise(kOther, "other/held");
  withdraw(kOwner, old.group);
  forget();
  EXPECT_EQ(come_back(kOther, "other/held", held).group, held.group);
  start(old.group.value());
  const auto later = advertise(kThief, "thief/odom");
  ASSERT_EQ(later.group, old.group) << "it is nobody's";
  start(800'000);
  EXPECT_EQ(come_back(kOwner, "robot/odom", old).group, GroupIndex{800'000});
  EXPECT_EQ(come_back(kThief, "thief/odom", later).group, old.group);
  EXPECT_EQ(come_back(kOther, "other/held", held).group, held.group) << "it had it all the time";
}

TEST_F(FormerGroupsTest, AGroupThatNobodyGotSinceItWasForgottenIsNotGivenBackEither) {
  start(700'001, more_than_half());
  const auto old = advertise(kOwner, "robot/odom");
  withdraw(kOwner, old.group);
  forget();
  EXPECT_NE(come_back(kOwner, "robot/odom", old).group, old.group)
      << "the disk may say that it is a newcomer's";
}

TEST_F(FormerGroupsTest, AProofCountsUntilTheSecondForgettingAndItsNextOneFurther) {
  start(700'001, more_than_half());
  const auto old = advertise(kOwner, "robot/odom");
  const auto asleep = advertise(kOther, "other/held");
  forget();
  const auto renewed = advertise(kOwner, "robot/odom");
  ASSERT_EQ(renewed.group, old.group);
  EXPECT_NE(renewed.proof, old.proof);
  // Many came and went since.
  IndexSet used = more_than_half();
  used.insert(old.group.value());
  used.insert(asleep.group.value());
  start(800'000, used);
  ASSERT_EQ(come_back(kOwner, "robot/odom", renewed).group, old.group);
  ASSERT_EQ(come_back(kOther, "other/held", asleep).group, asleep.group) << "one forgetting";
  forget();
  start(900'000);
  EXPECT_EQ(come_back(kOwner, "robot/odom", renewed).group, old.group);
  EXPECT_EQ(come_back(kOther, "other/held", asleep).group, GroupIndex{900'000})
      << "two forgettings";
}

}  // namespace
}  // namespace gimnet::hub
