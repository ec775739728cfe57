#include "hub/control/network_overview.hpp"

#include <gtest/gtest.h>

#include "tests/hub/control/support/link_rig.hpp"

namespace gimnet::hub {
namespace {

using std::chrono::milliseconds;

TEST(NetworkOverview, ShowsHubsAndLinksOfBothEnds) {
  LinkedRigs hubs;
  const NetworkOverview at_a({hubs.a.facts, hubs.a.links, {}});
  const NetworkOverview at_b({hubs.b.facts, hubs.b.links, {}});
  ASSERT_EQ(at_b.links().size(), 1u);
  EXPECT_EQ(at_b.links()[0].state, LinkState::dialling);
  hubs.connect();
  EXPECT_EQ(at_b.links()[0].state, LinkState::learning);
  hubs.carry();
  for (int i = 0; i < 3; ++i) hubs.pass(NetworkState::kMapPause);
  EXPECT_EQ(at_b.links()[0].state, LinkState::up);
  EXPECT_EQ(at_b.links()[0].hub, HubId{1});
  EXPECT_EQ(at_a.links()[0].name, "up");
  const auto seen = at_a.hubs();
  ASSERT_EQ(seen.size(), 2u);
  EXPECT_EQ(seen[0].hub, HubId{1});
  EXPECT_EQ(seen[0].distance, 0);
  EXPECT_EQ(seen[1].hub, HubId{2});
  EXPECT_EQ(seen[1].name, "hub-2");
  EXPECT_EQ(seen[1].distance, 1);
  EXPECT_EQ(seen[1].via, HubId{2});
  EXPECT_TRUE(seen[1].reachable);
  hubs.a.detach(hubs.a.attached());
  EXPECT_EQ(at_a.links()[0].state, LinkState::away);
  hubs.a.pass(HubLink::kResumeTime);
  hubs.a.pass(milliseconds{100});
  ASSERT_EQ(at_a.hubs().size(), 2u) << "its record is still known";
  EXPECT_FALSE(at_a.hubs()[1].reachable);
}

}  // namespace
}  // namespace gimnet::hub
