#include "hub/control/network_names.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "tests/hub/control/support/named_hubs.hpp"

namespace gimnet::hub {
namespace {

using namespace std::chrono_literals;
using proto::Status;
using std::chrono::milliseconds;
namespace ns = proto::ns;

ns::Watch watch_of_all() {
  ns::Watch watch;
  watch.watch = 1;
  return watch;
}

TEST_F(NetworkNamesTest, AnotherHubsNodesAreResolvedAndReversed) {
  const Session& asker = here_.join("asker");
  const Session& robot = there_.join("robot");
  const NodeId id = make_id(HubId{9}, robot.index);
  const auto alone = here_.ask<ns::ResolveAnswer>(handle_resolve, asker, ns::Resolve{"robot"});
  EXPECT_EQ(alone.error().status, Status::not_found);
  EXPECT_FALSE(alone.error().learning);
  connect();
  const auto found = here_.ask<ns::ResolveAnswer>(handle_resolve, asker, ns::Resolve{"robot"});
  ASSERT_TRUE(found);
  EXPECT_EQ(*found, (ns::ResolveAnswer{id, ns::NameStanding::held, true}));
  EXPECT_TRUE(
      here_.ask<ns::ResolveAnswer>(handle_resolve, asker, ns::Resolve{"nobody"}).error().learning);
  here_.now += NameExchange::kLearning;
  EXPECT_FALSE(here_.ask<ns::ResolveAnswer>(handle_resolve, asker, ns::Resolve{"robot"})->learning);
  EXPECT_EQ(here_.ask<ns::ReverseAnswer>(handle_reverse, asker, ns::Reverse{id})->name, "robot");
  EXPECT_FALSE(here_.ask<ns::ResolveAnswer>(handle_resolve, asker, ns::Resolve{"robot"}, true))
      << "of this hub's own names";
}

TEST_F(NetworkNamesTest, NamesOfAnotherHubThatDoNotFitAreToldAndStopNoOwnOnes) {
  here_.limits.names_bytes = 1 << 20;
  connect();
  for (int i = 0; i < 2'000; ++i) there_.join(std::string(200, 'n') + std::to_string(i));
  there_.join("one/more");
  set_log_level(LogLevel::warning);
  const auto logged = [&](milliseconds later) {
    here_.now += later;
    testing::internal::CaptureStderr();
    connect();
    return testing::internal::GetCapturedStderr();
  };
  const std::string first = logged(0s);
  EXPECT_NE(first.find("no room for all names of hub 9 (far)"), std::string::npos) << first;
  const std::uint64_t refused = here_.names.copies()->refused();
  EXPECT_EQ(logged(59s), "") << "once a minute";
  EXPECT_GT(here_.names.copies()->refused(), refused);
  EXPECT_NE(logged(1s).find("no room"), std::string::npos);
  const Session& own = here_.join("own");
  EXPECT_EQ(own.name, "own");
  const auto denied = here_.ask<ns::ResolveAnswer>(handle_resolve, own, ns::Resolve{"one/more"});
  ASSERT_FALSE(denied);
  EXPECT_NE(denied.error().sentence.find("names_bytes"), std::string::npos);
}

TEST_F(NetworkNamesTest, ANodeThatIsAwayOrUnreachableIsSaidToBe) {
  const Session& asker = here_.join("asker");
  Session& robot = there_.join("robot");
  connect();
  there_.lose(robot);
  settle();
  const auto standing = [&] {
    return here_.ask<ns::ResolveAnswer>(handle_resolve, asker, ns::Resolve{"robot"})->standing;
  };
  EXPECT_EQ(standing(), ns::NameStanding::away);
  here_.names.set_reachable(NetworkMap(HubIdentity{}), RecordStore{}, here_.now);
  EXPECT_EQ(standing(), ns::NameStanding::unreachable);
}

// Those who send there are told, and those who watch are not.
TEST_F(NetworkNamesTest, AServiceThatAcceptsIsAwayAtAllHubs) {
  const Session& sender = here_.join("sender");
  Session& robot = there_.join("robot");
  ServiceTerms commands;
  commands.direction = ns::Direction::accepts;
  there_.advertise(robot, "robot/drive", commands);
  connect();
  const auto is_away = [&] {
    return here_.ask<ns::SubscribeAnswer>(handle_subscribe, sender, ns::Subscribe{"robot/drive"})
        ->away;
  };
  EXPECT_FALSE(is_away());
  ASSERT_TRUE(here_.watches.watch(sender.index, watch_of_all()));
  static_cast<void>(here_.watched());
  here_.moved_services.clear();
  there_.lose(robot);
  settle();
  EXPECT_EQ(here_.moved_services, std::vector<std::string>{"robot/drive"});
  EXPECT_TRUE(is_away());
  there_.advertise(robot, "robot/drive", commands);
  settle();
  EXPECT_EQ(here_.moved_services, (std::vector<std::string>{"robot/drive", "robot/drive"}));
  EXPECT_FALSE(is_away());
  const auto away = std::to_string(static_cast<int>(ns::ChangeKind::away)) + " robot";
  EXPECT_EQ(here_.watched(), std::vector<std::string>{away});
}

TEST_F(NetworkNamesTest, ListsGoThroughAllHubsInPages) {
  const Session& asker = here_.join("a");
  const Session& last = here_.join("b");
  const Session& robot = there_.join("robot/1");
  there_.join("robot/2");
  here_.advertise(last, "b/odom");
  there_.advertise(robot, "robot/1/odom");
  connect();
  for (Side* side : {&here_, &there_}) {
    std::vector<std::string> names;
    ns::List wanted;
    for (bool more = true; more;) {
      const auto page = side->ask<ns::ListAnswer>(handle_list, asker, wanted);
      ASSERT_TRUE(page);
      EXPECT_LE(page->nodes.size(), 2u);
      for (const ns::NodeRecord& each : page->nodes) names.push_back(each.name);
      more = page->more;
      wanted.after = page->next;
    }
    EXPECT_EQ(names, (std::vector<std::string>{"a", "b", "robot/1", "robot/2"}));
    const auto services =
        side->ask<ns::ServicesAnswer>(handle_services, asker, ns::ServicesRequest{});
    ASSERT_TRUE(services);
    ASSERT_EQ(services->services.size(), 2u);
    EXPECT_EQ(services->services[1].name, "robot/1/odom");
  }
  ns::List of_robots;
  of_robots.pattern = "robot/*";
  const auto found = here_.ask<ns::ListAnswer>(handle_list, asker, of_robots);
  ASSERT_EQ(found->nodes.size(), 2u);
  EXPECT_EQ(found->nodes[0].hub, HubId{9});
  EXPECT_EQ(found->nodes[0].hub_name, "far");
  EXPECT_EQ(here_.ask<ns::ListAnswer>(handle_list, asker, ns::List{}, true)->nodes.size(), 2u);
}

TEST_F(NetworkNamesTest, ASubscriberHearsOfAServiceOfAnotherHub) {
  const Session& asker = here_.join("asker");
  Session& robot = there_.join("robot");
  connect();
  const auto before =
      here_.ask<ns::SubscribeAnswer>(handle_subscribe, asker, ns::Subscribe{.name = "robot/odom"});
  ASSERT_TRUE(before);
  EXPECT_EQ(before->provider, NodeId{});
  here_.moved_services.clear();
  there_.advertise(robot, "robot/odom");
  settle();
  EXPECT_EQ(here_.moved_services, std::vector<std::string>{"robot/odom"});
  const auto after =
      here_.ask<ns::SubscribeAnswer>(handle_subscribe, asker, ns::Subscribe{.name = "robot/odom"});
  ASSERT_TRUE(after);
  EXPECT_EQ(after->provider, make_id(HubId{9}, robot.index));
  const Topic* topic = here_.membership.topics().find_group(after->group);
  ASSERT_NE(topic, nullptr) << "its messages cross links";
  EXPECT_EQ(topic->away->group, make_id<GroupId>(HubId{9}, 1));
  there_.withdraw(robot, "robot/odom");
  settle();
  EXPECT_EQ(here_.membership.topics().find_group(after->group), nullptr);
  EXPECT_EQ(here_.moved_services.size(), 2u);
}

TEST_F(NetworkNamesTest, ASubscriberOfAnotherHubsServiceIsPacedAsItsTermsSay) {
  const Session& asker = here_.join("asker");
  Session& robot = there_.join("robot");
  connect();
  ServiceTerms terms;
  terms.delivery = ns::Delivery::sync;
  terms.window = 4;
  terms.retain = true;
  there_.advertise(robot, "robot/scan", terms);
  settle();
  const auto answer = here_.ask<ns::SubscribeAnswer>(
      handle_subscribe, asker, ns::Subscribe{.name = "robot/scan", .window = 2});
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->window, 2u);
  EXPECT_TRUE(answer->retain);
  const Topic* topic = here_.membership.topics().find("robot/scan");
  EXPECT_TRUE(topic->retains());
  EXPECT_EQ(topic->window_of(asker.index), 2u);
  terms.window = 1;
  there_.advertise(robot, "robot/scan", terms);
  settle();
  EXPECT_EQ(topic->window_of(asker.index), 1u) << "another group, with another window";
  EXPECT_EQ(here_.membership.topics().find_group(answer->group), nullptr);
}

TEST_F(NetworkNamesTest, OfTwoHoldersOneLosesItsName) {
  here_.join("robot");
  Session& loser = there_.join("robot");
  set_log_level(LogLevel::warning);
  testing::internal::CaptureStderr();
  connect();
  const std::string logged = testing::internal::GetCapturedStderr();
  EXPECT_NE(logged.find("node 5.1 of hub 5 (far) has the name, since its id is the lower one"),
            std::string::npos)
      << logged;
  EXPECT_TRUE(here_.lost_names.empty());
  EXPECT_EQ(there_.lost_names, std::vector<std::string>{"robot"});
  EXPECT_EQ(loser.name, "");
  EXPECT_EQ(there_.names.copies()->find("robot")->hub, HubId{5});
}

TEST_F(NetworkNamesTest, WatchersAreToldOfAllHubs) {
  const Session& asker = here_.join("asker");
  Session& robot = there_.join("robot");
  connect();
  ASSERT_TRUE(here_.ask<ns::WatchAnswer>(handle_watch, asker, watch_of_all()));
  EXPECT_EQ(here_.watched(), (std::vector<std::string>{"1 asker", "1 robot"}));
  there_.advertise(robot, "robot/odom");
  settle();
  EXPECT_EQ(here_.watched(), std::vector<std::string>{"9 robot/odom"});
  Effects effects;
  there_.membership.connection_ended(robot, {true, proto::GoodbyeCode::done, ""}, there_.now,
                                     effects);
  there_.carry_out(effects);
  settle();
  EXPECT_EQ(here_.watched(), (std::vector<std::string>{"10 robot/odom", "4 robot"}));
}

TEST_F(NetworkNamesTest, WatchersBeginAgainWhenAHubIsForgotten) {
  const Session& asker = here_.join("asker");
  there_.join("robot");
  connect();
  ASSERT_TRUE(here_.ask<ns::WatchAnswer>(handle_watch, asker, watch_of_all()));
  (void)here_.watched();
  here_.names.set_reachable(NetworkMap(HubIdentity{}), RecordStore{}, here_.now);
  here_.now += milliseconds(here_.limits.grace_ms);
  EXPECT_LE(*here_.names.next_due(), here_.now);
  (void)here_.names.take_sendings(here_.now);
  settle();
  EXPECT_EQ(here_.watched(), std::vector<std::string>{"1 asker"});
}

TEST_F(NetworkNamesTest, AHubThatHasHadNoLinkKeepsNoCopies) {
  here_.join("robot");
  EXPECT_EQ(here_.names.copies(), nullptr);
  EXPECT_FALSE(here_.names.next_due());
  connect();
  EXPECT_EQ(here_.names.copies()->size(), 1u);
}

}  // namespace
}  // namespace gimnet::hub
