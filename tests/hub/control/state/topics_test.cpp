#include "hub/control/state/topics.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/control/ns.hpp"
#include "tests/hub/control/state/support/services_rig.hpp"

// Names get group ids and providers, and lose them: who hears of it.

namespace gimnet::hub {
namespace {

using namespace std::chrono_literals;
using proto::Status;
using std::chrono::milliseconds;
using test::kLogger;
using test::kRobot;
using test::kViewer;
using test::odometry;
using test::ServicesTest;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

TEST_F(ServicesTest, OtherTermsMeanAnotherGroupThatSubscribersJoinAsTheyAreTold) {
  advertise(kRobot, "robot/odom");
  subscribe(kViewer, "robot/odom");
  take_words();
  ServiceTerms terms = odometry();
  terms.message_type = 99;
  EXPECT_EQ(advertise(kRobot, "robot/odom", terms), GroupIndex{2});
  EXPECT_THAT(take_words(), ElementsAre("group 1", "group 2", "moved robot/odom, joins"));
  EXPECT_EQ(topics_.find_group(GroupIndex{1}), nullptr);
  EXPECT_EQ(services_.services_of(kRobot), 1u);
}

TEST_F(ServicesTest, WithdrawingTellsSubscribersAndKeepsThemWaiting) {
  advertise(kRobot, "robot/odom");
  subscribe(kViewer, "robot/odom");
  take_words();
  EXPECT_FALSE(services_.withdraw(kRobot, GroupIndex{1}, now_, effects_));
  EXPECT_THAT(take_words(), ElementsAre("group 1", "moved robot/odom"));
  EXPECT_FALSE(topics_.find_group(GroupIndex{1})->provided());
  EXPECT_EQ(topics_.provided(), 0u);
  EXPECT_EQ(services_.withdraw(kRobot, GroupIndex{1}, now_, effects_)->status, Status::not_found);
  // The same terms by anybody: the same group.
  EXPECT_EQ(advertise(kLogger, "robot/odom"), GroupIndex{1});
  EXPECT_THAT(take_words(), ElementsAre("group 1", "moved robot/odom"));
  EXPECT_FALSE(services_.withdraw(kLogger, GroupIndex{1}, now_, effects_));
  take_words();
  ServiceTerms terms = odometry();
  terms.retain = true;
  EXPECT_EQ(advertise(kRobot, "robot/odom", terms), GroupIndex{2});
  EXPECT_THAT(take_words(), ElementsAre("group 1", "group 2", "moved robot/odom, joins"));
}

TEST_F(ServicesTest, AGroupThatNobodyUsesIsGivenBackAfterAGraceTime) {
  const milliseconds grace{limits_.grace_ms};
  advertise(kRobot, "robot/odom");
  EXPECT_FALSE(services_.withdraw(kRobot, GroupIndex{1}, now_, effects_));
  EXPECT_EQ(topics_.next_deadline(), now_ + grace);
  subscribe(kViewer, "robot/odom");
  topics_.tick(now_ + grace, effects_);
  EXPECT_NE(topics_.find_group(GroupIndex{1}), nullptr) << "somebody waits for it";
  now_ += grace;
  EXPECT_FALSE(services_.unsubscribe(kViewer, "robot/odom", now_, effects_));
  topics_.tick(now_ + grace - 1ms, effects_);
  EXPECT_NE(topics_.find_group(GroupIndex{1}), nullptr);
  take_words();
  topics_.tick(now_ + grace, effects_);
  EXPECT_THAT(take_words(), ElementsAre("group 1"));
  EXPECT_EQ(topics_.by_name().size(), 0u);
  EXPECT_EQ(topics_.next_deadline(), std::nullopt);
  EXPECT_EQ(advertise(kRobot, "robot/odom"), GroupIndex{2}) << "the id rests";
}

TEST_F(ServicesTest, AGroupThatNobodyUsesMakesWayForTheServiceOfAnotherHub) {
  const AwayService away{make_id<GroupId>(HubId{9}, 3), make_id<NodeId>(HubId{9}, 1)};
  advertise(kRobot, "robot/odom");
  topics_.note_moved("robot/odom", away, now_, effects_);
  EXPECT_NE(topics_.find_group(GroupIndex{1}), nullptr) << "it is provided here";
  EXPECT_FALSE(services_.withdraw(kRobot, GroupIndex{1}, now_, effects_));
  topics_.note_moved("robot/odom", std::nullopt, now_, effects_);
  EXPECT_NE(topics_.find_group(GroupIndex{1}), nullptr) << "it may come back";
  topics_.note_moved("robot/odom", away, now_, effects_);
  EXPECT_EQ(topics_.by_name().size(), 0u);
  const auto topic = services_.subscribe(kViewer, "robot/odom", {}, effects_, away);
  ASSERT_TRUE(topic);
  EXPECT_EQ((*topic)->away->group, away.group);
}

TEST_F(ServicesTest, TheOldestGroupsThatNobodyProvidesMakeRoomWhereFewAreLeft) {
  limits_.services_per_node = limits_.subscriptions_per_node = 2'000'000;
  constexpr std::uint32_t kHeldMost = kIndexMost / 4 * 3;
  for (std::uint32_t i = 1; i <= kHeldMost; ++i)
    ASSERT_EQ(advertise(kRobot, "robot/s" + std::to_string(i)), GroupIndex{i});
  subscribe(kViewer, "robot/s7");
  EXPECT_FALSE(services_.withdraw(kRobot, GroupIndex{7}, now_, effects_));
  EXPECT_FALSE(services_.withdraw(kRobot, GroupIndex{5}, now_, effects_));
  take_words();
  EXPECT_EQ(advertise(kLogger, "logger/one"), GroupIndex{kHeldMost + 1});
  EXPECT_THAT(take_words(),
              ElementsAre("group 7", "moved robot/s7", "group " + std::to_string(kHeldMost + 1)));
  EXPECT_FALSE(topics_.find("robot/s7")->service) << "its subscription stays";
  EXPECT_NE(topics_.find_group(GroupIndex{5}), nullptr);
  // A name that makes room for itself.
  ServiceTerms terms = odometry();
  terms.instance = 99;
  EXPECT_EQ(advertise(kRobot, "robot/s5", terms), GroupIndex{kHeldMost + 2});
}

TEST_F(ServicesTest, WhoComesBackIsToldOfWhatChangedSince) {
  advertise(kRobot, "robot/odom");
  advertise(kRobot, "robot/scan");
  subscribe(kViewer, "robot/odom");
  subscribe(kViewer, "robot/scan");
  const std::uint64_t before = topics_.changes();
  EXPECT_THAT(services_.moved_since(kViewer, before), IsEmpty());
  EXPECT_FALSE(services_.withdraw(kRobot, GroupIndex{2}, now_, effects_));
  EXPECT_FALSE(services_.withdraw(kRobot, GroupIndex{1}, now_, effects_));
  advertise(kRobot, "robot/scan");
  const auto moved = services_.moved_since(kViewer, before);
  ASSERT_EQ(moved.size(), 2u) << "each once, the latest last";
  EXPECT_EQ(moved[0]->full_name, "robot/odom");
  EXPECT_EQ(moved[1]->full_name, "robot/scan");
  EXPECT_EQ(services_.moved_since(kViewer, moved[0]->change).size(), 1u);
  EXPECT_THAT(services_.moved_since(kLogger, 0), IsEmpty());
}

ServiceTerms map_in_sync() {
  ServiceTerms terms;
  terms.delivery = proto::ns::Delivery::sync;
  terms.window = 4;
  terms.retain = true;
  return terms;
}

TEST_F(ServicesTest, AGroupIsPublishedBeforeItsMembersJoin) {
  const SubscriberTerms wanted{.window = 2, .depth = 3};
  EXPECT_TRUE(services_.subscribe(kViewer, "robot/map", wanted, effects_));
  EXPECT_THAT(take_words(), IsEmpty()) << "nobody provides it yet";
  EXPECT_EQ(advertise(kRobot, "robot/map", map_in_sync()), GroupIndex{1});
  EXPECT_THAT(take_words(), ElementsAre("group 1", "moved robot/map, joins"));
  EXPECT_EQ(topics_.find("robot/map")->pace_of(kViewer), wanted);
  EXPECT_EQ(subscribe(kLogger, "robot/map"), Status::done);
  EXPECT_THAT(take_words(),
              ElementsAre("member 3 of 1", "pace 3 of 1: 4/1 retained", "subscribers robot/map"));
  EXPECT_TRUE(services_.subscribe(kViewer, "robot/map", wanted, effects_));
  EXPECT_THAT(take_words(), IsEmpty()) << "declared again, the same";
  EXPECT_TRUE(services_.subscribe(kViewer, "robot/map", {.window = 9}, effects_));
  EXPECT_THAT(take_words(), ElementsAre("pace 2 of 1: 4/1 retained"))
      << "at most what the service allows";
  EXPECT_FALSE(services_.unsubscribe(kLogger, "robot/map", now_, effects_));
  EXPECT_THAT(take_words(),
              ElementsAre("member 3 of 1", "no pace 3 of 1", "subscribers robot/map"));
  // In the table first: a frame that is read before the last message is forgotten must not make it
  // anew.
  EXPECT_EQ(advertise(kRobot, "robot/map"), GroupIndex{2});
  EXPECT_THAT(take_words(), ElementsAre("no pace 2 of 1", "group 1", "forget 1 of 1", "group 2",
                                        "moved robot/map, joins"));
  EXPECT_EQ(advertise(kRobot, "robot/map", map_in_sync()), GroupIndex{3});
  EXPECT_THAT(take_words(),
              ElementsAre("no pace 2 of 2", "group 2", "group 3", "moved robot/map, joins"));
  EXPECT_FALSE(services_.withdraw(kRobot, GroupIndex{3}, now_, effects_));
  EXPECT_THAT(take_words(), ElementsAre("group 3", "forget 3 of 1", "moved robot/map"));
}

}  // namespace
}  // namespace gimnet::hub
