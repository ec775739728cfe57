#include "hub/control/network_overview.hpp"

#include <gtest/gtest.h>

#include "base/endian.hpp"
#include "proto/control/route_groups.hpp"
#include "tests/hub/control/support/link_rig.hpp"

namespace gimnet::hub {
namespace {

using proto::ctrl::LinkState;
using std::chrono::milliseconds;

TEST(NetworkOverview, ShowsHubsAndLinksOfBothEnds) {
  LinkedRigs hubs;
  const NetworkOverview at_a({hubs.a.facts, hubs.a.links, hubs.a.names, hubs.a.groups, {}});
  const NetworkOverview at_b({hubs.b.facts, hubs.b.links, hubs.b.names, hubs.b.groups, {}});
  ASSERT_EQ(at_b.links().size(), 1u);
  EXPECT_EQ(at_b.links()[0].state, LinkState::dialling);
  hubs.connect();
  EXPECT_EQ(at_b.links()[0].state, LinkState::learning);
  hubs.carry();
  EXPECT_TRUE(hubs.b.links.network().is_up(hubs.b.links.all().begin()->first));
  EXPECT_FALSE(hubs.b.routes.find(HubId{1}).exists());
  EXPECT_EQ(at_b.links()[0].state, LinkState::learning) << "nothing can be sent yet";
  for (int i = 0; i < 3; ++i) hubs.pass(NetworkState::kMapPause);
  EXPECT_TRUE(hubs.b.routes.find(HubId{1}).exists());
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

TEST(NetworkOverview, ShowsNoCostOfALinkThatWasNotMeasured) {
  LinkedRigs hubs;
  hubs.link();
  const NetworkOverview at_a({hubs.a.facts, hubs.a.links, hubs.a.names, hubs.a.groups, {}});
  const auto seen = at_a.hubs();
  ASSERT_EQ(seen.size(), 2u);
  EXPECT_TRUE(seen[1].reachable);
  EXPECT_EQ(seen[1].cost, 0u);
  EXPECT_EQ(at_a.links()[0].cost, 0u);
  ASSERT_EQ(seen[0].neighbours.size(), 1u);
  EXPECT_EQ(seen[0].neighbours[0].cost, 0u);
  for (int i = 0; i < 6; ++i) hubs.pass(milliseconds{250});
  const std::uint16_t cost = at_a.links()[0].cost;
  EXPECT_GE(cost, LinkCost::kLeastMeasured);
  EXPECT_EQ(at_a.hubs()[0].neighbours[0].cost, cost);
  EXPECT_GE(at_a.hubs()[1].cost, cost);
  EXPECT_LT(at_a.hubs()[1].cost, LinkCost::kUnmeasured);
}

TEST(NetworkOverview, ShowsNoHubThatCouldNeverBeReached) {
  LinkedRigs hubs;
  hubs.link();
  const NetworkOverview at_a({hubs.a.facts, hubs.a.links, hubs.a.names, hubs.a.groups, {}});
  proto::route::RecordPart invented;
  invented.sequence = 1;
  for (std::uint16_t id = 100; id < 2'600; ++id) {
    invented.hub.hub = HubId{id};
    hubs.a.links.on_route(hubs.a.attached().session, hubs.a.attached().attachment,
                          proto::encode(invented), hubs.a.moment());
  }
  hubs.a.pass(milliseconds{1'000});
  EXPECT_EQ(hubs.a.links.network().store().records().size(), 2'502u);
  EXPECT_EQ(at_a.hubs().size(), 2u);
}

TEST(NetworkOverview, ShowsALinkThatTheOtherSideGaveUpWithItsCounts) {
  LinkedRigs hubs;
  const NetworkOverview at_a({hubs.a.facts, hubs.a.links, hubs.a.names, hubs.a.groups, {}});
  hubs.link();
  const SessionRef session = hubs.a.attached().session;
  hubs.a.detach(hubs.a.attached(), proto::GoodbyeCode::draining, true);
  hubs.a.pass(milliseconds{1});
  SessionCounts counts;
  counts.accepted = 3;
  counts.unsure = 2;
  hubs.a.links.on_released({session, counts});
  ASSERT_EQ(at_a.links().size(), 1u);
  EXPECT_EQ(at_a.links()[0].state, LinkState::ended);
  EXPECT_EQ(at_a.links()[0].last_error, "the other hub said goodbye: draining");
  EXPECT_EQ(at_a.links()[0].accepted, 3u);
  EXPECT_EQ(at_a.links()[0].unsure, 2u);
}

TEST(NetworkOverview, CountsWhatCameOverLinksAndWasNotTaken) {
  LinkedRigs hubs;
  const NetworkOverview at_a({hubs.a.facts, hubs.a.links, hubs.a.names, hubs.a.groups, {}});
  hubs.link();
  const auto malformed = [&] { return at_a.not_taken()[0].value; };
  EXPECT_EQ(malformed(), 0u);
  // A JOIN without groups.
  proto::Payload join(proto::kControlHeaderSize);
  store_le(join.data(), proto::route::Join::kOperation);
  const AttachCommand& link = hubs.a.attached();
  testing::internal::CaptureStderr();
  hubs.a.links.on_route(link.session, link.attachment, join, hubs.a.moment());
  const std::string logged = testing::internal::GetCapturedStderr();
  EXPECT_NE(logged.find("to hub 2 'hub-2': sent a malformed message"), std::string::npos) << logged;
  EXPECT_STREQ(at_a.not_taken()[0].name, "links.malformed");
  EXPECT_EQ(malformed(), 1u);
}

TEST(NetworkOverview, CountsRecordsOfOneNeighbourThatAnotherOneForged) {
  LinkedRigs hubs;
  hubs.link();
  const SessionRef of_b = hubs.a.attached().session;
  LinkRig liar(3, LinkRig::dialling("liar"));
  liar.links.tick(liar.moment());
  ASSERT_FALSE(hubs.a.admit(liar.dialled.back().hello));
  const AttachCommand& of_liar = hubs.a.attached();
  proto::route::RecordPart forged;
  forged.hub = hubs.b.links.network().self().key;
  forged.instance = hubs.b.facts.instance;
  forged.sequence = 900;
  (void)hubs.a.take_frames();
  testing::internal::CaptureStderr();
  hubs.a.links.on_route(of_liar.session, of_liar.attachment, proto::encode(forged),
                        hubs.a.moment());
  const std::string logged = testing::internal::GetCapturedStderr();
  EXPECT_NE(logged.find("link liar to hub 3 'hub-3': says of hub 2"), std::string::npos) << logged;
  const NetworkOverview at_a({hubs.a.facts, hubs.a.links, hubs.a.names, hubs.a.groups, {}});
  EXPECT_STREQ(at_a.not_taken()[1].name, "links.records_refused");
  EXPECT_EQ(at_a.not_taken()[1].value, 1u);
  std::size_t told = 0;
  for (const SendControlCommand& each : hubs.a.take_frames()) {
    const auto part = read_part({each.frame.begin() + proto::kHeaderSize, each.frame.end()});
    const bool is_forged = part != nullptr && part->said.sequence == 900;
    EXPECT_TRUE(!is_forged || each.session.generation == of_b.generation);
    told += is_forged ? 1 : 0;
  }
  EXPECT_EQ(told, 1u) << "the hub that it is of, alone";
}

}  // namespace
}  // namespace gimnet::hub
