#include <gtest/gtest.h>

#include <array>
#include <map>
#include <set>

#include "hub/data/fanout/retained_messages.hpp"
#include "proto/gimi/message_header.hpp"
#include "tests/hub/shard/support/hub_rig.hpp"

// The budget of retained messages, and the fate of those that are not kept.

namespace gimnet::hub {
namespace {

using proto::Kind;
using testing::FakeNode;
using testing::HubRig;

using Texts = std::vector<std::string>;

/// A retained message counts 1,000 bytes at most, and those of one node 2,000 of the hub's 4,000.
class RetainedBudgetTest : public ::testing::Test {
 protected:
  static Limits limits() {
    Limits limits;
    limits.retained_message_bytes = 1'000;
    limits.retained_budget_bytes = 4'000;
    return limits;
  }
  /// The group has this provider; nobody has subscribed.
  void provide(std::uint32_t group, FakeNode& provider) {
    rig.publish_paced_group(group, provider.id, {}, true);
    providers[group] = &provider;
  }
  /// True: the hub keeps it, and says nothing; else it says so.
  [[nodiscard]] bool keeps(std::uint32_t group, const std::string& body, std::uint8_t flags = 0) {
    FakeNode& provider = *providers.at(group);
    provider.control.clear();
    rig.send(provider, HubRig::group(group), body, {.kind = Kind::group, .flags = flags});
    return told(group);
  }
  [[nodiscard]] bool told(std::uint32_t group) {
    FakeNode& provider = *providers.at(group);
    rig.settle();
    rig.pass_ms(20);  // reports keep their distance
    const auto reports = provider.reports();
    if (reports.empty()) return true;
    EXPECT_EQ(reports[0].reason, proto::DropReason::not_retained);
    EXPECT_EQ(reports[0].header.dst, HubRig::group(group));
    EXPECT_EQ(reports[0].count, 1u);
    return false;
  }
  [[nodiscard]] Texts kept(std::uint32_t group) {
    FakeNode& node = rig.join(1);
    rig.publish_paced_group(group, providers.at(group)->id, {&node}, true);
    rig.pace(node, group, {}, true);
    rig.settle();
    Texts texts;
    for (const auto& frame : node.frames) texts.push_back(frame.text());
    return texts;
  }
  void forget(std::uint32_t group) {
    rig.withdraw_group(group);
    rig.command(0, ForgetRetainedCommand{GroupId{HubRig::group(group)}, providers.at(group)->id});
    rig.turn();
  }

  HubRig rig{2, limits()};
  FakeNode& first = rig.join(0);
  FakeNode& second = rig.join(0);
  FakeNode& third = rig.join(0);
  std::map<std::uint32_t, FakeNode*> providers;
};

TEST_F(RetainedBudgetTest, OfAMessageWithAKeyTheGimiHeaderDoesNotCount) {
  provide(1, first);
  std::array<std::byte, proto::gimi::kMessagePrefixMax> prefix;
  const std::size_t size = proto::gimi::write_message_prefix({.sequence = 1}, 12'345, prefix);
  const std::string head =
      "key____1" + std::string(reinterpret_cast<const char*>(prefix.data()), size);
  EXPECT_TRUE(keeps(1, head + std::string(1'000, 'x'), proto::kFlagKeyed));
  EXPECT_FALSE(keeps(1, head + std::string(1'001, 'x'), proto::kFlagKeyed));
  EXPECT_TRUE(keeps(1, std::string(1'000, 'x')));
  EXPECT_FALSE(keeps(1, std::string(1'001, 'x')));
  EXPECT_EQ(kept(1), Texts{}) << "an older one would not be the last";
  EXPECT_EQ(rig.sum(&ShardCounters::not_retained), 2u);
}

TEST_F(RetainedBudgetTest, OneNodeHasHalfOfTheBudget) {
  for (const std::uint32_t group : {1u, 2u, 3u}) provide(group, first);
  provide(4, second);
  EXPECT_TRUE(keeps(1, std::string(1'000, 'a')));
  EXPECT_TRUE(keeps(2, std::string(1'000, 'b')));
  EXPECT_TRUE(keeps(2, std::string(1'000, 'c'))) << "in the place of the one before";
  EXPECT_FALSE(keeps(3, "x"));
  EXPECT_TRUE(keeps(4, std::string(1'000, 'd'))) << "another node has its own half";
  EXPECT_EQ(kept(2), Texts{std::string(1'000, 'c')});
  forget(1);
  EXPECT_TRUE(keeps(3, std::string(1'000, 'x')));
  EXPECT_EQ(kept(3), Texts{std::string(1'000, 'x')});
}

TEST_F(RetainedBudgetTest, AllNodesTogetherHaveTheBudget) {
  provide(1, first);
  provide(2, first);
  provide(3, second);
  provide(4, second);
  provide(5, third);
  for (const std::uint32_t group : {1u, 2u, 3u, 4u})
    EXPECT_TRUE(keeps(group, std::string(1'000, 'x')));
  EXPECT_FALSE(keeps(5, "x"));
  EXPECT_EQ(kept(5), Texts{});
  rig.release(first);
  rig.turn();
  EXPECT_TRUE(keeps(5, std::string(1'000, 'x'))) << "what a node that left had is free";
}

TEST_F(RetainedBudgetTest, ReportsOfEachGroupByItself) {
  for (const std::uint32_t group : {1u, 2u}) provide(group, first);
  for (const std::uint32_t group : {1u, 2u}) {
    rig.send(first, HubRig::group(group), std::string(1'001, 'x'), {.kind = Kind::group});
  }
  rig.settle();
  std::set<std::uint32_t> groups;
  for (const auto& report : first.reports()) groups.insert(report.header.dst);
  EXPECT_EQ(groups, (std::set<std::uint32_t>{HubRig::group(1), HubRig::group(2)}));
}

TEST_F(RetainedBudgetTest, AMessageThatComesTakesThePlaceOfTheLastWhereBothHaveNoRoom) {
  provide(1, first);
  provide(2, first);
  EXPECT_TRUE(keeps(1, std::string(800, 'a')));
  EXPECT_TRUE(keeps(2, std::string(800, 'b')));
  const auto fragment = [&](std::uint32_t number, std::uint32_t offset) {
    std::string all(proto::kFragmentHeaderSize, '\0');
    proto::store_fragment_header(reinterpret_cast<std::byte*>(all.data()), {number, offset, 1'000});
    rig.send(first, HubRig::group(2), all + std::string(500, static_cast<char>('0' + number)),
             {.kind = Kind::group, .flags = proto::kFlagFragment});
    rig.turn();
  };
  fragment(1, 0);
  EXPECT_TRUE(told(2));
  fragment(1, 500);
  EXPECT_EQ(kept(2).size(), 2u);
  EXPECT_EQ(kept(1), Texts{std::string(800, 'a')});
  provide(3, first);
  EXPECT_TRUE(keeps(3, std::string(200, 'c'))) << "exactly the half";
  EXPECT_FALSE(keeps(3, std::string(201, 'c')));
}

// The headers of many small pieces take more memory than the data.
TEST_F(RetainedBudgetTest, CountsHalfOfTheFramesWhereThatIsMore) {
  provide(1, first);
  for (std::uint32_t offset = 0; offset < 1'000; ++offset) {
    std::string all(proto::kFragmentHeaderSize, '\0');
    proto::store_fragment_header(reinterpret_cast<std::byte*>(all.data()), {1, offset, 1'000});
    rig.send(first, HubRig::group(1), all + "x",
             {.kind = Kind::group, .flags = proto::kFlagFragment});
    if (offset % 100 == 99) rig.turn();
  }
  EXPECT_FALSE(told(1));
  EXPECT_EQ(kept(1), Texts{});
}

}  // namespace
}  // namespace gimnet::hub
