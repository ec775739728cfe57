#include "hub/network/state/network_state.hpp"

#include <gtest/gtest.h>

#include "tests/hub/network/state/support/hub_with_two_links.hpp"

namespace gimnet::hub {
namespace {

using namespace test;

TEST(NetworkStateExchange, SendsAllRecordsThenTheMark) {
  NetworkState hub(identity(5, 55), {});
  hub.begin_connection(kFirst, to(identity(2, 22)), kNow);
  EXPECT_EQ(sent(hub), (Sent{{1, 5}, {1, 0}}));
  hub.take_record(kFirst, bytes(identity(9, 99), 1), kNow);
  EXPECT_EQ(sent(hub), Sent{}) << "never back to where it came from";
  hub.begin_connection(kSecond, to(identity(3, 33)), kNow);
  EXPECT_EQ(sent(hub), (Sent{{2, 5}, {2, 9}, {2, 0}}));
}

TEST(NetworkStateExchange, CountsALinkWhenTheMarkOfTheOtherSideHasCome) {
  NetworkState hub(identity(5, 55), {});
  hub.begin_connection(kFirst, to(identity(2, 22)), kNow);
  hub.take_record(kFirst, bytes(identity(2, 22), 1, {{hub_key(5), 10}}), kNow);
  hub.advance(kNow + seconds(1));
  EXPECT_EQ(hub.map().reachable().size(), 1u);
  hub.take_mark(kFirst);
  hub.advance(kNow + seconds(2));
  EXPECT_EQ(hub.map().reachable().size(), 2u);
}

TEST_F(HubWithTwoLinks, ReachesBoth) {
  EXPECT_EQ(hub_.map().next_hops()[2], kFirst);
  EXPECT_EQ(hub_.map().next_hops()[3], kSecond);
  EXPECT_EQ(hub_.verdict(), Verdict::stay);
}

TEST_F(HubWithTwoLinks, FloodsWhatIsNewerToTheOtherLinks) {
  hub_.take_record(kFirst, bytes(two_, 2, {{hub_key(5), 10}}), later_);
  EXPECT_EQ(sent(hub_), (Sent{{2, 2}}));
  hub_.take_record(kSecond, bytes(two_, 2, {{hub_key(5), 10}}), later_);
  EXPECT_EQ(sent(hub_), Sent{}) << "known";
}

TEST_F(HubWithTwoLinks, SendsOnTheBytesThatCame) {
  proto::bitestream::Writer body;
  said(two_, 2).write(body);
  body.put_text(20, "of a later version");
  const auto bytes = proto::assemble_control({proto::route::RecordPart::kOperation, 0}, body);
  hub_.take_record(kFirst, bytes, later_);
  const auto sendings = hub_.take_sendings();
  ASSERT_EQ(sendings.size(), 1u);
  EXPECT_EQ(*sendings.front().bytes, bytes);
}

TEST_F(HubWithTwoLinks, WithdrawsALinkAtOnce) {
  hub_.end_link(kFirst);
  hub_.advance(later_);
  EXPECT_EQ(hub_.map().next_hops()[2], LinkNumber{});
  EXPECT_EQ(sent(hub_), (Sent{{2, 5}})) << "its own record says so";
  hub_.end_link(kFirst);
  hub_.take_mark(kFirst);
  hub_.take_digest(kFirst, 1, later_);
  hub_.set_cost(kFirst, 3);
  hub_.take_record(kFirst, bytes(two_, 9), later_);
  hub_.advance(later_ + seconds(1));
  EXPECT_EQ(sent(hub_), Sent{}) << "the link is unknown";
}

TEST_F(HubWithTwoLinks, HasNoMomentWithoutARouteWhereAParallelLinkStands) {
  constexpr LinkNumber kParallel{3};
  hub_.begin_connection(kParallel, to(two_, 20), later_);
  hub_.take_mark(kParallel);
  hub_.advance(later_);
  ASSERT_EQ(hub_.map().next_hops()[2], kFirst);
  hub_.end_link(kFirst);
  EXPECT_EQ(hub_.map().next_hops()[2], kParallel) << "before the pause between two maps is over";
}

TEST_F(HubWithTwoLinks, KeepsTheRouteOverABreakWithResume) {
  hub_.begin_connection(kFirst, to(two_), later_);
  hub_.advance(later_);
  EXPECT_EQ(hub_.map().next_hops()[2], kFirst);
  EXPECT_EQ(sent(hub_), (Sent{{1, 5}, {1, 2}, {1, 3}, {1, 0}})) << "the exchange begins anew";
  hub_.begin_connection(kFirst, to(identity(2, 23)), later_ + seconds(1));
  hub_.advance(later_ + seconds(1));
  EXPECT_EQ(hub_.map().next_hops()[2], LinkNumber{}) << "another process";
}

TEST_F(HubWithTwoLinks, SaysTheHighestCostOfADampedLink) {
  const auto cost_said = [this] {
    return hub_.store().find(hub_.self().key)->head()->neighbours[0].cost;
  };
  hub_.set_damped(kFirst, true);
  hub_.advance(later_);
  EXPECT_EQ(cost_said(), LinkCost::kMost);
  EXPECT_EQ(sent(hub_), (Sent{{1, 5}, {2, 5}}));
  EXPECT_EQ(hub_.map().next_hops()[2], kFirst) << "it carries what has no other way";
  EXPECT_EQ(hub_.map().ways()[0].cost, LinkCost::kMost) << "its own map is that of the others";
  hub_.set_damped(kFirst, false);
  hub_.advance(later_ + seconds(1));
  EXPECT_EQ(cost_said(), 10u);
  EXPECT_EQ(hub_.map().ways()[0].cost, 10u);
}

TEST_F(HubWithTwoLinks, LetsADampedLinkWaitBesideAnotherOne) {
  constexpr LinkNumber kThird{3};
  hub_.begin_connection(kThird, to(two_, 900), later_);
  hub_.take_mark(kThird);
  hub_.set_damped(kFirst, true);
  hub_.advance(later_);
  EXPECT_EQ(hub_.map().next_hops()[2], kThird);
  hub_.set_damped(kThird, true);
  hub_.advance(later_ + seconds(1));
  EXPECT_EQ(hub_.map().next_hops()[2], kFirst) << "of equal cost and name the first one";
}

TEST_F(HubWithTwoLinks, UsesTheCheaperOfTwoLinksThenTheOneOfTheLowerDiallerThenTheName) {
  constexpr LinkNumber kThird{3};
  const auto carrying = [&](const LinkFacts& facts) {
    later_ += seconds(1);
    hub_.begin_connection(kThird, facts, later_);
    hub_.take_mark(kThird);
    hub_.advance(later_);
    const auto found = hub_.map().next_hops()[2];
    hub_.end_link(kThird);
    return found;
  };
  EXPECT_EQ(carrying({two_, "z", true, 9}), kThird);
  EXPECT_EQ(carrying({two_, "a", true, 11}), kFirst);
  EXPECT_EQ(carrying({two_, "z", false, 10}), kThird) << "hub 2 dialled it";
  EXPECT_EQ(carrying({two_, "a", true, 10}), kThird);
  EXPECT_EQ(carrying({two_, "z", true, 10}), kFirst);
}

TEST_F(HubWithTwoLinks, RepairsRecordsThatDifferForASecond) {
  hub_.take_record(kFirst, bytes(identity(9, 99), 1), later_);
  (void)hub_.take_sendings();
  hub_.take_digest(kFirst, hub_.digest() + 1, later_);
  hub_.take_digest(kFirst, hub_.digest() + 1, later_ + milliseconds(999));
  EXPECT_EQ(sent(hub_), Sent{});
  hub_.take_digest(kFirst, hub_.digest(), later_ + milliseconds(999));
  hub_.take_digest(kFirst, hub_.digest() + 1, later_ + milliseconds(1'000));
  EXPECT_EQ(sent(hub_), Sent{}) << "they were equal in between";
  hub_.take_digest(kFirst, hub_.digest() + 1, later_ + milliseconds(2'000));
  EXPECT_EQ(sent(hub_), (Sent{{1, 2}, {1, 3}, {1, 5}})) << "of hubs that can be reached";
  hub_.take_digest(kFirst, hub_.digest() + 1, later_ + milliseconds(3'999));
  EXPECT_EQ(sent(hub_), Sent{}) << "it did not help";
  hub_.take_digest(kFirst, hub_.digest() + 1, later_ + milliseconds(4'000));
  EXPECT_EQ(sent(hub_).size(), 3u);
  hub_.take_digest(kFirst, hub_.digest() + 1, later_ + seconds(5));
  hub_.take_digest(kFirst, hub_.digest(), later_ + seconds(5));
  hub_.take_digest(kFirst, hub_.digest() + 1, later_ + seconds(6));
  hub_.take_digest(kFirst, hub_.digest() + 1, later_ + seconds(7));
  EXPECT_EQ(sent(hub_).size(), 3u) << "they were equal in between";
}

TEST_F(HubWithTwoLinks, PausesBetweenRepairsForAMinuteAtMost) {
  std::vector<milliseconds> repairs;
  for (milliseconds now{0}; now < std::chrono::minutes(5); now += milliseconds(250)) {
    hub_.take_digest(kFirst, hub_.digest() + 1, later_ + now);
    if (!sent(hub_).empty()) repairs.push_back(now);
  }
  ASSERT_GE(repairs.size(), 9u);
  EXPECT_EQ(repairs[1] - repairs[0], seconds(2));
  EXPECT_EQ(repairs[5] - repairs[4], seconds(32));
  EXPECT_EQ(repairs[6] - repairs[5], seconds(60));
  EXPECT_EQ(repairs[8] - repairs[7], seconds(60));
}

TEST_F(HubWithTwoLinks, AnswersAnOlderRecordOfAHubThatItCannotReach) {
  hub_.take_record(kSecond, bytes(identity(9, 99), 2), later_);
  EXPECT_EQ(sent(hub_), (Sent{{1, 9}}));
  hub_.take_record(kFirst, bytes(identity(9, 99), 1), later_);
  EXPECT_EQ(sent(hub_), (Sent{{1, 9}})) << "repairs leave it out";
  hub_.take_record(kFirst, bytes(identity(9, 99), 2), later_);
  EXPECT_EQ(sent(hub_), Sent{}) << "they are equal";
  hub_.take_record(kFirst, bytes(three_, 0), later_);
  EXPECT_EQ(sent(hub_), Sent{}) << "a repair brings it";
}

TEST_F(HubWithTwoLinks, NamesTheLinkThatBringsTooManyRecordsOnceAMinute) {
  const auto crowd = [this](LinkNumber link, std::uint8_t from, std::uint8_t to) {
    for (std::uint8_t unique = from; unique <= to; ++unique)
      hub_.take_record(link, bytes({hub_key(7, unique), proto::HubInstance{1}, true}, 1), later_);
    return hub_.take_crowding();
  };
  EXPECT_FALSE(crowd(kFirst, 1, RecordStore::kRecordsOfOneId));
  EXPECT_EQ(crowd(kSecond, 100, 100), kSecond);
  EXPECT_FALSE(crowd(kFirst, 101, 101));
  later_ += NetworkState::kCrowdedPause;
  EXPECT_EQ(crowd(kFirst, 102, 103), kFirst);
  EXPECT_FALSE(hub_.take_crowding());
}

TEST_F(HubWithTwoLinks, ComputesAtOnceAndThenEach50Ms) {
  const std::uint64_t before = hub_.maps();
  hub_.set_cost(kFirst, 20);
  hub_.advance(later_);
  EXPECT_EQ(hub_.maps(), before + 1);
  hub_.set_cost(kSecond, 20);
  hub_.advance(later_ + milliseconds(49));
  EXPECT_EQ(hub_.maps(), before + 1);
  EXPECT_EQ(hub_.next_due(), later_ + milliseconds(50));
  hub_.advance(later_ + milliseconds(50));
  EXPECT_EQ(hub_.maps(), before + 2);
}

TEST_F(HubWithTwoLinks, ComputesMoreRarelyTheMoreRecordsThereAre) {
  std::vector<std::pair<proto::HubKey, std::uint16_t>> neighbours;
  for (std::uint16_t hub = 100; hub < 164; ++hub) neighbours.emplace_back(hub_key(hub), 10);
  for (std::uint16_t hub = 1'000; hub < 1'800; ++hub)
    hub_.take_record(kFirst, bytes(identity(hub, 7), 1, neighbours), later_);
  hub_.set_cost(kFirst, 15);
  hub_.advance(later_);
  ASSERT_EQ(hub_.store().bytes() / (1024 * 1024), 1u);
  const std::uint64_t before = hub_.maps();
  hub_.set_cost(kFirst, 20);
  hub_.advance(later_ + milliseconds(99));
  EXPECT_EQ(hub_.maps(), before);
  EXPECT_EQ(hub_.next_due(), later_ + milliseconds(100));
  hub_.advance(later_ + milliseconds(100));
  EXPECT_EQ(hub_.maps(), before + 1);
}

TEST_F(HubWithTwoLinks, ComputesOnceWhenALinkEnds) {
  const std::uint64_t before = hub_.maps();
  hub_.end_link(kFirst);
  hub_.advance(later_ + seconds(1));
  EXPECT_EQ(hub_.maps(), before + 1);
  EXPECT_TRUE(hub_.store().find(two_.key)->unreachable_since.has_value());
}

TEST_F(HubWithTwoLinks, ComputesNothingForAHubThatNoReachableOneNames) {
  const std::uint64_t before = hub_.maps();
  const auto nine = identity(9, 99);
  const auto take = [&](LinkNumber link, const proto::Payload& record) {
    hub_.take_record(link, record, later_);
    hub_.advance(later_);
    later_ += seconds(1);
    return hub_.maps() - before;
  };
  EXPECT_EQ(take(kFirst, bytes(nine, 2, {{three_.key, 10}, {hub_key(5), 10}})), 0u);
  EXPECT_EQ(sent(hub_), (Sent{{2, 9}})) << "others are told";
  EXPECT_EQ(take(kFirst, bytes(two_, 2, {{hub_key(5), 10}, {nine.key, 10}})), 1u);
  EXPECT_EQ(hub_.map().next_hops()[9], LinkNumber{}) << "it does not name hub 2 any more";
  EXPECT_EQ(take(kFirst, bytes(nine, 3, {{two_.key, 10}})), 2u);
  EXPECT_EQ(hub_.map().next_hops()[9], kFirst);
}

TEST_F(HubWithTwoLinks, CountsWhatIsNoRecord) {
  hub_.take_record(kFirst, proto::Payload(3), later_);
  EXPECT_EQ(hub_.malformed(), 1u);
}

TEST_F(HubWithTwoLinks, LetsAFastPartWait) {
  hub_.take_record(kFirst, bytes(two_, 2), later_);
  hub_.take_record(kFirst, bytes(two_, 3), later_);
  hub_.take_record(kFirst, bytes(two_, 4), later_);
  hub_.advance(later_);
  EXPECT_EQ(hub_.store().find(two_.key)->head()->sequence, 2u);
  EXPECT_EQ(hub_.next_due(), later_ + PartPace::kPause);
  hub_.advance(later_ + PartPace::kPause);
  EXPECT_EQ(hub_.store().find(two_.key)->head()->sequence, 4u);
}

TEST_F(HubWithTwoLinks, LeavesWhenAnotherHubKeepsItsId) {
  const HubIdentity other{{HubId{5}, {}}, proto::HubInstance{9}, true};
  ASSERT_TRUE(is_preferred(other, hub_.self()));
  hub_.take_record(kFirst, bytes(other, 1, {{hub_key(2), 10}}), later_);
  hub_.take_record(kFirst, bytes(two_, 2, {{hub_key(5), 10}, {other.key, 10}}), later_);
  hub_.advance(later_);
  EXPECT_EQ(hub_.verdict(), Verdict::stay) << "records ascend, and these did not: malformed";
  hub_.take_record(kFirst, bytes(two_, 3, {{other.key, 10}, {hub_key(5), 10}}), later_);
  hub_.advance(later_ + seconds(1));
  EXPECT_EQ(hub_.verdict(), Verdict::id_taken);
  ASSERT_TRUE(hub_.map().own_id_holder());
  EXPECT_EQ(hub_.map().own_id_holder()->hub, other.key);
  EXPECT_EQ(hub_.map().own_id_holder()->link, kFirst) << "where the claim came from";
  hub_.leave();
  EXPECT_EQ(hub_.verdict(), Verdict::stay);
  hub_.renumber(HubId{1'500});
  hub_.begin_connection(kFirst, to(two_), later_ + seconds(2));
  EXPECT_EQ(sent(hub_).count({1, 1'500}), 1u);
}

TEST_F(HubWithTwoLinks, LeavesToALivingCopyWithALowerInstance) {
  name_this_hub(identity(5, 54));
  EXPECT_EQ(hub_.verdict(), Verdict::copied);
  hub_.leave();
  EXPECT_EQ(hub_.verdict(), Verdict::stay);
}

TEST_F(HubWithTwoLinks, StaysWhereTheCopyHasTheHigherInstance) {
  name_this_hub(identity(5, 56));
  EXPECT_EQ(hub_.verdict(), Verdict::stay);
  hub_.advance(later_);
  EXPECT_EQ(sent(hub_), (Sent{{1, 5}, {2, 5}})) << "it goes on behind it";
}

TEST(NetworkStateDraw, AvoidsIdsThatAreKnown) {
  NetworkState hub(identity(5, 55), {});
  EXPECT_EQ(hub.draw_hub_id(0), HubId{1'024});
  EXPECT_EQ(hub.draw_hub_id(3'070), HubId{4'094});
  EXPECT_EQ(hub.draw_hub_id(3'071), HubId{1'024});
  hub.begin_connection(kFirst, to(identity(2, 22)), kNow);
  hub.take_record(kFirst, bytes(identity(1'024, 1), 1), kNow);
  EXPECT_EQ(hub.draw_hub_id(0), HubId{1'025});
}

}  // namespace
}  // namespace gimnet::hub
