#include "hub/network/state/name_index.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "tests/hub/network/state/support/names.hpp"

namespace gimnet::hub {
namespace {

using test::node_claim;
using test::service_claim;

TEST(NameIndex, FindsAClaimByNameAndById) {
  NameIndex index;
  index.put("robot", HubId{2}, node_claim(2, 17, 1));
  index.put("robot/laser", HubId{2}, service_claim(2, 17, 33, 2));
  EXPECT_TRUE(index.find("robot", HubId{2}));
  EXPECT_FALSE(index.find("robot", HubId{3}));
  EXPECT_EQ((*index.holder(node_claim(2, 17, 9)))->first.name, "robot");
  EXPECT_EQ((*index.holder(service_claim(2, 1, 33, 9)))->first.name, "robot/laser");
  EXPECT_FALSE(index.holder(node_claim(3, 17, 9)));
  EXPECT_EQ(index.live_of(HubId{2}).size(), 2u);
  EXPECT_EQ(index.live_of(HubId{1}).size() + index.live_of(HubId{3}).size(), 0u);
}

TEST(NameIndex, ListsTheClaimsToOneName) {
  NameIndex index;
  for (const std::uint16_t hub : std::vector<std::uint16_t>{3, 1, 2})
    index.put("b", HubId{hub}, node_claim(hub, 1, 1));
  index.put("a", HubId{1}, node_claim(1, 2, 1));
  index.put("b/c", HubId{1}, node_claim(1, 3, 1));
  std::vector<std::uint16_t> hubs;
  for (const auto& [key, claim] : index.claims_to("b")) hubs.push_back(key.hub.value());
  EXPECT_EQ(hubs, (std::vector<std::uint16_t>{1, 2, 3}));
}

TEST(NameIndex, ForgetsTheIdOfAClaimThatWasReplacedOrErased) {
  NameIndex index;
  index.put("robot", HubId{2}, node_claim(2, 17, 1));
  index.put("robot", HubId{2}, node_claim(2, 18, 2));
  EXPECT_FALSE(index.nodes().contains(make_id<NodeId>(HubId{2}, 17)));
  const auto place = index.put("robot", HubId{2}, test::mark(3));
  EXPECT_TRUE(index.nodes().empty());
  EXPECT_EQ(index.bytes(), NameIndex::count_of("robot"));
  index.erase(place);
  EXPECT_EQ(index.bytes(), 0u);
}

TEST(NameIndex, CountsWhatEachHubHas) {
  NameIndex index;
  index.put("robot", HubId{2}, node_claim(2, 17, 1));
  index.put("robot", HubId{2}, node_claim(2, 18, 2));
  index.put("robot/laser", HubId{2}, service_claim(2, 1, 18, 3));
  index.put("other", HubId{3}, node_claim(3, 1, 1));
  EXPECT_EQ(index.counts_of(HubId{2}).nodes, 1u);
  EXPECT_EQ(index.counts_of(HubId{2}).services, 1u);
  EXPECT_EQ(index.counts_of(HubId{3}).nodes, 1u);
  EXPECT_EQ(index.counts_of(HubId{3}).bytes, NameIndex::count_of("other"));
  const auto mark = index.put("robot", HubId{2}, test::mark(4));
  EXPECT_EQ(index.counts_of(HubId{2}).nodes, 0u);
  EXPECT_EQ(index.counts_of(HubId{2}).bytes,
            NameIndex::count_of("robot") + NameIndex::count_of("robot/laser"));
  index.erase(mark);
  EXPECT_EQ(index.counts_of(HubId{2}).bytes, NameIndex::count_of("robot/laser"));
  EXPECT_EQ(index.counts_of(HubId{4}).nodes, 0u);
}

TEST(NameIndex, OfTwoClaimsTheSameOneWinsFromBothSides) {
  const auto low = node_claim(1, 5, 1);
  const auto high = node_claim(2, 5, 1);
  auto taken_over = node_claim(3, 5, 1);
  taken_over.rank = proto::route::kOrdinaryRank + 1;
  auto away = taken_over;
  away.state = proto::route::NameState::away;
  const auto service = service_claim(1, 1, 1, 1);
  EXPECT_TRUE(wins(low, high) && !wins(high, low));
  EXPECT_TRUE(wins(taken_over, low) && !wins(low, taken_over));
  EXPECT_TRUE(wins(low, away) && !wins(away, low));
  EXPECT_TRUE(wins(away, service) && !wins(service, away));
  EXPECT_TRUE(wins(high, service) && !wins(service, high));
}

}  // namespace
}  // namespace gimnet::hub
