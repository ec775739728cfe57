#include <gtest/gtest.h>

#include <algorithm>
#include <utility>

#include "hub/network/state/network_state.hpp"
#include "tests/hub/network/state/support/hub_with_two_links.hpp"

// Records of neighbours that other links bring.

namespace gimnet::hub {
namespace {

using namespace test;

TEST_F(HubWithTwoLinks, BelievesANeighbourAloneOfItself) {
  hub_.take_record(kSecond, bytes(two_, 2), later_);
  EXPECT_EQ(sent(hub_), (Sent{{1, 2}})) << "it hears of it, and goes on behind it";
  EXPECT_EQ(hub_.store().find(two_.key)->head()->sequence, 1u);
  hub_.advance(later_);
  EXPECT_EQ(hub_.map().next_hops()[2], kFirst);
  EXPECT_EQ(hub_.hearsay(), 1u);
  EXPECT_FALSE(hub_.take_forgery()) << "an honest copy may be faster";
  hub_.take_record(kFirst, bytes(two_, 3, {{hub_key(5), 10}}), later_);
  EXPECT_EQ(sent(hub_), (Sent{{2, 2}})) << "others hear what it says";
  EXPECT_EQ(hub_.store().find(two_.key)->head()->sequence, 3u);
}

TEST_F(HubWithTwoLinks, BelievesOthersOfAHubWhoseLinkIsNotUp) {
  const HubIdentity four = identity(4, 44);
  constexpr LinkNumber kThird{3};
  hub_.begin_connection(kThird, to(four), later_);
  (void)hub_.take_sendings();
  hub_.take_record(kFirst, bytes(four, 7), later_);
  EXPECT_EQ(sent(hub_), (Sent{{2, 4}, {3, 4}}));
  hub_.take_mark(kThird);
  hub_.take_record(kSecond, bytes(four, 8), later_);
  EXPECT_EQ(sent(hub_), (Sent{{3, 4}}));
  hub_.end_link(kThird);
  hub_.take_record(kSecond, bytes(four, 9), later_ + seconds(1));
  EXPECT_EQ(sent(hub_), (Sent{{1, 4}})) << "it has no word of its own any more";
  EXPECT_EQ(hub_.hearsay(), 1u);
}

TEST_F(HubWithTwoLinks, TakesTheLatestThatItRefusedOnceTheLinkEnds) {
  const HubIdentity copy = identity(2, 21);
  hub_.take_record(kSecond, bytes(copy, 5), later_);
  hub_.take_record(kSecond, bytes(copy, 4), later_ + seconds(1));
  hub_.advance(later_ + seconds(1));
  EXPECT_EQ(hub_.store().find(two_.key)->head()->instance, two_.instance);
  hub_.end_link(kFirst);
  EXPECT_TRUE(hub_.next_due());
  (void)hub_.take_sendings();
  hub_.advance(later_ + seconds(2));
  EXPECT_EQ(hub_.store().find(two_.key)->head()->instance, copy.instance);
  EXPECT_EQ(hub_.store().find(two_.key)->head()->sequence, 5u);
  EXPECT_EQ(sent(hub_).count({2, 2}), 0u) << "not back to where it came from";
}

TEST_F(HubWithTwoLinks, BelievesEachOfParallelLinksOfAHub) {
  constexpr LinkNumber kParallel{3};
  hub_.begin_connection(kParallel, to(two_, 20), later_);
  (void)hub_.take_sendings();
  hub_.take_record(kParallel, bytes(two_, 2), later_);
  EXPECT_EQ(sent(hub_), (Sent{{1, 2}, {2, 2}}));
  hub_.take_record(kSecond, bytes(two_, 3), later_);
  EXPECT_EQ(sent(hub_), (Sent{{1, 2}, {3, 2}}));
}

TEST_F(HubWithTwoLinks, RefusesAPartThatANeighbourNeverSaid) {
  const auto invented = part(two_, 1, {{three_.key, 1}}, 63);
  hub_.take_record(kSecond, invented->bytes, later_);
  EXPECT_EQ(sent(hub_), (Sent{{1, 2}}));
  EXPECT_EQ(hub_.store().find(two_.key)->part(63), nullptr);
}

TEST_F(HubWithTwoLinks, GoesOnBehindAnotherWordOfItsOwnSequence) {
  const auto own = hub_.store().find(hub_.self().key)->part(0);
  hub_.take_record(kFirst, own->bytes, later_);
  hub_.advance(later_ + seconds(1));
  EXPECT_EQ(sent(hub_), Sent{}) << "it came back";
  proto::route::RecordPart forged = own->said;
  forged.neighbours.clear();
  hub_.take_record(kSecond, make_part(forged)->bytes, later_ + seconds(1));
  hub_.advance(later_ + seconds(2));
  EXPECT_EQ(sent(hub_), (Sent{{1, 5}, {2, 5}}));
  EXPECT_GT(hub_.store().find(hub_.self().key)->part(0)->said.sequence, own->said.sequence);
}

TEST_F(HubWithTwoLinks, HasTheSameOfTwoWordsOfOneSequenceWhicheverCameFirst) {
  for (const std::uint16_t hub : {std::uint16_t{8}, std::uint16_t{9}}) {
    const HubIdentity far = identity(hub, 99);
    auto first = bytes(far, 3, {{three_.key, 1}});
    auto second = bytes(far, 3, {{two_.key, 1}});
    if ((first < second) != (hub == 9)) std::swap(first, second);
    hub_.take_record(kFirst, first, later_);
    hub_.take_record(kSecond, second, later_ + seconds(1));
    EXPECT_EQ(hub_.store().find(far.key)->part(0)->bytes, std::max(first, second));
  }
}

TEST_F(HubWithTwoLinks, NamesALinkThatBringsWhatNoHonestHubDoesOnceAMinute) {
  const auto lead = NetworkState::kHonestLead;
  hub_.take_record(kSecond, bytes(two_, 1 + lead), later_);
  EXPECT_FALSE(hub_.take_forgery());
  later_ += seconds(1);
  hub_.take_record(kSecond, bytes(two_, 2 + lead), later_);
  const auto forgery = hub_.take_forgery();
  ASSERT_TRUE(forgery);
  EXPECT_EQ(forgery->link, kSecond);
  EXPECT_EQ(forgery->hub, two_.key);
  EXPECT_EQ(forgery->lead, lead + 1);
  EXPECT_FALSE(hub_.take_forgery()) << "it was told";
  later_ += seconds(1);
  hub_.take_record(kSecond, bytes(two_, 3 + lead), later_);
  EXPECT_FALSE(hub_.take_forgery());
  EXPECT_EQ(hub_.hearsay(), 3u);
  later_ += NetworkState::kCrowdedPause;
  hub_.take_record(kSecond, bytes(two_, 4 + lead), later_);
  EXPECT_TRUE(hub_.take_forgery());
}

TEST_F(HubWithTwoLinks, SendsOnNoMoreForgedRecordsThanOneLinkMayBring) {
  for (std::uint64_t sequence = 2; sequence < 1'000; ++sequence)
    hub_.take_record(kSecond, bytes(two_, sequence), later_);
  hub_.advance(later_ + PartPace::kPause);
  EXPECT_EQ(sent(hub_).count({1, 2}), 2u);
}

}  // namespace
}  // namespace gimnet::hub
