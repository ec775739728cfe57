#include "hub/network/state/name_copies.hpp"

#include <gtest/gtest.h>

#include "tests/hub/network/state/support/names.hpp"

namespace gimnet::hub {
namespace {

using proto::route::kOrdinaryRank;
using proto::route::NameClaim;
using proto::route::Names;
using proto::route::NameState;
using std::chrono::milliseconds;
using test::node_claim;
using test::service_claim;

constexpr HubId kHere{1};
constexpr HubId kThere{2};
constexpr proto::HubInstance kFirst{22};
constexpr proto::HubInstance kSecond{23};
constexpr milliseconds kGrace{30'000};

NameCopies::Options options(std::uint16_t hub = 1) {
  return {{HubId{hub}, proto::HubInstance{hub}}, kGrace, std::size_t{1} << 20};
}

std::vector<HubRun> runs(proto::HubInstance instance = kFirst) { return {{kThere, instance}}; }

Names names(std::uint64_t after, std::uint64_t version,
            std::vector<proto::route::NameRecord> records) {
  return {kThere, kFirst, after, version, 0, std::move(records)};
}

class NameCopiesTest : public ::testing::Test {
 protected:
  NameCopiesTest() { (void)copies_.set_reachable(runs(), milliseconds(0)); }
  NameCopies copies_{options()};
};

TEST_F(NameCopiesTest, TakesWhatFollowsWhatItHas) {
  EXPECT_EQ(copies_.take(names(0, 2, {{"a", node_claim(2, 1, 1)}, {"b", node_claim(2, 2, 2)}})),
            NameCopies::Taken::changed);
  EXPECT_EQ(copies_.find("b")->claim->node, (make_id<NodeId>(kThere, 2)));
  EXPECT_EQ(copies_.find("b")->standing, proto::ns::NameStanding::held);
  EXPECT_EQ(copies_.known(kThere)->version, 2u);
  EXPECT_EQ(copies_.take(names(3, 4, {{"d", node_claim(2, 4, 4)}})), NameCopies::Taken::known)
      << "there is a gap";
  EXPECT_FALSE(copies_.find("d"));
  EXPECT_EQ(copies_.take(names(1, 2, {{"b", node_claim(2, 2, 2)}})), NameCopies::Taken::known);
}

TEST_F(NameCopiesTest, DeletesWhatAMarkOrARangeSays) {
  (void)copies_.take(names(
      0, 3, {{"a", node_claim(2, 1, 1)}, {"b", node_claim(2, 2, 2)}, {"c", node_claim(2, 3, 3)}}));
  (void)copies_.take(names(3, 4, {{"a", test::mark(4)}}));
  EXPECT_FALSE(copies_.find("a"));
  Names all = names(0, 9, {{"c", node_claim(2, 3, 3)}});
  all.forgotten = 8;
  EXPECT_EQ(copies_.take(all), NameCopies::Taken::changed);
  EXPECT_FALSE(copies_.find("b")) << "the mark of it was forgotten";
  EXPECT_TRUE(copies_.find("c"));
  NamesPosition third{kFirst, 5, 0};
  EXPECT_EQ(copies_.next(kThere, third)->after, 0u) << "it has not the mark either";
}

TEST_F(NameCopiesTest, GivesAnotherCopyWhatItLacks) {
  NameCopies other{options(3)};
  (void)other.set_reachable(std::vector<HubRun>{copies_.self()}, milliseconds(0));
  for (std::uint32_t node = 1; node <= 500; ++node)
    copies_.put_own("robot/" + std::to_string(node), node_claim(1, node));
  copies_.put_own("robot/500/laser", service_claim(1, 500, 7));
  copies_.remove_own("robot/3");
  NamesPosition at{copies_.self().instance, 0, 0};
  int messages = 0;
  while (const auto next = copies_.next(kHere, at)) {
    ++messages;
    EXPECT_LE(proto::encode(*next).size(), proto::route::kNamesBytesMax);
    EXPECT_EQ(other.take(*next), NameCopies::Taken::changed);
  }
  EXPECT_GT(messages, 2);
  EXPECT_EQ(other.size(), 500u);
  EXPECT_EQ(other.find_group(make_id<GroupId>(kHere, 7))->name, "robot/500/laser");
  EXPECT_EQ(other.node_after(make_id<NodeId>(kHere, 2))->name, "robot/4");
  EXPECT_FALSE(other.find("robot/3"));
}

TEST_F(NameCopiesTest, SendsAllOnceMarksAreForgotten) {
  copies_.put_own("stays", node_claim(1, 1));
  for (std::uint32_t i = 0; i < NameCopies::kMarksLeast + 10; ++i) {
    copies_.put_own("goes/" + std::to_string(i), node_claim(1, 2 + i));
    copies_.remove_own("goes/" + std::to_string(i));
  }
  NamesPosition at{copies_.self().instance, 2, 0};
  EXPECT_EQ(copies_.next(kHere, at)->after, 0u);
  std::uint64_t last = at.version;
  while (const auto next = copies_.next(kHere, at)) {
    EXPECT_EQ(next->after, last);
    last = next->version;
  }
}

TEST_F(NameCopiesTest, KeepsTheNamesOfAHubThatIsAwayForTheGraceTime) {
  (void)copies_.take(names(0, 1, {{"a", node_claim(2, 1, 1)}}));
  (void)copies_.set_reachable({}, milliseconds(1'000));
  EXPECT_EQ(copies_.find("a")->standing, proto::ns::NameStanding::unreachable);
  EXPECT_EQ(copies_.find("a")->until, milliseconds(1'000) + kGrace);
  EXPECT_FALSE(copies_.known(kThere));
  NamesPosition at{kFirst, 0, 0};
  EXPECT_FALSE(copies_.next(kThere, at)) << "it is not sent on";
  EXPECT_EQ(copies_.next_due(), milliseconds(1'000) + kGrace);
  EXPECT_FALSE(copies_.forget(milliseconds(999) + kGrace));
  EXPECT_EQ(copies_.set_reachable(runs(), milliseconds(2'000)), std::vector<HubId>{kThere});
  EXPECT_EQ(copies_.find("a")->standing, proto::ns::NameStanding::held);
  (void)copies_.set_reachable({}, milliseconds(3'000));
  EXPECT_TRUE(copies_.forget(milliseconds(3'000) + kGrace));
  EXPECT_FALSE(copies_.find("a"));
  EXPECT_EQ(copies_.bytes(), 0u);
}

TEST_F(NameCopiesTest, NeverMixesTwoProcessesOfAHub) {
  (void)copies_.take(names(0, 2, {{"a", node_claim(2, 1, 1)}, {"b", node_claim(2, 2, 2)}}));
  (void)copies_.set_reachable(runs(kSecond), milliseconds(1'000));
  EXPECT_EQ(copies_.known(kThere)->version, 0u);
  EXPECT_EQ(copies_.find("a")->standing, proto::ns::NameStanding::unreachable);
  EXPECT_EQ(copies_.take(names(0, 3, {{"c", node_claim(2, 3, 3)}})), NameCopies::Taken::known);
  Names after = names(0, 1, {{"a", node_claim(2, 1, 1)}});
  after.instance = kSecond;
  EXPECT_EQ(copies_.take(after), NameCopies::Taken::changed);
  EXPECT_EQ(copies_.find("a")->standing, proto::ns::NameStanding::held);
  EXPECT_EQ(copies_.find("b")->standing, proto::ns::NameStanding::unreachable);
  EXPECT_TRUE(copies_.forget(milliseconds(1'000) + kGrace));
  EXPECT_FALSE(copies_.find("b"));
  EXPECT_TRUE(copies_.find("a"));
}

TEST_F(NameCopiesTest, ANodeOfTheProcessBeforeIsReplacedByItsId) {
  (void)copies_.take(names(0, 1, {{"a", node_claim(2, 1, 1)}}));
  (void)copies_.set_reachable(runs(kSecond), milliseconds(1'000));
  Names after = names(0, 1, {{"renamed", node_claim(2, 1, 1)}});
  after.instance = kSecond;
  (void)copies_.take(after);
  EXPECT_FALSE(copies_.find("a"));
  EXPECT_EQ(copies_.find_node(make_id<NodeId>(kThere, 1))->name, "renamed");
}

TEST_F(NameCopiesTest, TellsWhichOwnNamesAreLostToABetterClaim) {
  copies_.put_own("mine", node_claim(1, 1));
  copies_.put_own("theirs", node_claim(1, 2));
  auto better = node_claim(2, 2, 2);
  better.rank = kOrdinaryRank + 1;
  (void)copies_.take(names(0, 2, {{"mine", node_claim(2, 1, 1)}, {"theirs", better}}));
  EXPECT_EQ(copies_.find("mine")->hub, kHere);
  const auto lost = copies_.take_lost();
  ASSERT_EQ(lost.size(), 1u);
  EXPECT_EQ(lost[0].name, "theirs");
  EXPECT_EQ(lost[0].claim->node, (make_id<NodeId>(kThere, 2)));
  EXPECT_TRUE(copies_.take_lost().empty());
}

TEST_F(NameCopiesTest, LosesNothingToAHubThatIsAwayBeforeItIsBack) {
  auto better = node_claim(2, 1, 1);
  better.rank = kOrdinaryRank + 9;
  (void)copies_.take(names(0, 1, {{"a", better}}));
  (void)copies_.set_reachable({}, milliseconds(0));
  copies_.put_own("a", node_claim(1, 1));
  EXPECT_EQ(copies_.find("a")->hub, kHere);
  EXPECT_EQ(copies_.find("a")->claim->rank, kOrdinaryRank);
  EXPECT_TRUE(copies_.take_lost().empty());
  copies_.remove_own("a");
  (void)copies_.set_reachable(runs(), milliseconds(1));
  copies_.put_own("a", node_claim(1, 1));
  EXPECT_TRUE(copies_.take_lost().empty()) << "it may have been given back meanwhile";
  EXPECT_EQ(copies_.next_due(), milliseconds(1) + NameCopies::kCatchUp);
  (void)copies_.forget(milliseconds(1) + NameCopies::kCatchUp);
  EXPECT_EQ(copies_.take_lost().size(), 1u) << "one that is held is not taken over";
}

TEST_F(NameCopiesTest, WhoeverStandsAtAHubThatCouldNotBeReachedKeepsTheName) {
  (void)copies_.take(names(0, 1, {{"a", node_claim(2, 1, 1)}}));
  (void)copies_.set_reachable({}, milliseconds(0));
  for (const std::uint32_t node : {1, 2, 3}) {
    copies_.put_own("a", node_claim(1, node));
    EXPECT_EQ(copies_.find("a")->claim->rank, kOrdinaryRank - 1) << "however often it is taken";
  }
  (void)copies_.set_reachable(runs(), milliseconds(1));
  (void)copies_.forget(milliseconds(1) + NameCopies::kCatchUp);
  EXPECT_EQ(copies_.take_lost().size(), 1u);
  EXPECT_EQ(copies_.find("a")->hub, kThere);
}

TEST_F(NameCopiesTest, ANodeThatHasMovedMeanwhileTakesNothingByAnOldRecord) {
  (void)copies_.take(names(0, 1, {{"a", node_claim(2, 1, 1)}}));
  (void)copies_.set_reachable({}, milliseconds(0));
  copies_.put_own("a", node_claim(1, 1));
  (void)copies_.set_reachable(runs(), milliseconds(1));
  auto away = node_claim(2, 1, 2);
  away.state = NameState::away;
  (void)copies_.take(names(1, 2, {{"a", away}}));
  (void)copies_.forget(milliseconds(1) + NameCopies::kCatchUp);
  EXPECT_TRUE(copies_.take_lost().empty());
  EXPECT_EQ(copies_.find("a")->hub, kHere);
}

TEST_F(NameCopiesTest, ANodeThatIsAwayGivesWayToOneThatIsThereWhateverItsRank) {
  auto mine = node_claim(1, 1);
  auto theirs = node_claim(2, 1, 1);
  theirs.rank = 0;
  copies_.put_own("a", mine);
  (void)copies_.take(names(0, 1, {{"a", theirs}}));
  EXPECT_TRUE(copies_.take_lost().empty());
  mine.state = NameState::away;
  copies_.put_own("a", mine);
  EXPECT_EQ(copies_.take_lost().size(), 1u);
  EXPECT_EQ(copies_.find("a")->hub, kThere);
  mine.state = NameState::held;
  copies_.put_own("a", mine);
  theirs = node_claim(2, 1, 2);
  theirs.rank = kOrdinaryRank + 9;
  theirs.state = NameState::away;
  (void)copies_.take(names(1, 2, {{"a", theirs}}));
  EXPECT_TRUE(copies_.take_lost().empty());
}

TEST_F(NameCopiesTest, AServiceGivesWayToANodeAndToNoService) {
  copies_.put_own("robot/laser", service_claim(1, 1, 1));
  (void)copies_.take(names(0, 1, {{"robot/laser", service_claim(2, 1, 1, 1)}}));
  EXPECT_TRUE(copies_.take_lost().empty());
  (void)copies_.take(names(1, 2, {{"robot/laser", node_claim(2, 9, 2)}}));
  EXPECT_EQ(copies_.take_lost().size(), 1u);
}

TEST_F(NameCopiesTest, TakesHalfOfAllNamesFromOneHubAndNoMore) {
  constexpr std::size_t kNameBytes = 512;
  constexpr std::uint32_t kMost = (std::uint32_t{1} << 20) / 2 / kNameBytes;
  const auto fill = [&](HubId hub, std::uint32_t more) {
    std::uint64_t version = copies_.known(hub)->version;
    for (; more > 0; --more) {
      std::string name = std::to_string(++version);
      name.insert(0, kNameBytes - NameIndex::kClaimBytes - name.size(), 'n');
      const auto claim = node_claim(hub.value(), static_cast<std::uint32_t>(version), version);
      const Names one{hub, kFirst, version - 1, version, 0, {{name, claim}}};
      if (copies_.take(one) != NameCopies::Taken::changed) break;
    }
    return more;
  };
  constexpr HubId kThird{3};
  constexpr HubId kFourth{4};
  (void)copies_.set_reachable(
      std::vector<HubRun>{{kThere, kFirst}, {kThird, kFirst}, {kFourth, kFirst}}, milliseconds(0));
  copies_.put_own(std::string(200, 'o'), node_claim(1, 1));
  EXPECT_EQ(fill(kThere, kMost), 0u);
  EXPECT_FALSE(copies_.starved());
  EXPECT_EQ(fill(kThere, 1), 1u) << "one beyond";
  EXPECT_EQ(copies_.known(kThere)->version, kMost);
  EXPECT_EQ(copies_.starved(), kThere);
  EXPECT_EQ(fill(kThird, kMost + 1), 1u) << "others have room, and own names take none";
  EXPECT_EQ(copies_.bytes_of_others(), options().bytes_max);
  EXPECT_EQ(fill(kFourth, 1), 1u);
  EXPECT_EQ(copies_.refused(), 3u);
  EXPECT_EQ(copies_.largest(), kThere);
  EXPECT_TRUE(copies_.take_starved().empty());
  Names mark{kThere, kFirst, kMost, kMost + 1, 0, {{"", test::mark(kMost + 1)}}};
  mark.records[0].name = copies_.find_node(make_id<NodeId>(kThere, 1))->name;
  EXPECT_EQ(copies_.take(mark), NameCopies::Taken::changed) << "a mark needs no room";
  (void)copies_.set_reachable(std::vector<HubRun>{{kThere, kFirst}, {kFourth, kFirst}},
                              milliseconds(0));
  (void)copies_.forget(kGrace);
  EXPECT_EQ(copies_.take_starved(), std::vector<HubId>{kFourth}) << "the other one has its share";
}

TEST_F(NameCopiesTest, KeepsOneNameOfEachVersionAndOfEachId) {
  (void)copies_.take(names(0, 5, {{"a", node_claim(2, 1, 5)}}));
  (void)copies_.take(names(0, 6, {{"b", node_claim(2, 2, 5)}}));
  EXPECT_FALSE(copies_.find("a")) << "the version is that of another name";
  (void)copies_.take(names(6, 7, {{"c", node_claim(2, 2, 7)}}));
  EXPECT_FALSE(copies_.find("b")) << "the node has another name";
  (void)copies_.take(names(0, 9, {{"d", node_claim(2, 2, 3)}, {"c", node_claim(2, 2, 7)}}));
  EXPECT_FALSE(copies_.find("d")) << "the node has a newer name";
  (void)copies_.set_reachable({}, milliseconds(0));
  (void)copies_.forget(kGrace);
  EXPECT_EQ(copies_.bytes(), 0u);
}

TEST_F(NameCopiesTest, TellsWhatChangedAtOtherHubs) {
  (void)copies_.take(names(0, 1, {{"a", node_claim(2, 1, 1)}}));
  copies_.put_own("own", node_claim(1, 1));
  (void)copies_.take(names(1, 2, {{"a", test::mark(2)}}));
  const auto changes = copies_.take_changes();
  ASSERT_EQ(changes.size(), 2u);
  EXPECT_TRUE(!changes[0].before && changes[0].after);
  EXPECT_TRUE(changes[1].before && !changes[1].after);
}

TEST_F(NameCopiesTest, BeginsItsOwnNamesAnewUnderAnotherHubId) {
  copies_.put_own("a", node_claim(1, 1));
  (void)copies_.take(names(0, 1, {{"b", node_claim(2, 1, 1)}}));
  copies_.renumber(HubId{5});
  EXPECT_FALSE(copies_.find("a"));
  EXPECT_TRUE(copies_.find("b"));
  copies_.put_own("a", node_claim(5, 1));
  NamesPosition at{copies_.self().instance, 0, 0};
  EXPECT_EQ(copies_.next(HubId{5}, at)->records.size(), 1u);
}

}  // namespace
}  // namespace gimnet::hub
