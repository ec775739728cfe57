#include "hub/network/state/network_state.hpp"

#include <gtest/gtest.h>

#include "tests/hub/network/state/support/hub_with_two_links.hpp"

// Which hubs may become neighbours.

namespace gimnet::hub {
namespace {

using namespace test;

TEST_F(HubWithTwoLinks, AdmitsANewcomer) {
  EXPECT_EQ(hub_.admit(identity(7, 77)).admission, LinkAdmission::accept);
  EXPECT_EQ(hub_.admit(two_).admission, LinkAdmission::accept) << "a second link";
}

TEST_F(HubWithTwoLinks, RefusesItselfAndCopies) {
  EXPECT_EQ(hub_.admit(identity(9, 55)).admission, LinkAdmission::is_self);
  EXPECT_EQ(hub_.admit(identity(5, 56)).admission, LinkAdmission::is_copy);
  const auto answer = hub_.admit(identity(2, 23));
  EXPECT_EQ(answer.admission, LinkAdmission::ask_old_link);
  EXPECT_EQ(answer.old_link, kFirst);
  const auto far = identity(8, 88);
  hub_.take_record(kFirst, bytes(far, 1, {{hub_key(2), 10}}), later_);
  hub_.take_record(kFirst, bytes(two_, 2, {{hub_key(5), 10}, {far.key, 10}}), later_);
  hub_.advance(later_);
  EXPECT_EQ(hub_.map().next_hops()[8], kFirst);
  EXPECT_EQ(hub_.admit(identity(8, 89)).admission, LinkAdmission::is_copy);
  EXPECT_EQ(hub_.admit(identity(8, 89)).holder, far.key);
  hub_.end_link(kFirst);
  hub_.advance(later_ + seconds(1));
  EXPECT_EQ(hub_.admit(identity(8, 89)).admission, LinkAdmission::accept)
      << "out of reach: a restart";
}

TEST_F(HubWithTwoLinks, RefusesEachNewcomerWithAnIdThatAnotherHubHas) {
  const HubIdentity worse{hub_key(3, 99), proto::HubInstance{9}, true};
  const HubIdentity better{{HubId{3}, {}}, proto::HubInstance{9}, true};
  for (const HubIdentity& newcomer : {worse, better}) {
    EXPECT_EQ(hub_.admit(newcomer).admission, LinkAdmission::id_taken);
    EXPECT_EQ(hub_.admit(newcomer).holder, three_.key);
  }
  const HubIdentity own{hub_key(5, 99), proto::HubInstance{9}, true};
  EXPECT_EQ(hub_.admit(own).admission, LinkAdmission::id_taken);
  EXPECT_EQ(hub_.admit(own).holder, hub_.self().key);
}

TEST_F(HubWithTwoLinks, AdmitsAHubWithAnIdThatWasFreed) {
  const HubIdentity lost_its_state{hub_key(3, 99), proto::HubInstance{9}, true};
  hub_.end_link(kSecond);
  hub_.advance(later_);
  EXPECT_EQ(hub_.admit(lost_its_state).admission, LinkAdmission::accept);
}

TEST_F(HubWithTwoLinks, AdmitsAFurtherLinkOfOneOfTwoHubsThatMetWithOneId) {
  const HubIdentity twin{hub_key(3, 99), proto::HubInstance{9}, true};
  hub_.take_record(kFirst, bytes(twin, 1, {{two_.key, 10}}), later_);
  hub_.take_record(kFirst, bytes(two_, 2, {{twin.key, 10}, {hub_key(5), 10}}), later_);
  hub_.advance(later_);
  ASSERT_EQ(hub_.map().reachable().size(), 4u);
  EXPECT_EQ(hub_.admit(three_).admission, LinkAdmission::accept) << "it is no newcomer";
  EXPECT_EQ(hub_.admit(twin).admission, LinkAdmission::accept);
  const HubIdentity third{hub_key(3, 98), proto::HubInstance{10}, true};
  EXPECT_EQ(hub_.admit(third).admission, LinkAdmission::id_taken);
}

TEST(NetworkStateAdmission, DrawsAgainForAConfiguredNewcomer) {
  const NetworkState drawn({hub_key(1'500, 9), proto::HubInstance{55}, false}, {});
  const HubIdentity configured{hub_key(1'500, 99), proto::HubInstance{9}, true};
  EXPECT_EQ(drawn.admit(configured).admission, LinkAdmission::draw_again);
  const HubIdentity drawn_too{hub_key(1'500, 99), proto::HubInstance{9}, false};
  EXPECT_EQ(drawn.admit(drawn_too).admission, LinkAdmission::id_taken);
  const HubIdentity lower{hub_key(1'500, 8), proto::HubInstance{9}, false};
  EXPECT_EQ(drawn.admit(lower).admission, LinkAdmission::id_taken) << "nobody has verified it";
}

}  // namespace
}  // namespace gimnet::hub
