#include "hub/control/state/services.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/control/ns.hpp"
#include "tests/hub/control/state/support/services_rig.hpp"

namespace gimnet::hub {
namespace {

using proto::Status;
using std::chrono::milliseconds;
using test::commands;
using test::kLogger;
using test::kRobot;
using test::kViewer;
using test::odometry;
using test::ServicesTest;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

TEST_F(ServicesTest, AdvertisingOpensAGroup) {
  EXPECT_EQ(advertise(kRobot, "robot/odom"), GroupIndex{1});
  EXPECT_THAT(take_words(), ElementsAre("group 1"));
  const Topic* topic = topics_.find_group(GroupIndex{1});
  ASSERT_NE(topic, nullptr);
  EXPECT_EQ(topic->full_name, "robot/odom");
  EXPECT_EQ(topic->service->provider, kRobot);
  EXPECT_EQ(services_.services_of(kRobot), 1u);
}

TEST_F(ServicesTest, AdvertisingAgainKeepsTheGroup) {
  EXPECT_EQ(advertise(kRobot, "robot/odom"), GroupIndex{1});
  take_words();
  ServiceTerms terms = odometry();
  terms.metadata = "wheel encoders";
  EXPECT_EQ(advertise(kRobot, "robot/odom", terms), GroupIndex{1});
  EXPECT_THAT(take_words(), IsEmpty());
  EXPECT_EQ(topics_.find_group(GroupIndex{1})->service->terms.metadata, "wheel encoders");
}

TEST_F(ServicesTest, AnotherNodeCannotTakeAService) {
  advertise(kRobot, "robot/odom");
  EXPECT_EQ(advertise_failure(kViewer, "robot/odom"), Status::taken);
}

TEST_F(ServicesTest, SubscribingToAServicePublishesItsGroupBeforeItsProviderIsTold) {
  advertise(kRobot, "robot/odom");
  take_words();
  EXPECT_EQ(subscribe(kViewer, "robot/odom"), Status::done);
  EXPECT_THAT(take_words(), ElementsAre("member 2 of 1", "subscribers robot/odom"));
  EXPECT_THAT(topics_.find_group(GroupIndex{1})->subscribers, ElementsAre(kViewer));
}

TEST_F(ServicesTest, SubscribingTwiceIsOnce) {
  advertise(kRobot, "robot/odom");
  subscribe(kViewer, "robot/odom");
  take_words();
  EXPECT_EQ(subscribe(kViewer, "robot/odom"), Status::done);
  EXPECT_THAT(take_words(), IsEmpty());
  EXPECT_THAT(topics_.find_group(GroupIndex{1})->subscribers, ElementsAre(kViewer));
}

TEST_F(ServicesTest, ANameWithoutAServiceIsWaitedFor) {
  const auto topic = services_.subscribe(kViewer, "robot/odom", {}, effects_);
  ASSERT_TRUE(topic);
  EXPECT_FALSE((*topic)->service.has_value());
  subscribe(kLogger, "robot/odom");
  EXPECT_THAT(take_words(), IsEmpty());
  const auto done = services_.advertise(kRobot, "robot/odom", odometry(), now_, effects_);
  ASSERT_TRUE(done);
  EXPECT_EQ(done->subscribers, 2u);
  EXPECT_THAT(take_words(), ElementsAre("group 1", "moved robot/odom, joins"));
}

TEST_F(ServicesTest, UnsubscribingTellsTheProvider) {
  advertise(kRobot, "robot/odom");
  subscribe(kViewer, "robot/odom");
  take_words();
  EXPECT_FALSE(services_.unsubscribe(kViewer, "robot/odom", now_, effects_));
  EXPECT_THAT(take_words(), ElementsAre("member 2 of 1", "subscribers robot/odom"));
  const auto again = services_.unsubscribe(kViewer, "robot/odom", now_, effects_);
  ASSERT_TRUE(again);
  EXPECT_EQ(again->status, Status::not_found);
}

TEST_F(ServicesTest, AForgottenNameLeavesNothingBehind) {
  subscribe(kViewer, "robot/odom");
  EXPECT_EQ(topics_.by_name().size(), 1u);
  EXPECT_FALSE(services_.unsubscribe(kViewer, "robot/odom", now_, effects_));
  EXPECT_EQ(topics_.by_name().size(), 0u);
}

TEST_F(ServicesTest, OnlyTheProviderWithdraws) {
  advertise(kRobot, "robot/odom");
  EXPECT_EQ(services_.withdraw(kViewer, GroupIndex{1}, now_, effects_)->status, Status::denied);
  EXPECT_EQ(services_.withdraw(kRobot, GroupIndex{2}, now_, effects_)->status, Status::not_found);
  EXPECT_NE(topics_.find_group(GroupIndex{1}), nullptr);
}

TEST_F(ServicesTest, ServicesOfANodeAreLimited) {
  EXPECT_EQ(advertise_failure(kRobot, "robot/a"), Status::done);
  EXPECT_EQ(advertise_failure(kRobot, "robot/b"), Status::done);
  EXPECT_EQ(advertise_failure(kRobot, "robot/c"), Status::limit);
  EXPECT_EQ(advertise_failure(kRobot, "robot/b"), Status::done);
  EXPECT_FALSE(services_.withdraw(kRobot, GroupIndex{1}, now_, effects_));
  EXPECT_EQ(advertise_failure(kRobot, "robot/c"), Status::done);
}

TEST_F(ServicesTest, SubscriptionsOfANodeAreLimited) {
  EXPECT_EQ(subscribe(kViewer, "x/a"), Status::done);
  EXPECT_EQ(subscribe(kViewer, "x/b"), Status::done);
  EXPECT_EQ(subscribe(kViewer, "x/c"), Status::limit);
  EXPECT_EQ(subscribe(kViewer, "x/b"), Status::done);
  EXPECT_EQ(topics_.by_name().size(), 2u);
  EXPECT_EQ(subscribe(kLogger, "x/c"), Status::done);
}

TEST_F(ServicesTest, BadFullNamesAreRefused) {
  EXPECT_EQ(subscribe(kViewer, ""), Status::bad_request);
  EXPECT_EQ(subscribe(kViewer, "a//b"), Status::bad_request);
  EXPECT_EQ(advertise_failure(kRobot, std::string(256, 'a')), Status::bad_request);
  EXPECT_EQ(topics_.by_name().size(), 0u);
}

TEST_F(ServicesTest, WhoLeavesTakesEverythingAlong) {
  advertise(kRobot, "robot/odom");
  advertise(kViewer, "viewer/view");
  subscribe(kViewer, "robot/odom");
  subscribe(kRobot, "viewer/view");
  take_words();
  services_.node_left(kRobot, now_, effects_);
  EXPECT_THAT(take_words(), ElementsAre("member 1 of 2", "subscribers viewer/view", "group 1",
                                        "moved robot/odom"));
  services_.node_left(kViewer, now_, effects_);
  EXPECT_EQ(topics_.by_name().size(), 2u) << "their groups are kept for a grace time";
  topics_.tick(now_ + milliseconds{limits_.grace_ms}, effects_);
  EXPECT_EQ(topics_.by_name().size(), 0u);
  EXPECT_TRUE(topics_.groups().empty());
}

TEST_F(ServicesTest, ANodeMaySubscribeToItselfAndLeave) {
  advertise(kRobot, "robot/odom");
  subscribe(kRobot, "robot/odom");
  services_.node_left(kRobot, now_, effects_);
  topics_.tick(now_ + milliseconds{limits_.grace_ms}, effects_);
  EXPECT_EQ(topics_.by_name().size(), 0u);
}

TEST_F(ServicesTest, AReturnedNodeKeepsWhatItDeclaresAgain) {
  advertise(kRobot, "robot/odom");
  advertise(kRobot, "robot/scan");
  subscribe(kRobot, "x/a");
  subscribe(kRobot, "x/b");
  take_words();
  services_.node_returned(kRobot, effects_);
  EXPECT_EQ(advertise(kRobot, "robot/odom"), GroupIndex{1});
  EXPECT_EQ(subscribe(kRobot, "x/b"), Status::done);
  EXPECT_THAT(take_words(), IsEmpty());
  services_.drop_undeclared(kRobot, now_, effects_);
  EXPECT_THAT(take_words(), ElementsAre("group 2"));
  EXPECT_TRUE(topics_.find_group(GroupIndex{1})->provided());
  EXPECT_EQ(services_.services_of(kRobot), 1u);
  EXPECT_EQ(topics_.by_name().size(), 3u);
}

TEST_F(ServicesTest, WhatANodeAcceptsIsAwayUntilItIsAdvertisedAgain) {
  advertise(kRobot, "robot/drive", commands());
  advertise(kRobot, "robot/odom");
  subscribe(kViewer, "robot/drive");
  subscribe(kViewer, "robot/odom");
  take_words();
  services_.node_away(kRobot, effects_);
  EXPECT_THAT(take_words(), ElementsAre("moved robot/drive", "away 1"));
  services_.node_returned(kRobot, effects_);
  EXPECT_THAT(take_words(), IsEmpty()) << "it has not accepted it yet";
  EXPECT_EQ(advertise(kRobot, "robot/odom"), GroupIndex{2});
  EXPECT_TRUE(topics_.find_group(GroupIndex{1})->service->provider_away);
  take_words();
  EXPECT_EQ(advertise(kRobot, "robot/drive", commands()), GroupIndex{1});
  EXPECT_THAT(take_words(), ElementsAre("moved robot/drive", "there 1"));
}

// The hub may hear of the new connection first.
TEST_F(ServicesTest, WhatANodeAcceptsIsAwayWhenANewConnectionReplacesItsOwn) {
  advertise(kRobot, "robot/drive", commands());
  take_words();
  services_.node_returned(kRobot, effects_);
  EXPECT_THAT(take_words(), ElementsAre("away 1"));
}

TEST_F(ServicesTest, NobodyIsAwayWhoAcceptsNothingAnyMore) {
  advertise(kRobot, "robot/drive", commands());
  services_.node_away(kRobot, effects_);
  services_.node_returned(kRobot, effects_);
  services_.drop_undeclared(kRobot, now_, effects_);
  EXPECT_FALSE(topics_.find_group(GroupIndex{1})->service->provider_away);
  advertise(kLogger, "robot/drive", commands());
  EXPECT_FALSE(topics_.find_group(GroupIndex{1})->service->provider_away);
}

TEST_F(ServicesTest, OneThatIsAcceptedOnOtherTermsIsThere) {
  advertise(kRobot, "robot/drive", commands());
  services_.node_away(kRobot, effects_);
  services_.node_returned(kRobot, effects_);
  ServiceTerms other = commands();
  other.instance = 5;
  EXPECT_EQ(advertise(kRobot, "robot/drive", other), GroupIndex{2});
  EXPECT_FALSE(topics_.find_group(GroupIndex{2})->service->provider_away);
}

TEST_F(ServicesTest, ARenamedNodeProvidesNothingUnderItsOldName) {
  advertise(kRobot, "robot/odom");
  subscribe(kRobot, "x/a");
  services_.node_renamed(kRobot, now_, effects_);
  EXPECT_EQ(services_.services_of(kRobot), 0u);
  EXPECT_FALSE(topics_.find_group(GroupIndex{1})->provided());
}

TEST_F(ServicesTest, ARenumberedNodeKeepsItsGroupsAndSubscriptions) {
  EXPECT_EQ(advertise(kRobot, "robot/odom"), GroupIndex{1});
  EXPECT_EQ(subscribe(kRobot, "robot/odom"), Status::done);
  EXPECT_EQ(subscribe(kViewer, "robot/odom"), Status::done);
  take_words();
  services_.node_renumbered(kRobot, NodeIndex{40}, effects_);
  EXPECT_THAT(take_words(), ElementsAre("group 1", "moved robot/odom", "member 40 of 1"));
  EXPECT_THAT(topics_.find_group(GroupIndex{1})->subscribers, ElementsAre(kViewer, NodeIndex{40}));
  services_.node_renumbered(kViewer, NodeIndex{41}, effects_);
  EXPECT_THAT(take_words(), ElementsAre("member 41 of 1")) << "in case its turn to join passed";
}

TEST_F(ServicesTest, ASubscriberThatIsRenumberedKeepsItsTerms) {
  EXPECT_EQ(advertise(kRobot, "robot/odom"), GroupIndex{1});
  EXPECT_EQ(subscribe(kViewer, "robot/odom"), Status::done);
  EXPECT_TRUE(services_.subscribe(kViewer, "robot/odom", {.interval_us = 1000}, effects_));
  services_.node_renumbered(kViewer, NodeIndex{40}, effects_);
  const Topic& topic = *topics_.find_group(GroupIndex{1});
  ASSERT_TRUE(topic.pace_of(NodeIndex{40}));
  EXPECT_EQ(topic.pace_of(NodeIndex{40})->interval_us, 1000u);
  EXPECT_THAT(topic.once_plain, ElementsAre(NodeIndex{40}));
  EXPECT_FALSE(topic.pace_of(kViewer)) << "the next one of that id asked for nothing";
  take_words();
  EXPECT_TRUE(services_.subscribe(NodeIndex{40}, "robot/odom", {.interval_us = 1000}, effects_));
  EXPECT_THAT(take_words(), IsEmpty()) << "declared again, the same";
}

TEST_F(ServicesTest, CountsWhatASubscriberMissesUntilItEnds) {
  for (const char* name : {"robot/odom", "robot/map"}) {
    advertise(kRobot, name);
    EXPECT_EQ(subscribe(kViewer, name), Status::done);
  }
  const auto group = [](std::uint32_t index) { return make_id(HubId{7}, GroupIndex{index}); };
  services_.note_missed(kViewer, {group(1), 3});
  services_.note_missed(kViewer, {group(2), 4});
  services_.note_missed(kLogger, {group(1), 5});
  services_.note_missed(kViewer, {group(9), 5});
  EXPECT_EQ(services_.missed_by(kViewer), 7u);
  EXPECT_EQ(services_.missed_by(kLogger), 0u) << "it has not subscribed";
  services_.node_renumbered(kViewer, NodeIndex{40}, effects_);
  EXPECT_EQ(services_.missed_by(NodeIndex{40}), 7u);
  EXPECT_FALSE(services_.unsubscribe(NodeIndex{40}, "robot/odom", now_, effects_));
  EXPECT_EQ(services_.missed_by(NodeIndex{40}), 4u);
  EXPECT_EQ(subscribe(NodeIndex{40}, "robot/odom"), Status::done);
  EXPECT_EQ(services_.missed_by(NodeIndex{40}), 4u) << "it begins anew";
}

TEST_F(ServicesTest, ASubscriberOfAStreamIsPacedOnlyIfItWantsAWindowOrARate) {
  EXPECT_EQ(advertise(kRobot, "robot/odom"), GroupIndex{1});
  EXPECT_TRUE(services_.subscribe(kLogger, "robot/odom", {.window = 2, .depth = 3}, effects_));
  EXPECT_THAT(take_words(),
              ElementsAre("group 1", "member 3 of 1", "pace 3 of 1: 2/3", "subscribers robot/odom"))
      << "a window is of every delivery";
  EXPECT_FALSE(services_.unsubscribe(kLogger, "robot/odom", now_, effects_));
  take_words();
  EXPECT_TRUE(services_.subscribe(kViewer, "robot/odom", {.depth = 3}, effects_));
  EXPECT_THAT(take_words(), ElementsAre("member 2 of 1", "subscribers robot/odom"));
  EXPECT_TRUE(services_.subscribe(kViewer, "robot/odom", {.interval_us = 1000}, effects_));
  EXPECT_THAT(take_words(), ElementsAre("member 2 of 1", "pace 2 of 1: 0/1, once plain"));
  EXPECT_THAT(topics_.find_group(GroupIndex{1})->once_plain, ElementsAre(kViewer))
      << "until then it gets everything";
  // It stays paced: what is held for it goes before what comes.
  EXPECT_TRUE(services_.subscribe(kViewer, "robot/odom", {}, effects_));
  EXPECT_THAT(take_words(), ElementsAre("pace 2 of 1: 0/1, once plain"));
  EXPECT_TRUE(topics_.find_group(GroupIndex{1})->pace_of(kViewer));
  EXPECT_FALSE(services_.unsubscribe(kViewer, "robot/odom", now_, effects_));
  EXPECT_THAT(take_words(),
              ElementsAre("member 2 of 1", "no pace 2 of 1", "subscribers robot/odom"));
  // A subscriber that begins again begins as any other.
  EXPECT_EQ(subscribe(kViewer, "robot/odom"), Status::done);
  EXPECT_THAT(take_words(), ElementsAre("member 2 of 1", "subscribers robot/odom"));
  EXPECT_FALSE(topics_.find_group(GroupIndex{1})->pace_of(kViewer));
}

}  // namespace
}  // namespace gimnet::hub
