#include "hub/network/state/network_map.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "tests/hub/network/state/support/hubs.hpp"

namespace gimnet::hub {
namespace {

using namespace test;

/// The links that the hubs report, as seen by hub 1. The link to hub n has the number n.
class Drawing {
 public:
  /// Both ends report it, at this cost.
  Drawing& edge(std::uint16_t a, std::uint16_t b, std::uint16_t cost = 10) {
    says(hub_key(a), hub_key(b), cost);
    return says(hub_key(b), hub_key(a), cost);
  }
  Drawing& says(const proto::HubKey& from, const proto::HubKey& to, std::uint16_t cost) {
    said_[from][to] = cost;
    said_[to];
    return *this;
  }
  Drawing& drawn(const proto::HubKey& hub) {
    drawn_.push_back(hub);
    return *this;
  }
  [[nodiscard]] NetworkMap map() const {
    RecordStore store;
    std::vector<CarryingLink> links;
    for (const auto& [hub, neighbours] : said_) {
      const bool configured = std::ranges::find(drawn_, hub) == drawn_.end();
      store.take(
          part({hub, proto::HubInstance{1}, configured}, 1, {neighbours.begin(), neighbours.end()}),
          milliseconds(0));
      if (hub != kSelf.key) continue;
      for (const auto& [to, cost] : neighbours)
        links.push_back({{to, cost}, LinkNumber{to.hub.value()}});
    }
    return {kSelf, store, links};
  }

  static inline const HubIdentity kSelf = identity(1, 1);

 private:
  std::map<proto::HubKey, std::map<proto::HubKey, std::uint16_t>> said_;
  std::vector<proto::HubKey> drawn_;
};

/// Next hop, cost and hops. Nothing: there is no way.
using Found = std::tuple<std::uint32_t, std::uint32_t, int>;
std::optional<Found> way_to(const NetworkMap& map, std::uint16_t hub) {
  for (const Way& way : map.ways()) {
    if (way.hub.hub != HubId{hub}) continue;
    EXPECT_EQ(map.next_hops()[hub], way.link);
    return Found{way.link.value(), way.cost, way.hops};
  }
  EXPECT_EQ(map.next_hops()[hub], LinkNumber{});
  return std::nullopt;
}

TEST(NetworkMap, TakesTheCheapestWay) {
  const auto map = Drawing().edge(1, 2, 30).edge(1, 3).edge(3, 2).edge(2, 4, 7).map();
  EXPECT_EQ(way_to(map, 2), (Found{3, 20, 2}));
  EXPECT_EQ(way_to(map, 3), (Found{3, 10, 1}));
  EXPECT_EQ(way_to(map, 4), (Found{3, 27, 3}));
  EXPECT_EQ(way_to(map, 1), std::nullopt) << "no way leads to itself";
  EXPECT_EQ(way_to(map, 5), std::nullopt);
  EXPECT_EQ(map.reachable().size(), 4u);
}

TEST(NetworkMap, TakesFewerHopsAndThenTheLowestNextHub) {
  EXPECT_EQ(way_to(Drawing().edge(1, 2).edge(2, 4).edge(1, 4, 20).map(), 4), (Found{4, 20, 1}));
  const auto square = Drawing().edge(1, 3).edge(3, 4).edge(1, 2).edge(2, 4).edge(4, 5).map();
  EXPECT_EQ(way_to(square, 4), (Found{2, 20, 2}));
  EXPECT_EQ(way_to(square, 5), (Found{2, 30, 3}));
}

TEST(NetworkMap, CountsAnEdgeThatBothEndsReport) {
  const auto one_end = Drawing().edge(1, 2).says(hub_key(2), hub_key(3), 10).map();
  EXPECT_EQ(way_to(one_end, 3), std::nullopt);
  const auto other_end = Drawing().edge(1, 2).says(hub_key(3), hub_key(2), 10).map();
  EXPECT_EQ(way_to(other_end, 3), std::nullopt);
  const auto own_end = Drawing().says(hub_key(1), hub_key(2), 10).map();
  EXPECT_EQ(way_to(own_end, 2), std::nullopt);
  const auto former =
      Drawing().says(hub_key(1), hub_key(2, 8), 10).says(hub_key(2, 9), hub_key(1), 10).map();
  EXPECT_EQ(way_to(former, 2), std::nullopt) << "of the dead predecessor";
}

TEST(NetworkMap, CountsTheHigherCostOfTheTwoEnds) {
  const auto map =
      Drawing().edge(1, 2).says(hub_key(2), hub_key(3), 5).says(hub_key(3), hub_key(2), 50).map();
  EXPECT_EQ(way_to(map, 3), (Found{2, 60, 2}));
  const auto own = Drawing().says(hub_key(1), hub_key(2), 5).says(hub_key(2), hub_key(1), 50).map();
  EXPECT_EQ(way_to(own, 2), (Found{2, 50, 1}));
}

TEST(NetworkMap, CrossesAtMost31Links) {
  Drawing chain;
  for (std::uint16_t hub = 1; hub < 40; ++hub) chain.edge(hub, hub + 1, 65'535);
  const auto map = chain.map();
  EXPECT_EQ(way_to(map, 32), (Found{2, 31 * 65'535, 31}));
  EXPECT_EQ(way_to(map, 33), (Found{0, 32 * 65'535, 32})) << "too far";
  EXPECT_EQ(map.reachable().size(), 40u);
}

TEST(NetworkMap, LeadsToThePreferredOfTwoHubsWithOneId) {
  const auto low = hub_key(7, 1);
  const auto high = hub_key(7, 9);
  const auto two = [&](Drawing drawing) {
    return drawing.edge(1, 2)
        .edge(1, 3)
        .says(hub_key(2), low, 10)
        .says(low, hub_key(2), 10)
        .says(hub_key(3), high, 10)
        .says(high, hub_key(3), 10)
        .map();
  };
  EXPECT_EQ(way_to(two({}), 7), (Found{2, 20, 2})) << "the lower unique id";
  EXPECT_EQ(way_to(two(Drawing().drawn(low)), 7), (Found{3, 20, 2})) << "the configured id";
  EXPECT_EQ(way_to(two(Drawing().drawn(high).drawn(low)), 7), (Found{2, 20, 2}));
  EXPECT_EQ(two({}).reachable().size(), 5u) << "both can be reached";
}

TEST(NetworkMap, SeesWhoKeepsItsOwnId) {
  const auto beside = [](Drawing drawing, const proto::HubKey& other) {
    return drawing.edge(1, 2).says(hub_key(2), other, 10).says(other, hub_key(2), 10).map();
  };
  const auto lower = proto::HubKey{HubId{1}, {}};
  const auto higher = hub_key(1, 200);
  const auto holder = beside({}, lower).own_id_holder();
  ASSERT_TRUE(holder);
  EXPECT_EQ(holder->hub, lower);
  EXPECT_FALSE(beside({}, higher).own_id_holder());
  EXPECT_FALSE(beside(Drawing().drawn(lower), lower).own_id_holder());
  const auto out_of_reach = Drawing().says(lower, hub_key(2), 10).edge(1, 2).map();
  EXPECT_FALSE(out_of_reach.own_id_holder());
}

TEST(NetworkMap, OfOneHubHasNoWay) {
  const NetworkMap map(Drawing::kSelf);
  EXPECT_EQ(map.reachable(), std::vector{Drawing::kSelf.key});
  EXPECT_TRUE(map.ways().empty());
  EXPECT_EQ(NetworkMap(Drawing::kSelf, RecordStore(), {}).reachable(), map.reachable());
}

}  // namespace
}  // namespace gimnet::hub
