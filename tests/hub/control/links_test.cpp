#include "hub/control/links.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/hub/control/support/link_rig.hpp"

namespace gimnet::hub {
namespace {

using proto::GoodbyeCode;
using std::chrono::milliseconds;

constexpr HubId kA{1};
constexpr HubId kB{2};

TEST(Links, BothEndsHaveARouteOnceTheRecordsHaveCome) {
  LinkedRigs hubs;
  hubs.connect();
  EXPECT_FALSE(hubs.a.routes.find(kB).exists()) << "nothing was said yet";
  hubs.carry();
  for (int i = 0; i < 3; ++i) hubs.pass(NetworkState::kMapPause);
  EXPECT_EQ(hubs.a.routes.find(kB).neighbour, kB);
  EXPECT_EQ(hubs.b.routes.find(kA).neighbour, kA);
  EXPECT_EQ(hubs.b.attached().node, make_id<NodeId>(kA, kHubIndex));
  EXPECT_TRUE(hubs.b.attached().link->dialled);
  EXPECT_FALSE(hubs.a.attached().link->dialled);
}

TEST(Links, TheSideThatDialledBegins) {
  LinkedRigs hubs;
  hubs.connect();
  EXPECT_TRUE(hubs.a.take_frames().empty()) << "a refused attempt must not carry all records";
  EXPECT_FALSE(hubs.b.take_frames().empty());
}

TEST(Links, OnlyAHubThatSaysSoTakesThem) {
  LinkRig hub(1, {});
  proto::Hello hello;
  hello.role = proto::Role::hub;
  const auto refusal = hub.admit(hello);
  ASSERT_TRUE(refusal);
  EXPECT_EQ(refusal->code, GoodbyeCode::not_allowed);
  EXPECT_NE(refusal->sentence.find("--accept-links"), std::string::npos);
}

TEST(Links, OfTwoHubsWithOneIdTheNewcomerIsTold) {
  LinkedRigs hubs;
  LinkRig twin(1, LinkRig::dialling());
  twin.links.tick(twin.moment());
  proto::Hello hello = twin.dialled.back().hello;
  hello.introduction->hub.unique.bytes[5] = 9;
  hello.introduction->instance = proto::HubInstance{77};
  const auto refusal = hubs.a.admit(hello);
  ASSERT_TRUE(refusal);
  EXPECT_EQ(refusal->code, GoodbyeCode::id_taken);
  EXPECT_NE(refusal->sentence.find("--hub-id"), std::string::npos);
}

/// The links of a hub whose neighbour says that its hub id is taken.
std::optional<HubId> redrawn_when_taken(bool configured) {
  LinkRig hub(1, LinkRig::dialling());
  hub.facts.id_configured = configured;
  hub.links.tick(hub.moment());
  EXPECT_FALSE(hub.links.redrawn());
  net::NetError error(net::Fault::refused, "hub id 1 is taken");
  error.goodbye = GoodbyeCode::id_taken;
  hub.links.on_dialled(hub.dialled.back().link, error, hub.moment());
  return hub.links.redrawn();
}

TEST(Links, AnIdThatNobodyConfiguredIsDrawnAnewIfItIsTaken) {
  const auto redrawn = redrawn_when_taken(false);
  ASSERT_TRUE(redrawn);
  EXPECT_GE(redrawn->value(), 1'024);
  EXPECT_FALSE(redrawn_when_taken(true));
}

/// A hub whose link that another one dialled ends by GOODBYE id_taken.
std::optional<HubId> redrawn_when_refused(bool configured, bool begun, bool redrawn) {
  LinkRig hub(1, LinkRig::accepting(), 0, configured);
  LinkRig dialler(2, LinkRig::dialling());
  hub.facts.redrawn = redrawn;
  hub.facts.started = hub.now;
  dialler.links.tick(dialler.moment());
  EXPECT_FALSE(hub.admit(dialler.dialled.back().hello));
  const AttachCommand& at = hub.attached();
  const auto mark = proto::encode(proto::route::RecordsEnd{});
  if (begun) hub.links.on_route(at.session, at.attachment, mark, hub.moment());
  hub.detach(at, GoodbyeCode::id_taken, true);
  return hub.links.redrawn();
}

TEST(Links, AHubThatIsDialledDrawsAnewIfItsIdIsTakenThere) {
  EXPECT_TRUE(redrawn_when_refused(false, false, false));
  EXPECT_FALSE(redrawn_when_refused(true, false, false)) << "somebody configured it";
  EXPECT_FALSE(redrawn_when_refused(false, true, false)) << "the other hub has lost its own id";
  EXPECT_FALSE(redrawn_when_refused(false, false, true)) << "once a minute";
}

TEST(Links, ADrawnIdGivesWayToAConfiguredOneOnceAMinute) {
  for (const bool redrawn : {false, true}) {
    LinkRig hub(1'500, LinkRig::accepting(), 0, false);
    hub.facts.redrawn = redrawn;
    hub.facts.started = hub.now;
    LinkRig twin(1'500, LinkRig::dialling());
    twin.links.tick(twin.moment());
    proto::Hello hello = twin.dialled.back().hello;
    hello.introduction->hub.unique.bytes = {};
    hello.introduction->instance = proto::HubInstance{77};
    const auto refused_with = [&] {
      const auto refusal = hub.admit(hello);
      return refusal ? refusal->code : GoodbyeCode::done;
    };
    hello.introduction->configured = false;
    EXPECT_EQ(refused_with(), GoodbyeCode::id_taken) << "one HELLO does not end a hub";
    EXPECT_FALSE(hub.links.redrawn());
    hello.introduction->configured = true;
    if (redrawn) {
      hub.now += Links::kRedrawPause - milliseconds{1};
      EXPECT_EQ(refused_with(), GoodbyeCode::id_taken);
      EXPECT_FALSE(hub.links.redrawn());
      hub.now += milliseconds{1};
    }
    EXPECT_EQ(refused_with(), GoodbyeCode::draining);
    EXPECT_TRUE(hub.links.redrawn());
  }
}

TEST(Links, AHubThatLosesItsIdSaysWhereTheClaimCameFrom) {
  LinkedRigs hubs;
  hubs.link();
  // Hub 1 hears over its link that another hub 1, with a lower unique id, is behind hub 2.
  const auto hear = [&hubs](proto::HubKey said_by, proto::HubInstance instance,
                            proto::HubKey neighbour, std::string name) {
    proto::route::RecordPart part;
    part.hub = said_by;
    part.instance = instance;
    part.configured = true;
    part.sequence = 100;
    part.name = std::move(name);
    part.neighbours.push_back({neighbour, 10});
    if (said_by.hub == kB) part.neighbours.push_back({hubs.a.links.network().self().key, 10});
    hubs.a.links.on_route(hubs.a.attached().session, hubs.a.attached().attachment,
                          proto::encode(part), hubs.a.moment());
  };
  const HubIdentity two = hubs.b.links.network().self();
  const proto::HubKey twin{kA, {}};
  hear(twin, proto::HubInstance{77}, two.key, "twin");
  hubs.a.now += milliseconds{1'000};
  hear(two.key, two.instance, twin, "hub-2");
  hubs.a.pass(milliseconds{1'000});
  const auto closed = hubs.a.shards.all<CloseCommand>();
  ASSERT_THAT(closed, ::testing::SizeIs(1));
  EXPECT_EQ(closed[0]->code, GoodbyeCode::id_taken);
  EXPECT_EQ(closed[0]->sentence,
            "hub id 1 is kept by another hub 'twin', as hub 2 'hub-2' says over link up; give one "
            "of them another one with --hub-id");
}

TEST(Links, AHubThatMeetsItselfTriesAgainLater) {
  LinkRig hub(1, LinkRig::dialling());
  hub.links.tick(hub.moment());
  const auto refusal = hub.admit(hub.dialled.back().hello);
  ASSERT_TRUE(refusal);
  EXPECT_EQ(refusal->code, GoodbyeCode::copied);
  net::NetError error(net::Fault::refused, refusal->sentence);
  error.goodbye = refusal->code;
  hub.links.on_dialled(hub.dialled.back().link, error, hub.moment());
  hub.pass(HubLink::kCopyPause - milliseconds{1});
  EXPECT_EQ(hub.dialled.size(), 1u);
  hub.pass(milliseconds{1});
  EXPECT_EQ(hub.dialled.size(), 2u);
}

TEST(Links, DialsAgainForEverWithinASecond) {
  LinkRig hub(1, LinkRig::dialling());
  for (std::size_t attempt = 1; attempt <= 20; ++attempt) {
    hub.links.tick(hub.moment());
    ASSERT_EQ(hub.dialled.size(), attempt);
    hub.links.on_dialled(hub.dialled.back().link, net::NetError(net::Fault::no_peer, "nobody"),
                         hub.moment());
    hub.now += milliseconds{1'000};
  }
}

TEST(Links, TheShorterOfTwoWaysIsTakenAndTheOtherWhenItEnds) {
  LinkedRigs hubs(LinkRig::dialling("first", 5));
  hubs.link();
  const std::uint32_t first = hubs.a.routes.find(kB).link.generation;
  LinkedRigs::carry(hubs.a, hubs.b);
  DialledLink second = LinkRig::dialling("second", 3).dial.front();
  ASSERT_EQ(hubs.b.links.add(second), "");
  EXPECT_NE(hubs.b.links.add(second), "") << "the name is taken";
  hubs.connect();
  hubs.pass(milliseconds{100});
  hubs.pass(milliseconds{100});
  const std::uint32_t cheaper = hubs.a.routes.find(kB).link.generation;
  EXPECT_NE(cheaper, first);
}

TEST(Links, AnotherCostIsToldOverTheLinkThatStands) {
  LinkedRigs hubs(LinkRig::dialling("up", 400));
  hubs.link();
  for (int i = 0; i < 3; ++i) hubs.pass(milliseconds{250});
  const auto cost_at = [](const LinkRig& hub, HubId far) {
    for (const Way& way : hub.links.network().map().ways()) {
      if (way.hub.hub == far) return way.cost;
    }
    return 0u;
  };
  ASSERT_EQ(cost_at(hubs.a, kB), 400u);
  for (const std::uint16_t cost : {std::uint16_t{300}, std::uint16_t{50}}) {
    ASSERT_EQ(hubs.b.links.set_cost("up", cost), "");
    for (int i = 0; i < 4; ++i) hubs.pass(milliseconds{100});
    EXPECT_EQ(cost_at(hubs.a, kB), cost) << "the higher of both ends counts";
    EXPECT_EQ(cost_at(hubs.b, kA), cost);
  }
  ASSERT_EQ(hubs.b.links.set_cost("up", 0), "");
  for (int i = 0; i < 4; ++i) hubs.pass(milliseconds{100});
  EXPECT_LT(cost_at(hubs.a, kB), 50u) << "as it was measured before";
  EXPECT_TRUE(hubs.b.shards.all<CloseCommand>().empty());
  EXPECT_TRUE(hubs.b.routes.find(kA).exists());
  EXPECT_NE(hubs.a.links.set_cost("up", 50), "") << "the side that dials decides";
}

TEST(Links, TheLastOneThatIsRemovedLeavesNobodyReachable) {
  LinkedRigs hubs(LinkRig::dialling("only", 5));
  hubs.link();
  hubs.pass(milliseconds{100});
  ASSERT_EQ(hubs.b.links.network().map().reachable().size(), 2u);
  ASSERT_EQ(hubs.b.links.remove("only"), "");
  hubs.b.detach(hubs.b.attached());
  ASSERT_TRUE(hubs.b.links.next_deadline()) << "there is a map to be computed";
  hubs.b.pass(milliseconds{100});
  EXPECT_EQ(hubs.b.links.network().map().reachable().size(), 1u);
}

TEST(Links, AWayBackThatIsNotAllowedIsPublished) {
  for (const bool allowed : {true, false}) {
    LinksOptions options = LinkRig::dialling();
    options.dial[0].terms.allow = {HubId{9}};
    if (allowed) options.dial[0].terms.allow.push_back(kA);
    LinkedRigs hubs(options);
    hubs.link();
    EXPECT_EQ(hubs.b.routes.find(kA).one_way, !allowed);
    EXPECT_FALSE(hubs.a.routes.find(kB).one_way) << "the other end takes everything";
  }
}

TEST(Links, OneThatTheOtherSideGaveUpIsShownForAWhile) {
  LinkedRigs hubs;
  hubs.link();
  hubs.a.detach(hubs.a.attached(), GoodbyeCode::done, true);
  hubs.a.pass(milliseconds{1});
  ASSERT_THAT(hubs.a.links.all(), ::testing::SizeIs(1));
  EXPECT_TRUE(hubs.a.links.all().begin()->second->is_over());
  hubs.a.pass(HubLink::kEndedShown - milliseconds{1});
  EXPECT_THAT(hubs.a.links.all(), ::testing::SizeIs(1));
  ASSERT_TRUE(hubs.a.links.next_deadline()) << "nothing else may come for long";
  EXPECT_LE(*hubs.a.links.next_deadline(), hubs.a.now + milliseconds{1});
  hubs.a.pass(milliseconds{1});
  EXPECT_TRUE(hubs.a.links.all().empty());
}

TEST(Links, OfThoseThatEndedTheLatestAreShown) {
  LinkedRigs hubs;
  hubs.b.links.tick(hubs.b.moment());
  proto::Hello hello = hubs.b.dialled.back().hello;
  const auto begin_and_end = [&](std::size_t number) {
    hello.introduction->link_name = "link" + std::to_string(number);
    ASSERT_FALSE(hubs.a.admit(hello));
    hubs.a.detach(hubs.a.attached(), GoodbyeCode::done, true);
    hubs.a.pass(milliseconds{1});
  };
  for (std::size_t number = 0; number < LinkRoster::kEndedMost + 2; ++number) begin_and_end(number);
  ASSERT_THAT(hubs.a.links.all(), ::testing::SizeIs(LinkRoster::kEndedMost));
  EXPECT_EQ(hubs.a.links.all().begin()->second->name(), "link2");
  begin_and_end(2);
  EXPECT_THAT(hubs.a.links.all(), ::testing::SizeIs(LinkRoster::kEndedMost)) << "it came back";
}

/// Its only link.
const HubLink& only_link(const LinkRig& rig) { return *rig.links.all().begin()->second; }

/// The dialling end withdraws the link, whose session then came to that.
void withdraw_at_b(LinkedRigs& hubs, const SessionCounts& counts) {
  const SessionRef session = hubs.b.attached().session;
  hubs.b.detach(hubs.b.attached());
  hubs.b.pass(HubLink::kResumeTime);
  hubs.b.links.on_released({session, counts});
}

TEST(Links, CountsGoOnAtBothEndsWhereOneWithdrewTheLink) {
  LinkedRigs hubs;
  hubs.connect();
  EXPECT_TRUE(hubs.a.attached().link->counts_anew && hubs.b.attached().link->counts_anew);
  hubs.carry();
  for (std::uint64_t times = 1; times <= 2; ++times) {
    SessionCounts counts;
    counts.delivered = 5;
    counts.unsure = 1;
    withdraw_at_b(hubs, counts);
    hubs.connect();
    EXPECT_FALSE(hubs.a.attached().link->counts_anew);
    EXPECT_FALSE(hubs.b.attached().link->counts_anew);
    const SessionCounts total = hubs.b.links.totals().of(only_link(hubs.b).number());
    EXPECT_EQ(total.delivered, 5 * times);
    EXPECT_EQ(total.unsure, times);
  }
}

TEST(Links, CountsBeginAnewAtBothEndsWhereOneHubStartedAgain) {
  LinkedRigs hubs;
  hubs.link();
  SessionCounts counts;
  counts.delivered = 5;
  withdraw_at_b(hubs, counts);
  hubs.b.pass(milliseconds{1'000});
  LinkRig again(1, LinkRig::accepting(), 777);
  ASSERT_FALSE(again.admit(hubs.b.dialled.back().hello));
  EXPECT_TRUE(again.attached().link->counts_anew);
  hubs.b.links.on_dialled(hubs.b.dialled.back().link,
                          net::Welcomed{std::make_unique<NoStream>(), again.attached().welcome},
                          hubs.b.moment());
  EXPECT_TRUE(hubs.b.attached().link->counts_anew);
  EXPECT_EQ(hubs.b.links.totals().of(only_link(hubs.b).number()).delivered, 0u);
}

TEST(Links, CountsOfASessionThatEndedBeforeTheyBeganAnewAreDropped) {
  LinkedRigs hubs;
  hubs.link();
  const SessionRef session = hubs.b.attached().session;
  hubs.b.detach(hubs.b.attached());
  hubs.b.pass(HubLink::kResumeTime);
  hubs.b.pass(milliseconds{1'000});
  proto::Welcome welcome = hubs.a.attached().welcome;
  welcome.introduction->counts += 2;
  hubs.b.links.on_dialled(hubs.b.dialled.back().link,
                          net::Welcomed{std::make_unique<NoStream>(), welcome}, hubs.b.moment());
  SessionCounts counts;
  counts.delivered = 5;
  hubs.b.links.on_released({session, counts});
  EXPECT_EQ(hubs.b.links.totals().of(only_link(hubs.b).number()).delivered, 0u);
}

TEST(Links, KeepAlivesMeasureTheRoundTripAndTheOtherClock) {
  LinkedRigs hubs;
  hubs.a.clock_ahead_ns = 5'000'000'000;
  hubs.link();
  for (int i = 0; i < 3; ++i) hubs.pass(milliseconds{250});
  const auto& link = *hubs.b.links.all().begin()->second;
  EXPECT_EQ(link.clock().ahead, std::chrono::seconds(5));
  EXPECT_GT(link.clock().round_trip_least.count(), 0);
  const auto told = hubs.b.shards.all<LinkClockCommand>();
  ASSERT_THAT(told, ::testing::SizeIs(1)) << "what does not change is told once";
  EXPECT_EQ(told[0]->ahead, std::chrono::seconds(5));
}

}  // namespace
}  // namespace gimnet::hub
