#include "hub/network/state/name_exchange.hpp"

#include <gtest/gtest.h>

#include <deque>
#include <map>

#include "tests/hub/network/state/support/names.hpp"

namespace gimnet::hub {
namespace {

using std::chrono::milliseconds;
using test::node_claim;

/// Hubs 1..n in a row or a ring: hub i has link i to the next one and link i - 1 to the one before.
/// What is sent waits until it is delivered.
class Row {
 public:
  explicit Row(std::uint16_t hubs) {
    for (std::uint16_t hub = 1; hub <= hubs; ++hub) {
      runs_.push_back({HubId{hub}, proto::HubInstance{hub}});
      hubs_.emplace_back(NameCopies::Options{runs_.back()});
    }
    for (std::uint16_t hub = 1; hub <= hubs; ++hub) reach(hub, runs_);
  }
  NameExchange& hub(std::uint16_t hub) { return hubs_[hub - 1u]; }
  void reach(std::uint16_t at, std::vector<HubRun> runs) {
    std::erase_if(runs, [at](const HubRun& run) { return run.hub == HubId{at}; });
    hub(at).set_reachable(runs, now_);
  }
  void connect(std::uint32_t link, std::uint16_t a, std::uint16_t b) {
    ends_[link] = {a, b};
    for (const std::uint16_t end : {a, b}) hub(end).begin_connection(LinkNumber{link}, now_);
  }
  void disconnect(std::uint32_t link) {
    for (const std::uint16_t end : {ends_[link].first, ends_[link].second})
      hub(end).end_link(LinkNumber{link});
    ends_.erase(link);
  }
  /// Until nothing is sent any more. Returns how many messages were.
  int settle() {
    int messages = 0;
    while (step()) ++messages;
    return messages;
  }
  /// Delivers one message.
  bool step() {
    for (std::uint16_t at = 1; at <= hubs_.size(); ++at) {
      hub(at).advance(now_);
      for (const Sending& each : hub(at).take_sendings()) under_way_.emplace_back(at, each);
    }
    if (under_way_.empty()) return false;
    const auto [from, sending] = under_way_.front();
    under_way_.pop_front();
    const auto end = ends_.find(sending.link.value());
    if (end == ends_.end()) return true;
    const auto [a, b] = end->second;
    hub(from == a ? b : a).take(sending.link, *sending.bytes, now_);
    return true;
  }
  [[nodiscard]] std::size_t names_under_way() const {
    return static_cast<std::size_t>(std::ranges::count_if(under_way_, [](const auto& each) {
      return proto::split_control(*each.second.bytes)->header.operation ==
             proto::route::Names::kOperation;
    }));
  }

 private:
  milliseconds now_{1'000};
  std::vector<HubRun> runs_;
  std::deque<NameExchange> hubs_;
  std::map<std::uint32_t, std::pair<std::uint16_t, std::uint16_t>> ends_;
  std::deque<std::pair<std::uint16_t, Sending>> under_way_;
};

TEST(NameExchange, ANameIsKnownAtTheOtherEndOfAChain) {
  Row row(8);
  for (std::uint16_t hub = 1; hub < 8; ++hub) row.connect(hub, hub, hub + 1);
  row.hub(1).put_own("robot", node_claim(1, 17));
  row.settle();
  const auto found = row.hub(8).copies().find("robot");
  ASSERT_TRUE(found);
  EXPECT_EQ(found->claim->node, (make_id<NodeId>(HubId{1}, 17)));
  row.hub(1).remove_own("robot");
  row.settle();
  EXPECT_FALSE(row.hub(8).copies().find("robot"));
}

TEST(NameExchange, ALateLinkBringsWhatWasThereAndOnlyThat) {
  Row row(3);
  row.connect(1, 1, 2);
  row.hub(1).put_own("a", node_claim(1, 1));
  row.settle();
  row.connect(2, 2, 3);
  row.settle();
  EXPECT_TRUE(row.hub(3).copies().find("a"));
  row.disconnect(2);
  row.connect(2, 2, 3);
  EXPECT_EQ(row.settle(), 2) << "each side says what it knows";
}

TEST(NameExchange, SendsAChangeOnceOverEachLinkOfAChain) {
  Row row(3);
  row.connect(1, 1, 2);
  row.connect(2, 2, 3);
  row.settle();
  row.hub(2).put_own("a", node_claim(2, 1));
  EXPECT_EQ(row.settle(), 4) << "one and its answer over each link";
}

TEST(NameExchange, HasAtMostAWindowUnderWay) {
  Row row(2);
  for (std::uint32_t node = 1; node <= 2'000; ++node)
    row.hub(1).put_own("robot/" + std::to_string(node), node_claim(1, node));
  row.connect(1, 1, 2);
  std::size_t most = 0;
  while (row.step()) most = std::max(most, row.names_under_way());
  EXPECT_GT(most, 1u);
  EXPECT_LE(most, proto::route::kNamesWindow);
  EXPECT_EQ(row.hub(2).copies().size(), 2'000u);
}

TEST(NameExchange, AsksForAHubThatItReachesLater) {
  Row row(2);
  row.reach(2, {});
  row.connect(1, 1, 2);
  row.hub(1).put_own("a", node_claim(1, 1));
  row.settle();
  EXPECT_FALSE(row.hub(2).copies().find("a"));
  row.reach(2, {{HubId{1}, proto::HubInstance{1}}});
  row.settle();
  EXPECT_TRUE(row.hub(2).copies().find("a"));
}

TEST(NameExchange, OfTwoClaimsOneIsLost) {
  Row row(2);
  row.hub(1).put_own("a", node_claim(1, 5));
  row.hub(2).put_own("a", node_claim(2, 5));
  row.connect(1, 1, 2);
  row.settle();
  EXPECT_TRUE(row.hub(1).take_lost().empty());
  EXPECT_EQ(row.hub(2).take_lost().size(), 1u);
}

TEST(NameExchange, IsLearningForAWhileAfterALinkCameUp) {
  NameExchange names{NameCopies::Options{{HubId{1}, proto::HubInstance{1}}}};
  EXPECT_FALSE(names.is_learning(milliseconds(0)));
  names.begin_connection(LinkNumber{1}, milliseconds(100));
  EXPECT_TRUE(names.is_learning(milliseconds(99) + NameExchange::kLearning));
  EXPECT_FALSE(names.is_learning(milliseconds(100) + NameExchange::kLearning));
}

TEST(NameExchange, CountsWhatIsNoMessage) {
  NameExchange names{NameCopies::Options{{HubId{1}, proto::HubInstance{1}}}};
  names.begin_connection(LinkNumber{1}, milliseconds(0));
  const auto bytes =
      proto::encode(proto::route::NamesKnown{{{HubId{0}, proto::HubInstance{1}, 0}}});
  names.take(LinkNumber{1}, bytes, milliseconds(0));
  EXPECT_EQ(names.malformed(), 1u);
  names.take(LinkNumber{9}, bytes, milliseconds(0));
  EXPECT_EQ(names.malformed(), 1u) << "there is no such link";
  names.advance(milliseconds(0));
  EXPECT_TRUE(names.take_sendings().empty());
}

}  // namespace
}  // namespace gimnet::hub
