#include <gtest/gtest.h>

#include "hub/control/links.hpp"
#include "tests/hub/control/support/link_rig.hpp"

// Links that break, and come back in time or not.

namespace gimnet::hub {
namespace {

using proto::GoodbyeCode;
using std::chrono::milliseconds;

constexpr HubId kA{1};
constexpr HubId kB{2};

const HubLink& only_link(const LinkRig& rig) { return *rig.links.all().begin()->second; }

/// The cost of its link that the other hubs are told.
std::uint32_t cost_told(const LinkRig& hub) {
  const StoredRecord* const record =
      hub.links.network().store().find(hub.links.network().self().key);
  const auto& neighbours = record->head()->neighbours;
  return neighbours.empty() ? 0 : neighbours.front().cost;
}

/// The connection breaks, and is back 50 ms later.
void break_and_resume(LinkedRigs& hubs) {
  hubs.b.detach(hubs.b.attached());
  hubs.a.detach(hubs.a.attached());
  hubs.pass(milliseconds{50});
  ASSERT_TRUE(hubs.b.routes.find(kA).exists());
  if (!only_link(hubs.b).connected()) hubs.connect(true);
  hubs.carry();
}

/// It breaks, and is back when its routes are gone.
void break_for_long(LinkedRigs& hubs) {
  hubs.b.detach(hubs.b.attached());
  hubs.a.detach(hubs.a.attached());
  hubs.pass(HubLink::kResumeTime + milliseconds{100});
  ASSERT_FALSE(hubs.b.routes.find(kA).exists());
  hubs.connect();
  hubs.carry();
  hubs.pass(NetworkState::kMapPause);
}

TEST(LinksBreaks, ABrokenLinkKeepsItsRoutesForItsTimeToComeBack) {
  LinkedRigs hubs;
  hubs.link();
  hubs.a.detach(hubs.a.attached());
  hubs.a.pass(HubLink::kResumeTime - milliseconds{1});
  EXPECT_TRUE(hubs.a.routes.find(kB).exists());
  EXPECT_TRUE(hubs.a.shards.all<ReleaseCommand>().empty());
  hubs.a.pass(milliseconds{1});
  EXPECT_FALSE(hubs.a.routes.find(kB).exists());
  EXPECT_EQ(hubs.a.shards.all<ReleaseCommand>().size(), 1u) << "what waits for it is lost";
}

TEST(LinksBreaks, AGoodbyeWithdrawsALinkAtOnce) {
  LinkedRigs hubs;
  hubs.link();
  hubs.a.detach(hubs.a.attached(), GoodbyeCode::draining, true);
  EXPECT_FALSE(hubs.a.routes.find(kB).exists());
}

TEST(LinksBreaks, ALinkThatComesBackSaysWhatItHadTaken) {
  LinkedRigs hubs;
  hubs.link();
  const AttachCommand& before = hubs.b.attached();
  const SessionRef session = before.session;
  hubs.b.detach(before);
  hubs.a.detach(hubs.a.attached());
  hubs.b.pass(milliseconds{50});  // at most that long after a first break
  hubs.connect(true);
  const proto::Hello& hello = hubs.b.dialled.back().hello;
  EXPECT_EQ(hello.epoch, 11u);
  EXPECT_EQ(hello.resume_epoch, 12u);
  EXPECT_EQ(hello.resume_taken, 5u);
  EXPECT_TRUE(hubs.b.attached().link->resumed);
  EXPECT_EQ(hubs.b.attached().session.generation, session.generation);
  EXPECT_EQ(hubs.b.attached().attachment, 2u);
  EXPECT_TRUE(hubs.b.routes.find(kA).exists()) << "frames wait meanwhile";
}

TEST(LinksBreaks, OneThatCameBackTooLateBeginsAnewAtBothEnds) {
  LinkedRigs hubs;
  hubs.link();
  hubs.b.detach(hubs.b.attached());
  hubs.b.pass(milliseconds{50});
  const LinkRig::Dialled late = hubs.b.dialled.back();
  hubs.b.pass(HubLink::kResumeTime);
  proto::Welcome welcome = hubs.a.attached().welcome;
  welcome.resumed = true;
  const std::size_t attached = hubs.b.shards.all<AttachCommand>().size();
  hubs.b.links.on_dialled(late.link, net::Welcomed{std::make_unique<NoStream>(), welcome},
                          hubs.b.moment());
  EXPECT_EQ(hubs.b.shards.all<AttachCommand>().size(), attached) << "the other end counts on";
  hubs.b.pass(milliseconds{1'000});
  EXPECT_EQ(hubs.b.dialled.back().hello.resume_epoch, 0u);
}

TEST(LinksBreaks, ALinkThatIsResumedEachTimeIsNotDamped) {
  LinkedRigs hubs;
  hubs.link();
  for (int i = 0; i < 20; ++i) {
    break_and_resume(hubs);
    EXPECT_FALSE(only_link(hubs.a).damped_until() || only_link(hubs.b).damped_until());
    hubs.pass(milliseconds{1'000});
    EXPECT_TRUE(hubs.a.routes.find(kB).exists() && hubs.b.routes.find(kA).exists());
  }
}

TEST(LinksBreaks, ADampedLinkIsToldAtTheHighestCostAndCarries) {
  LinkedRigs hubs(LinkRig::dialling("up", 7));
  hubs.link();
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(cost_told(hubs.b), 7u);
    break_for_long(hubs);
  }
  ASSERT_TRUE(only_link(hubs.b).damped_until());
  for (int i = 0; i < 6; ++i) hubs.pass(milliseconds{100});
  EXPECT_EQ(cost_told(hubs.b), LinkCost::kMost);
  EXPECT_TRUE(hubs.a.routes.find(kB).exists() && hubs.b.routes.find(kA).exists());
  EXPECT_EQ(hubs.b.links.network().map().ways()[0].cost, LinkCost::kMost) << "all have one map";

  const auto until = only_link(hubs.b).damped_until();
  break_and_resume(hubs);
  EXPECT_EQ(only_link(hubs.b).damped_until(), until) << "it is as damped as it was";
  for (int i = 0; i < 20; ++i) hubs.pass(milliseconds{100});
  EXPECT_FALSE(only_link(hubs.b).damped_until());
  EXPECT_EQ(cost_told(hubs.b), 7u);
}

TEST(LinksBreaks, ADampedLinkStandsByWhileAnotherOneLeadsThere) {
  LinkedRigs hubs(LinkRig::dialling("up", 7));
  hubs.link();
  for (int i = 0; i < 3; ++i) break_for_long(hubs);
  const std::uint32_t damped = hubs.b.routes.find(kA).link.generation;
  ASSERT_EQ(hubs.b.links.add(LinkRig::dialling("second", 900).dial.front()), "");
  hubs.connect();
  for (int i = 0; i < 6; ++i) hubs.pass(milliseconds{100});
  EXPECT_NE(hubs.b.routes.find(kA).link.generation, damped);
  EXPECT_EQ(hubs.b.links.network().map().ways()[0].cost, 900u);
}

}  // namespace
}  // namespace gimnet::hub
