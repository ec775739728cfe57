#include "tools/gimnet/member_status.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

// Tests name the members that matter and leave the others at their defaults, on purpose.
#pragma GCC diagnostic ignored "-Wmissing-field-initializers"

namespace gimnet::tool {
namespace {

using ::testing::HasSubstr;

/// Two hubs with one link, whose counts agree.
std::vector<MemberStatus> two_members() {
  LinkRecord dialled{.name = "hall", .hub_id = 2, .state = "up", .dialled = true};
  LinkRecord accepted = dialled;
  accepted.hub_id = 1;
  accepted.dialled = false;
  dialled.delivered = 5;
  accepted.accepted = 5;
  accepted.delivered = 7;
  dialled.accepted = 7;
  return {{1, "lab", {5, 0, 5, 0, 0}, {dialled}, ""}, {2, "hall", {7, 0, 7, 0, 0}, {accepted}, ""}};
}

TEST(MemberStatus, LinksAgreeWithinWhatIsUnsure) {
  std::vector<MemberStatus> members = two_members();
  EXPECT_TRUE(links_agree(members));
  members[1].links[0].accepted = 6;
  EXPECT_FALSE(links_agree(members)) << "more than was delivered";
  members[0].links[0].unsure = 1;
  EXPECT_TRUE(links_agree(members)) << "it may have arrived";
  members[1].links[0].accepted = 4;
  EXPECT_FALSE(links_agree(members)) << "less than was confirmed";
  members = two_members();
  members[0].links[0].accepted = 8;
  EXPECT_FALSE(links_agree(members)) << "the other way";
}

TEST(MemberStatus, ALinkThatCannotBeComparedDoesNotAgree) {
  std::vector<MemberStatus> members = two_members();
  members[1].links.clear();
  EXPECT_FALSE(links_agree(members));
  members = two_members();
  members[1].error = "no answer";
  EXPECT_FALSE(links_agree(members));
  members = two_members();
  members.pop_back();
  EXPECT_FALSE(links_agree(members));
  members[0].links[0].hub_id = 0;
  EXPECT_TRUE(links_agree(members)) << "it never came about";
}

TEST(MemberStatus, ALinkThatDoesNotStandIsNotCompared) {
  std::vector<MemberStatus> members = two_members();
  members[1].links[0].state = "ended";
  members[1].links[0].accepted = 9;
  EXPECT_FALSE(links_agree(members)) << "the other end stands";
  members[0].links[0].state = "dialling";
  EXPECT_TRUE(links_agree(members));
  members[1].links.clear();
  EXPECT_TRUE(links_agree(members)) << "its hub started again";
}

TEST(MemberStatus, ALinkThatEndedDoesNotHideItsSuccessor) {
  std::vector<MemberStatus> members = two_members();
  members[1].links.insert(members[1].links.begin(), members[1].links[0]);
  members[1].links[0].state = "ended";
  members[1].links[0].accepted = 9;
  EXPECT_TRUE(links_agree(members));
}

TEST(MemberStatus, IsAnObjectWithLedgersAndLinks) {
  std::vector<MemberStatus> members = two_members();
  members[1].error = "no answer";
  const std::string json = json_of(members, true);
  EXPECT_THAT(json, ::testing::StartsWith(
                        "{\"exact\":true,\"hubs\":[{\"id\":1,\"name\":\"lab\",\"ledger\":{"
                        "\"accepted\":5,\"copies\":0,\"delivered\":5,\"dropped\":0,\"queued\":0,"
                        "\"exact\":true},\"links\":[{\"name\":\"hall\""));
  EXPECT_THAT(json, HasSubstr("{\"id\":2,\"name\":\"hall\",\"error\":\"no answer\"}"));
  const std::string text = text_of(members, false);
  EXPECT_THAT(text, HasSubstr("hub 1 lab: ledger: 5 accepted + 0 copies = 5 delivered"));
  EXPECT_THAT(text, HasSubstr("hub 2 hall: no answer"));
  EXPECT_THAT(text, HasSubstr("not compared, since not all hubs answered"));
  members[1].error.clear();
  EXPECT_THAT(text_of(members, false), HasSubstr("do not agree"));
  EXPECT_THAT(text_of(members, true), HasSubstr("the counts of all links agree"));
}

}  // namespace
}  // namespace gimnet::tool
