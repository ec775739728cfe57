#include "hub/control/state/services.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/control/ns.hpp"

namespace gimnet::hub {
namespace {

using namespace std::chrono_literals;
using proto::Status;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr NodeIndex kRobot{1};
constexpr NodeIndex kViewer{2};
constexpr NodeIndex kLogger{3};

ServiceTerms odometry() {
  ServiceTerms terms;
  terms.message_type = 5;
  terms.instance = 6;
  terms.delivery = proto::ns::Delivery::latest;
  return terms;
}

/// Effects as short words, in order: "group 1", "moved 2: 0->1", "joined 2 of 1: 1".
std::vector<std::string> words(const Effects& effects) {
  std::vector<std::string> result;
  for (const Effect& effect : effects) {
    if (const auto* group = std::get_if<GroupChanged>(&effect)) {
      result.push_back("group " + std::to_string(group->index.value()));
    } else if (const auto* member = std::get_if<MemberChanged>(&effect)) {
      result.push_back("member " + std::to_string(member->subscriber.value()) + " of " +
                       std::to_string(member->group.value()));
    } else if (const auto* moved = std::get_if<ServiceMovedDue>(&effect)) {
      for (const NodeIndex subscriber : moved->subscribers) {
        result.push_back("moved " + std::to_string(subscriber.value()) + ": " +
                         std::to_string(moved->old_group.value()) + "->" +
                         std::to_string(moved->new_group.value()));
      }
    } else if (const auto* change = std::get_if<SubscriberDue>(&effect)) {
      result.push_back((change->joined ? "joined " : "left ") +
                       std::to_string(change->subscriber.value()) + " of " +
                       std::to_string(change->group.value()) + ": " +
                       std::to_string(change->subscribers_now));
    } else if (const auto* pace = std::get_if<PaceDue>(&effect)) {
      result.push_back("pace " + std::to_string(pace->subscriber.value()) + " of " +
                       std::to_string(pace->group.value()) + ": " +
                       std::to_string(pace->terms.window) + "/" +
                       std::to_string(pace->terms.depth) + (pace->retained ? " retained" : "") +
                       (pace->was_plain ? ", once plain" : ""));
    } else if (const auto* ended = std::get_if<PaceEnded>(&effect)) {
      result.push_back("no pace " + std::to_string(ended->subscriber.value()) + " of " +
                       std::to_string(ended->group.value()) + (ended->group_gone ? ", gone" : ""));
    } else if (const auto* forgotten = std::get_if<RetainedDropped>(&effect)) {
      result.push_back("forget " + std::to_string(forgotten->group.value()));
    } else if (!std::holds_alternative<ServiceNoted>(effect)) {  // those are for watches_test.cpp
      result.emplace_back("other");
    }
  }
  return result;
}

class ServicesTest : public ::testing::Test {
 protected:
  ServicesTest() {
    limits_.services_per_node = 2;
    limits_.subscriptions_per_node = 2;
  }
  GroupIndex advertise(NodeIndex node, const std::string& name,
                       const ServiceTerms& terms = odometry()) {
    const auto done = services_.advertise(node, name, terms, now_, effects_);
    return done ? done->group : kNoGroup;
  }
  Status advertise_failure(NodeIndex node, const std::string& name) {
    const auto done = services_.advertise(node, name, odometry(), now_, effects_);
    return done ? Status::done : done.error().status;
  }
  Status subscribe(NodeIndex node, const std::string& name) {
    const auto done = services_.subscribe(node, name, {}, effects_);
    return done ? Status::done : done.error().status;
  }
  std::vector<std::string> take_words() {
    std::vector<std::string> result = words(effects_);
    effects_.clear();
    return result;
  }

  Limits limits_;
  Services services_{HubId{7}, limits_};
  Effects effects_;
  std::chrono::milliseconds now_{0};
};

TEST_F(ServicesTest, AdvertisingOpensAGroup) {
  EXPECT_EQ(advertise(kRobot, "robot/odom"), GroupIndex{1});
  EXPECT_THAT(take_words(), ElementsAre("group 1"));
  const Topic* topic = services_.find_group(GroupIndex{1});
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
  EXPECT_EQ(services_.find_group(GroupIndex{1})->service->terms.metadata, "wheel encoders");
}

TEST_F(ServicesTest, OtherTermsMeanAnotherGroupThatSubscribersAreToldFirst) {
  advertise(kRobot, "robot/odom");
  subscribe(kViewer, "robot/odom");
  take_words();
  ServiceTerms terms = odometry();
  terms.message_type = 99;
  EXPECT_EQ(advertise(kRobot, "robot/odom", terms), GroupIndex{2});
  EXPECT_THAT(take_words(), ElementsAre("group 1", "moved 2: 1->2", "group 2"));
  EXPECT_EQ(services_.find_group(GroupIndex{1}), nullptr);
  EXPECT_EQ(services_.services_of(kRobot), 1u);
}

TEST_F(ServicesTest, AnotherNodeCannotTakeAService) {
  advertise(kRobot, "robot/odom");
  EXPECT_EQ(advertise_failure(kViewer, "robot/odom"), Status::taken);
}

TEST_F(ServicesTest, SubscribingToAServicePublishesItsGroupBeforeItsProviderIsTold) {
  advertise(kRobot, "robot/odom");
  take_words();
  EXPECT_EQ(subscribe(kViewer, "robot/odom"), Status::done);
  EXPECT_THAT(take_words(), ElementsAre("member 2 of 1", "joined 2 of 1: 1"));
  EXPECT_THAT(services_.find_group(GroupIndex{1})->subscribers, ElementsAre(kViewer));
}

TEST_F(ServicesTest, SubscribingTwiceIsOnce) {
  advertise(kRobot, "robot/odom");
  subscribe(kViewer, "robot/odom");
  take_words();
  EXPECT_EQ(subscribe(kViewer, "robot/odom"), Status::done);
  EXPECT_THAT(take_words(), IsEmpty());
  EXPECT_THAT(services_.find_group(GroupIndex{1})->subscribers, ElementsAre(kViewer));
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
  EXPECT_THAT(take_words(), ElementsAre("moved 2: 0->1", "moved 3: 0->1", "group 1"));
}

TEST_F(ServicesTest, UnsubscribingTellsTheProvider) {
  advertise(kRobot, "robot/odom");
  subscribe(kViewer, "robot/odom");
  take_words();
  EXPECT_FALSE(services_.unsubscribe(kViewer, "robot/odom", effects_));
  EXPECT_THAT(take_words(), ElementsAre("member 2 of 1", "left 2 of 1: 0"));
  const auto again = services_.unsubscribe(kViewer, "robot/odom", effects_);
  ASSERT_TRUE(again);
  EXPECT_EQ(again->status, Status::not_found);
}

TEST_F(ServicesTest, AForgottenNameLeavesNothingBehind) {
  subscribe(kViewer, "robot/odom");
  EXPECT_EQ(services_.topics(), 1u);
  EXPECT_FALSE(services_.unsubscribe(kViewer, "robot/odom", effects_));
  EXPECT_EQ(services_.topics(), 0u);
}

TEST_F(ServicesTest, WithdrawingTellsSubscribersAndKeepsThemWaiting) {
  advertise(kRobot, "robot/odom");
  subscribe(kViewer, "robot/odom");
  take_words();
  EXPECT_FALSE(services_.withdraw(kRobot, GroupIndex{1}, now_, effects_));
  EXPECT_THAT(take_words(), ElementsAre("group 1", "moved 2: 1->0"));
  EXPECT_EQ(advertise(kRobot, "robot/odom"), GroupIndex{2});
  EXPECT_THAT(take_words(), ElementsAre("moved 2: 0->2", "group 2"));
}

TEST_F(ServicesTest, OnlyTheProviderWithdraws) {
  advertise(kRobot, "robot/odom");
  EXPECT_EQ(services_.withdraw(kViewer, GroupIndex{1}, now_, effects_)->status, Status::denied);
  EXPECT_EQ(services_.withdraw(kRobot, GroupIndex{2}, now_, effects_)->status, Status::not_found);
  EXPECT_NE(services_.find_group(GroupIndex{1}), nullptr);
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
  EXPECT_EQ(services_.topics(), 2u);
  EXPECT_EQ(subscribe(kLogger, "x/c"), Status::done);
}

TEST_F(ServicesTest, BadFullNamesAreRefused) {
  EXPECT_EQ(subscribe(kViewer, ""), Status::bad_request);
  EXPECT_EQ(subscribe(kViewer, "a//b"), Status::bad_request);
  EXPECT_EQ(advertise_failure(kRobot, std::string(256, 'a')), Status::bad_request);
  EXPECT_EQ(services_.topics(), 0u);
}

TEST_F(ServicesTest, WhoLeavesTakesEverythingAlong) {
  advertise(kRobot, "robot/odom");
  advertise(kViewer, "viewer/view");
  subscribe(kViewer, "robot/odom");
  subscribe(kRobot, "viewer/view");
  take_words();
  services_.node_left(kRobot, now_, effects_);
  EXPECT_THAT(take_words(),
              ElementsAre("member 1 of 2", "left 1 of 2: 0", "group 1", "moved 2: 1->0"));
  services_.node_left(kViewer, now_, effects_);
  EXPECT_EQ(services_.topics(), 0u);
  EXPECT_TRUE(services_.groups().empty());
}

TEST_F(ServicesTest, ANodeMaySubscribeToItselfAndLeave) {
  advertise(kRobot, "robot/odom");
  subscribe(kRobot, "robot/odom");
  services_.node_left(kRobot, now_, effects_);
  EXPECT_EQ(services_.topics(), 0u);
}

TEST_F(ServicesTest, AReturnedNodeKeepsWhatItDeclaresAgain) {
  advertise(kRobot, "robot/odom");
  advertise(kRobot, "robot/scan");
  subscribe(kRobot, "x/a");
  subscribe(kRobot, "x/b");
  take_words();
  services_.node_returned(kRobot);
  EXPECT_EQ(advertise(kRobot, "robot/odom"), GroupIndex{1});
  EXPECT_EQ(subscribe(kRobot, "x/b"), Status::done);
  EXPECT_THAT(take_words(), IsEmpty());
  services_.drop_undeclared(kRobot, now_, effects_);
  EXPECT_THAT(take_words(), ElementsAre("group 2"));
  EXPECT_NE(services_.find_group(GroupIndex{1}), nullptr);
  EXPECT_EQ(services_.services_of(kRobot), 1u);
  EXPECT_EQ(services_.topics(), 2u);
}

TEST_F(ServicesTest, ARenamedNodeProvidesNothingUnderItsOldName) {
  advertise(kRobot, "robot/odom");
  subscribe(kRobot, "x/a");
  services_.node_renamed(kRobot, now_, effects_);
  EXPECT_EQ(services_.services_of(kRobot), 0u);
  EXPECT_EQ(services_.find_group(GroupIndex{1}), nullptr);
  EXPECT_EQ(services_.topics(), 1u);
}

TEST_F(ServicesTest, AGroupIdRestsBeforeItComesAgain) {
  advertise(kRobot, "robot/odom");
  EXPECT_FALSE(services_.withdraw(kRobot, GroupIndex{1}, now_, effects_));
  EXPECT_EQ(advertise(kRobot, "robot/odom"), GroupIndex{2});
}

ServiceTerms map_in_sync() {
  ServiceTerms terms;
  terms.delivery = proto::ns::Delivery::sync;
  terms.window = 4;
  terms.retain = true;
  return terms;
}

TEST_F(ServicesTest, AGroupIsPublishedBeforeItsMembersArePaced) {
  const SubscriberTerms wanted{.window = 2, .depth = 3};
  EXPECT_TRUE(services_.subscribe(kViewer, "robot/map", wanted, effects_));
  EXPECT_THAT(take_words(), IsEmpty()) << "nobody provides it yet";
  EXPECT_EQ(advertise(kRobot, "robot/map", map_in_sync()), GroupIndex{1});
  EXPECT_THAT(take_words(), ElementsAre("moved 2: 0->1", "group 1", "pace 2 of 1: 2/3 retained"));
  EXPECT_EQ(subscribe(kLogger, "robot/map"), Status::done);
  EXPECT_THAT(take_words(),
              ElementsAre("member 3 of 1", "pace 3 of 1: 4/1 retained", "joined 3 of 1: 2"));
  EXPECT_TRUE(services_.subscribe(kViewer, "robot/map", wanted, effects_));
  EXPECT_THAT(take_words(), IsEmpty()) << "declared again, the same";
  EXPECT_TRUE(services_.subscribe(kViewer, "robot/map", {.window = 9}, effects_));
  EXPECT_THAT(take_words(), ElementsAre("pace 2 of 1: 4/1 retained"))
      << "at most what the service allows";
  EXPECT_FALSE(services_.unsubscribe(kLogger, "robot/map", effects_));
  EXPECT_THAT(take_words(), ElementsAre("member 3 of 1", "no pace 3 of 1", "left 3 of 1: 1"));
  // In the table first: a frame that is read before the last message is forgotten must not make it
  // anew.
  EXPECT_EQ(advertise(kRobot, "robot/map"), GroupIndex{2});
  EXPECT_THAT(take_words(), ElementsAre("group 1", "no pace 2 of 1, gone", "forget 1",
                                        "moved 2: 1->2", "group 2"));
  EXPECT_EQ(advertise(kRobot, "robot/map", map_in_sync()), GroupIndex{3});
  EXPECT_THAT(take_words(),
              ElementsAre("group 2", "moved 2: 2->3", "group 3", "pace 2 of 3: 4/1 retained"));
  EXPECT_FALSE(services_.withdraw(kRobot, GroupIndex{3}, now_, effects_));
  EXPECT_THAT(take_words(),
              ElementsAre("group 3", "no pace 2 of 3, gone", "forget 3", "moved 2: 3->0"));
}

TEST_F(ServicesTest, WhoSubscribesToItselfIsNotToldOfItsNewIdBeforeItKnowsIt) {
  EXPECT_EQ(advertise(kRobot, "robot/odom"), GroupIndex{1});
  EXPECT_EQ(subscribe(kRobot, "robot/odom"), Status::done);
  EXPECT_EQ(subscribe(kViewer, "robot/odom"), Status::done);
  take_words();
  services_.node_renumbered(kRobot, NodeIndex{40}, effects_);
  EXPECT_THAT(take_words(), ElementsAre("group 1"));
  EXPECT_THAT(services_.find_group(GroupIndex{1})->subscribers,
              ElementsAre(kViewer, NodeIndex{40}));
  services_.node_renumbered(kViewer, NodeIndex{41}, effects_);
  EXPECT_THAT(take_words(), ElementsAre("joined 41 of 1: 2", "left 2 of 1: 2"));
}

TEST_F(ServicesTest, ASubscriberThatIsRenumberedKeepsItsTerms) {
  EXPECT_EQ(advertise(kRobot, "robot/odom"), GroupIndex{1});
  EXPECT_EQ(subscribe(kViewer, "robot/odom"), Status::done);
  EXPECT_TRUE(services_.subscribe(kViewer, "robot/odom", {.interval_us = 1000}, effects_));
  services_.node_renumbered(kViewer, NodeIndex{40}, effects_);
  const Topic& topic = *services_.find_group(GroupIndex{1});
  ASSERT_TRUE(topic.pace_of(NodeIndex{40}));
  EXPECT_EQ(topic.pace_of(NodeIndex{40})->interval_us, 1000u);
  EXPECT_THAT(topic.once_plain, ElementsAre(NodeIndex{40}));
  EXPECT_FALSE(topic.pace_of(kViewer)) << "the next one of that id asked for nothing";
  take_words();
  EXPECT_TRUE(services_.subscribe(NodeIndex{40}, "robot/odom", {.interval_us = 1000}, effects_));
  EXPECT_THAT(take_words(), IsEmpty()) << "declared again, the same";
}

TEST_F(ServicesTest, ASubscriberOfAStreamIsPacedOnlyIfItWantsARate) {
  EXPECT_EQ(advertise(kRobot, "robot/odom"), GroupIndex{1});
  EXPECT_TRUE(services_.subscribe(kViewer, "robot/odom", {.window = 2, .depth = 3}, effects_));
  EXPECT_THAT(take_words(), ElementsAre("group 1", "member 2 of 1", "joined 2 of 1: 1"))
      << "a window is of sync(n)";
  EXPECT_TRUE(services_.subscribe(kViewer, "robot/odom", {.interval_us = 1000}, effects_));
  EXPECT_THAT(take_words(), ElementsAre("member 2 of 1", "pace 2 of 1: 0/1, once plain"));
  EXPECT_THAT(services_.find_group(GroupIndex{1})->once_plain, ElementsAre(kViewer))
      << "until then it gets everything";
  // It stays paced: what is held for it goes before what comes.
  EXPECT_TRUE(services_.subscribe(kViewer, "robot/odom", {}, effects_));
  EXPECT_THAT(take_words(), ElementsAre("pace 2 of 1: 0/1, once plain"));
  EXPECT_TRUE(services_.find_group(GroupIndex{1})->pace_of(kViewer));
  EXPECT_FALSE(services_.unsubscribe(kViewer, "robot/odom", effects_));
  EXPECT_THAT(take_words(), ElementsAre("member 2 of 1", "no pace 2 of 1", "left 2 of 1: 0"));
  // Who begins again begins as anybody else.
  EXPECT_EQ(subscribe(kViewer, "robot/odom"), Status::done);
  EXPECT_THAT(take_words(), ElementsAre("member 2 of 1", "joined 2 of 1: 1"));
  EXPECT_FALSE(services_.find_group(GroupIndex{1})->pace_of(kViewer));
}

}  // namespace
}  // namespace gimnet::hub
