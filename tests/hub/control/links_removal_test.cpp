#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "hub/control/links.hpp"
#include "tests/hub/control/support/link_rig.hpp"

// Links that an administrator removes.

namespace gimnet::hub {
namespace {

using proto::GoodbyeCode;
using std::chrono::milliseconds;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr HubId kA{1};
constexpr HubId kB{2};

TEST(LinksRemoval, ARemovedOneCarriesWhatIsUnderWayWhileRoutesMoveToAnother) {
  LinkedRigs hubs(LinkRig::dialling("first", 5));
  hubs.link();
  const std::uint32_t first = hubs.a.routes.find(kB).link.generation;
  ASSERT_EQ(hubs.b.links.add(LinkRig::dialling("second", 3).dial.front()), "");
  LinkedRigs::carry(hubs.a, hubs.b);
  hubs.connect();
  const SessionRef second = hubs.b.attached().session;
  for (int i = 0; i < 3; ++i) hubs.pass(milliseconds{100});
  ASSERT_NE(hubs.a.routes.find(kB).link.generation, first);

  ASSERT_EQ(hubs.b.links.remove("second"), "");
  EXPECT_EQ(hubs.b.links.remove("second"), "") << "it ends";
  EXPECT_NE(hubs.b.links.set_cost("second", 2), "");
  const auto closed = hubs.b.shards.all<CloseCommand>();
  ASSERT_THAT(closed, SizeIs(1));
  EXPECT_EQ(closed[0]->session.generation, second.generation);
  EXPECT_GE(closed[0]->quiet_ms, 250u);
  EXPECT_EQ(closed[0]->most_ms, 2'000u);
  EXPECT_NE(closed[0]->sentence.find("an administrator of the other hub"), std::string::npos);
  for (int i = 0; i < 3; ++i) hubs.pass(milliseconds{100});
  EXPECT_EQ(hubs.a.routes.find(kB).link.generation, first) << "the other end heard of the cost";
  EXPECT_NE(hubs.b.routes.find(kA).link.generation, second.generation);
  EXPECT_THAT(hubs.b.shards.all<ReleaseCommand>(), IsEmpty());

  hubs.b.detach(hubs.b.attached());
  EXPECT_THAT(hubs.b.shards.all<ReleaseCommand>(), SizeIs(1));
  EXPECT_THAT(hubs.b.links.all(), SizeIs(1)) << "it is not dialled again";
  EXPECT_NE(hubs.b.links.remove("second"), "") << "there is none any more";
}

TEST(LinksRemoval, ANameIsFreeOnceItsLinkHasEnded) {
  LinkedRigs hubs(LinkRig::dialling("up", 5));
  hubs.link();
  ASSERT_EQ(hubs.b.links.remove("up"), "");
  const DialledLink again = LinkRig::dialling("up", 7).dial.front();
  EXPECT_EQ(hubs.b.links.add(again), "link 'up' is being removed; try again in 2 s");
  EXPECT_THAT(hubs.b.shards.all<ReleaseCommand>(), IsEmpty()) << "it carries what is under way";
  hubs.b.detach(hubs.b.attached());
  EXPECT_EQ(hubs.b.links.add(again), "");
}

TEST(LinksRemoval, ARemovedOneIsGoneOnceItBreaksOrItsHubLeaves) {
  for (const bool restarted : {false, true}) {
    LinkedRigs hubs(LinkRig::dialling("up", 5));
    hubs.link();
    const std::size_t dialled = hubs.b.dialled.size();
    ASSERT_EQ(hubs.b.links.remove("up"), "");
    if (restarted) {
      hubs.b.pass(milliseconds{3'000});  // nothing is heard
      LinkRig again(1, LinkRig::dialling(), 777);
      again.links.tick(again.moment());
      static_cast<void>(hubs.b.admit(again.dialled.back().hello));
      EXPECT_EQ(hubs.b.shards.all<CloseCommand>().back()->code, GoodbyeCode::replaced);
      ASSERT_THAT(hubs.b.links.all(), SizeIs(1));
      EXPECT_FALSE(hubs.b.links.all().begin()->second->is_dialled());
    } else {
      hubs.b.detach(hubs.b.attached());
      EXPECT_THAT(hubs.b.links.all(), IsEmpty());
    }
    hubs.b.pass(milliseconds{5'000});
    EXPECT_EQ(hubs.b.dialled.size(), dialled);
  }
}

TEST(LinksRemoval, AHubThatWillEndSaysThatItsLinksCostMost) {
  LinkedRigs hubs(LinkRig::dialling("up", 5));
  hubs.link();
  EXPECT_EQ(hubs.b.links.announce_end(hubs.b.moment()), milliseconds{0})
      << "nothing comes through a hub with one neighbour";
  for (int i = 0; i < 3; ++i) hubs.pass(milliseconds{100});
  EXPECT_EQ(hubs.a.links.network().map().ways().front().cost, 65'535u);
  EXPECT_TRUE(hubs.a.routes.find(kB).exists());
  EXPECT_TRUE(hubs.b.routes.find(kA).exists());
}

}  // namespace
}  // namespace gimnet::hub
