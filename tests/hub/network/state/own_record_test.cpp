#include "hub/network/state/own_record.hpp"

#include <gtest/gtest.h>

#include "tests/hub/network/state/support/hubs.hpp"

namespace gimnet::hub {
namespace {

using namespace test;
using proto::route::Neighbour;

constexpr milliseconds kBegin{1'000};

std::vector<Neighbour> neighbours_up_to(std::uint16_t most) {
  std::vector<Neighbour> neighbours;
  for (std::uint16_t hub = 1; hub <= most; ++hub) neighbours.push_back({hub_key(hub), 10});
  return neighbours;
}

OwnRecord make_record() { return OwnRecord(identity(4'000, 7), {"lab", "1.0", 1, 2}); }

TEST(OwnRecord, SaysItselfBeforeItHasNeighbours) {
  OwnRecord record = make_record();
  const auto due = record.take_due(kBegin);
  ASSERT_EQ(due.size(), 1u);
  const auto& first = due.front()->said;
  EXPECT_EQ(first.hub, hub_key(4'000));
  EXPECT_EQ(first.sequence, 1u);
  EXPECT_EQ(first.name, "lab");
  EXPECT_EQ(first.features_required, 2u);
  EXPECT_TRUE(first.configured);
  EXPECT_EQ(read_part(due.front()->bytes)->said, first);
  EXPECT_FALSE(record.next_due()) << "nothing changed";
}

TEST(OwnRecord, ChangesOnlyThePartOfANeighbour) {
  OwnRecord record = make_record();
  record.set_neighbours(neighbours_up_to(130));
  EXPECT_EQ(record.take_due(kBegin).size(), 3u);
  auto neighbours = neighbours_up_to(130);
  neighbours.erase(neighbours.begin());
  record.set_neighbours(neighbours);
  auto due = record.take_due(kBegin + milliseconds(50));
  ASSERT_EQ(due.size(), 1u);
  EXPECT_EQ(due.front()->said.part, 0);
  EXPECT_EQ(due.front()->said.neighbours.size(), 63u);
  EXPECT_EQ(due.front()->said.sequence, 4u) << "one counter for all parts";

  record.set_neighbours(neighbours_up_to(64));
  due = record.take_due(kBegin + milliseconds(1'000));
  ASSERT_EQ(due.size(), 3u);
  EXPECT_TRUE(due[2]->said.neighbours.empty()) << "a part no longer needed is sent empty";
  neighbours = neighbours_up_to(64);
  neighbours[5].cost = 20;
  record.set_neighbours(neighbours);
  due = record.take_due(kBegin + milliseconds(5'000));
  ASSERT_EQ(due.size(), 1u);
  EXPECT_EQ(due.front()->said.neighbours[5].cost, 20);
}

TEST(OwnRecord, HasRoomForAllHubs) {
  OwnRecord record = make_record();
  record.set_neighbours(neighbours_up_to(kHubIdMax));
  EXPECT_EQ(record.take_due(kBegin).size(), 64u);
}

TEST(OwnRecord, SaysAChangeAtOnceAndThenMoreAndMoreSlowly) {
  OwnRecord record = make_record();
  (void)record.take_due(kBegin);
  std::uint16_t cost = 1;
  std::vector<std::int64_t> times;
  // A change each 10 ms.
  for (milliseconds now = kBegin; now < kBegin + std::chrono::seconds(5); now += milliseconds(10)) {
    record.set_neighbours({{hub_key(1), ++cost}});
    EXPECT_TRUE(record.next_due());
    if (!record.take_due(now).empty()) times.push_back((now - kBegin).count());
  }
  EXPECT_EQ(times, (std::vector<std::int64_t>{50, 150, 350, 750, 1'550, 2'550, 3'550, 4'550}));
  record.set_neighbours({{hub_key(1), 1}});
  const auto later = kBegin + std::chrono::seconds(20);
  EXPECT_EQ(record.take_due(later).size(), 1u);
  record.set_neighbours({{hub_key(1), 2}});
  EXPECT_EQ(record.next_due(), later + milliseconds(50)) << "quiet time begins anew";
  EXPECT_TRUE(record.take_due(later).empty());
  record.hurry();
  EXPECT_EQ(record.take_due(later).size(), 1u) << "the hub ends, and cannot wait";
}

TEST(OwnRecordGoesOn, BehindAFormerLife) {
  OwnRecord record = make_record();
  record.set_neighbours(neighbours_up_to(65));
  (void)record.take_due(kBegin);
  record.hear(said(identity(4'000, 6), 40));
  EXPECT_FALSE(record.living_copy());
  const auto due = record.take_due(kBegin);
  ASSERT_EQ(due.size(), 2u) << "all parts";
  EXPECT_EQ(due[0]->said.sequence, 41u);
  EXPECT_EQ(due[1]->said.sequence, 42u);
  EXPECT_EQ(due[0]->said.behind, proto::HubInstance{6});
  record.hear(said(identity(4'000, 6), 40));
  EXPECT_FALSE(record.next_due()) << "that one is passed";
}

TEST(OwnRecordGoesOn, BehindEqualSequencesAndWhatItWillSayNext) {
  OwnRecord record = make_record();
  (void)record.take_due(kBegin);
  record.hear(said(identity(4'000, 6), 1));
  EXPECT_EQ(record.take_due(kBegin).size(), 1u) << "equal";
  // It would hold against part 1, once there is one.
  record.hear(said(identity(4'000, 6), 9, {}, 1));
  EXPECT_EQ(record.take_due(kBegin + std::chrono::seconds(1)).front()->said.sequence, 10u);
}

TEST(OwnRecordGoesOn, BehindAPartThatIsNewerThanItsOwn) {
  OwnRecord record = make_record();
  record.set_neighbours(neighbours_up_to(65));
  (void)record.take_due(kBegin);
  auto neighbours = neighbours_up_to(65);
  neighbours.back().cost = 11;
  record.set_neighbours(neighbours);
  EXPECT_EQ(record.take_due(kBegin + std::chrono::seconds(1)).front()->said.sequence, 3u);
  // Part 1 has sequence 3 and part 0 still has 1, so this one would hold.
  record.hear(said(identity(4'000, 6), 2));
  EXPECT_EQ(record.take_due(kBegin + std::chrono::seconds(2)).size(), 2u);
}

TEST(OwnRecordGoesOn, AtMostOnceASecond) {
  OwnRecord record = make_record();
  (void)record.take_due(kBegin);
  record.hear(said(identity(4'000, 6), 40));
  EXPECT_EQ(record.take_due(kBegin).size(), 1u);
  record.hear(said(identity(4'000, 6), 50));
  EXPECT_TRUE(record.take_due(kBegin + milliseconds(999)).empty());
  EXPECT_EQ(record.next_due(), kBegin + milliseconds(1'000));
  EXPECT_EQ(record.take_due(kBegin + milliseconds(1'000)).front()->said.sequence, 51u);
}

TEST(OwnRecordGoesOn, NotBehindItsOwnWordsNorTheFarFuture) {
  OwnRecord record = make_record();
  (void)record.take_due(kBegin);
  record.hear(said(identity(4'000, 7), 1));
  record.hear(said(identity(4'000, 6), 0));
  record.hear(said(identity(4'000, 6), (std::uint64_t{1} << 32) + 2));
  EXPECT_FALSE(record.next_due());
  record.hear(said(identity(4'000, 7), 5));
  EXPECT_TRUE(record.next_due()) << "somebody invented it under the right instance";
}

TEST(OwnRecordCopy, IsOneThatWentOnBehindThisInstance) {
  OwnRecord record = make_record();
  (void)record.take_due(kBegin);
  auto copy = said(identity(4'000, 6), 40);
  copy.behind = proto::HubInstance{3};
  record.hear(copy);
  EXPECT_FALSE(record.living_copy()) << "a former life went on behind one before it";
  copy.behind = proto::HubInstance{7};
  copy.sequence = 50;
  record.hear(copy);
  EXPECT_FALSE(record.living_copy()) << "it may have ended since";
  EXPECT_EQ(record.take_due(kBegin + milliseconds(1'000)).front()->said.sequence, 51u);
  record.hear(copy);
  EXPECT_FALSE(record.living_copy()) << "the same record again";
  copy.sequence = 52;
  record.hear(copy);
  EXPECT_EQ(record.living_copy(), proto::HubInstance{6}) << "it heard this hub, and went on";
  record.forget_copy();
  EXPECT_FALSE(record.living_copy());
  (void)record.take_due(kBegin + milliseconds(3'000));
  copy.sequence = 53;
  record.hear(copy);
  EXPECT_FALSE(record.living_copy()) << "asked anew";
}

TEST(OwnRecordForged, SaysNothingInAPartThatItNeverSaid) {
  OwnRecord record = make_record();
  (void)record.take_due(kBegin);
  auto forged = said(record.identity(), 1, {{hub_key(2), 1}}, 3);
  record.hear(forged);
  auto due = record.take_due(kBegin + milliseconds(1'000));
  ASSERT_EQ(due.size(), 2u) << "it goes on, and parts 1 and 2 exist nowhere";
  EXPECT_EQ(due[1]->said.part, 3);
  EXPECT_TRUE(due[1]->said.neighbours.empty());
  EXPECT_GT(due[1]->said.sequence, 1u);
  forged.sequence = 500;
  record.hear(forged);
  due = record.take_due(kBegin + milliseconds(5'000));
  ASSERT_EQ(due.size(), 2u) << "it goes on behind it with all its parts";
  EXPECT_GT(due[1]->said.sequence, 500u);
  forged.instance = proto::HubInstance{1};
  forged.part = 5;
  record.hear(forged);
  EXPECT_TRUE(record.take_due(kBegin + milliseconds(9'000)).empty()) << "it does not count";
}

TEST(OwnRecordForged, SaysNoPartThatWasOnlySkipped) {
  OwnRecord record = make_record();
  (void)record.take_due(kBegin);
  const auto forge = [&](std::uint64_t sequence, std::uint16_t part) {
    record.hear(said(record.identity(), sequence, {}, part));
  };
  const auto parts_due = [&](std::chrono::seconds later) {
    std::vector<std::uint16_t> parts;
    for (const auto& part : record.take_due(kBegin + later)) parts.push_back(part->said.part);
    return parts;
  };
  using Parts = std::vector<std::uint16_t>;
  forge(40, 63);
  EXPECT_EQ(parts_due(std::chrono::seconds(2)), (Parts{0, 63}));
  forge(90, 0);
  EXPECT_EQ(parts_due(std::chrono::seconds(4)), (Parts{0, 63}));
  forge(200, 5);
  EXPECT_EQ(parts_due(std::chrono::seconds(6)), (Parts{0, 5, 63}))
      << "it was skipped, and is heard";
  record.renumber(HubId{9});
  EXPECT_EQ(parts_due(std::chrono::seconds(8)), (Parts{0, 5, 63}));
  record.set_neighbours(neighbours_up_to(65));
  EXPECT_EQ(parts_due(std::chrono::seconds(10)), (Parts{0, 1})) << "there is something in it now";
}

TEST(OwnRecordRenumber, GoesOnWithItsSequence) {
  OwnRecord record = make_record();
  record.set_neighbours(neighbours_up_to(65));
  (void)record.take_due(kBegin);
  record.renumber(HubId{9});
  const auto due = record.take_due(kBegin + milliseconds(50));
  ASSERT_EQ(due.size(), 2u);
  EXPECT_EQ(due[0]->said.hub.hub, HubId{9});
  EXPECT_EQ(due[0]->said.hub.unique, hub_key(4'000).unique);
  EXPECT_EQ(due[0]->said.sequence, 3u);
}

TEST(PreferredHub, HasAConfiguredIdThenTheLowerUniqueId) {
  const HubIdentity low{hub_key(5, 1), proto::HubInstance{1}, false};
  const HubIdentity high{hub_key(5, 2), proto::HubInstance{1}, true};
  EXPECT_TRUE(is_preferred(high, low));
  EXPECT_FALSE(is_preferred(low, high));
  HubIdentity equal = low;
  equal.configured = true;
  EXPECT_TRUE(is_preferred(equal, high));
  EXPECT_FALSE(is_preferred(high, equal));
}

}  // namespace
}  // namespace gimnet::hub
