#include "hub/control/link_roster.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace gimnet::hub {
namespace {

using std::chrono::milliseconds;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

DialledLink named(const std::string& name) {
  DialledLink link;
  link.address.host = "127.0.0.1";
  link.address.port = 7450;
  link.name = name;
  return link;
}

TEST(LinkRoster, FindsALinkByNumberSessionAndName) {
  LinkRoster table;
  HubLink& link = table.add(named("up"));
  EXPECT_EQ(table.find(link.number()), &link);
  EXPECT_EQ(table.find("up"), &link);
  EXPECT_EQ(table.find("down"), nullptr);
  table.give_place(link, Place{ShardIndex{0}, ConnectionSlot{3}, 9});
  EXPECT_EQ(table.find(SessionRef{ConnectionSlot{3}, 9}), &link);
  EXPECT_EQ(table.take_place(link).generation, 9u);
  EXPECT_EQ(table.find(SessionRef{ConnectionSlot{3}, 9}), nullptr);
  EXPECT_FALSE(link.place);
  table.forget(link.number());
  EXPECT_EQ(table.find("up"), nullptr);
}

TEST(LinkRoster, ADialledLinkGoesBeforeAnAcceptedOneOfThatName) {
  LinkRoster table;
  HubLink& accepted = table.add_accepted("up");
  EXPECT_EQ(table.find("up"), &accepted);
  HubLink& dialled = table.add(named("up"));
  EXPECT_NE(accepted.number(), dialled.number());
  EXPECT_EQ(table.find("up"), &dialled);
}

TEST(LinkRoster, KnowsAnAcceptedLinkByItsDialler) {
  LinkRoster table;
  HubLink& link = table.add_accepted("up");
  proto::HubIntroduction said;
  said.hub = {HubId{7}, {}};
  said.hub.unique.bytes[0] = 7;
  link.begin_connection(said, {}, milliseconds{0});
  EXPECT_EQ(table.find_accepted(said.hub.unique, "up"), &link);
  EXPECT_EQ(table.find_accepted(said.hub.unique, "down"), nullptr);
  EXPECT_EQ(table.find_accepted({}, "up"), nullptr);
}

TEST(LinkRoster, SaysWhereALinkOfTheOtherSideIsChanged) {
  LinkRoster table;
  HubLink& link = table.add_accepted("up");
  proto::HubIntroduction said;
  said.hub = {HubId{7}, {}};
  said.hub_name = "lab";
  link.begin_connection(said, {}, milliseconds{0});
  for (const char* name : {"up", "from hub 7"}) {
    const auto found = table.to_change(name);
    ASSERT_FALSE(found);
    EXPECT_EQ(found.error().sentence, "hub 7 'lab' dials that link; change it there, as 'up'");
  }
  table.add_accepted("second").begin_connection(said, {}, milliseconds{0});
  EXPECT_EQ(table.to_change("from hub 7").error().sentence,
            "hub 7 'lab' dials that link; change it there, as 'up' or 'second'");
  EXPECT_EQ(table.to_change("from hub 8").error().sentence,
            "there is no link 'from hub 8'; see gimnet links");
  HubLink& dialled = table.add(named("up"));
  EXPECT_EQ(*table.to_change("up"), &dialled);
}

TEST(LinkRoster, TellsWhichEndedLongAgo) {
  LinkRoster table;
  table.add(named("dialled"));
  const HubLink& link = table.add_accepted("up");
  EXPECT_THAT(table.long_ended(milliseconds{5}), IsEmpty()) << "its end is seen here";
  EXPECT_THAT(table.long_ended(milliseconds{4} + HubLink::kEndedShown), IsEmpty());
  EXPECT_THAT(table.long_ended(milliseconds{5} + HubLink::kEndedShown), ElementsAre(link.number()));
}

}  // namespace
}  // namespace gimnet::hub
