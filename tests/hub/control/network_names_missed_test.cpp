#include <gtest/gtest.h>

#include "tests/hub/control/support/named_hubs.hpp"

namespace gimnet::hub {
namespace {

namespace ns = proto::ns;

TEST_F(NetworkNamesTest, TellsOtherHubsOfServicesWhoseMessagesWereMissedHere) {
  Session& asker = here_.join("asker");
  here_.advertise(asker, "asker/own");
  Session& robot = there_.join("robot");
  there_.advertise(robot, "robot/odom");
  there_.advertise(robot, "robot/scan");
  connect();
  const auto told = [&](bool missed) {
    ns::ServicesRequest wanted;
    wanted.missed = missed;
    std::vector<std::string> names;
    const auto page =
        here_.ask<ns::ServicesAnswer>(handle_services, asker, wanted, true);  // as from afar
    for (const ns::ServiceRecord& each : page->services)
      names.push_back(each.name + " " + std::to_string(each.missed));
    return names;
  };
  for (const char* const name : {"robot/odom", "robot/scan"}) {
    ASSERT_TRUE(
        here_.ask<ns::SubscribeAnswer>(handle_subscribe, asker, ns::Subscribe{.name = name}));
  }
  EXPECT_EQ(told(true), std::vector<std::string>{"asker/own 0"});
  here_.membership.services().note_missed(asker.index, {make_id<GroupId>(HubId{9}, 2), 5});
  EXPECT_EQ(told(true), (std::vector<std::string>{"asker/own 0", "robot/scan 5"}));
  EXPECT_EQ(told(false), std::vector<std::string>{"asker/own 0"});
}

}  // namespace
}  // namespace gimnet::hub
