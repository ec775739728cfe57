#include "hub/control/state/journal.hpp"

#include <gtest/gtest.h>

namespace gimnet::hub {
namespace {

namespace ns = proto::ns;

using Subject = std::variant<NodeId, GroupId>;

constexpr HubId kHub{7};

Subject node(std::uint32_t index) { return make_id<NodeId>(kHub, index); }

ns::Change node_change(std::uint32_t index, std::size_t name_bytes = 5) {
  ns::Change change;
  change.kind = ns::ChangeKind::joined;
  change.node.emplace();
  change.node->node = make_id<NodeId>(kHub, index);
  change.node->name = std::string(name_bytes, 'n');
  return change;
}

TEST(Journal, NumbersChangesWithoutGaps) {
  const Limits limits;
  Journal journal(9, limits);
  journal.begin();
  EXPECT_EQ(journal.version(), 0u);
  EXPECT_TRUE(journal.reaches(0));
  for (std::uint32_t i = 1; i <= 5; ++i) journal.add(node_change(i));
  EXPECT_EQ(journal.version(), 5u);
  EXPECT_EQ(journal.epoch(), 9u);
  for (std::uint32_t i = 1; i <= 5; ++i) EXPECT_EQ(journal.at(i).subject, node(i));
  EXPECT_FALSE(journal.reaches(6)) << "the future";
}

TEST(Journal, KeepsSoManyChanges) {
  Limits limits;
  limits.watch_changes = 3;
  Journal journal(9, limits);
  journal.begin();
  for (std::uint32_t i = 1; i <= 3; ++i) journal.add(node_change(i));
  EXPECT_TRUE(journal.reaches(0));
  journal.add(node_change(4));
  EXPECT_FALSE(journal.reaches(0));
  EXPECT_TRUE(journal.reaches(1));
  EXPECT_EQ(journal.at(2).subject, node(2));
  EXPECT_EQ(journal.at(4).subject, node(4));
}

TEST(Journal, KeepsSoManyBytes) {
  Limits limits;
  limits.watch_bytes = 64 * 1024;
  Journal journal(9, limits);
  journal.begin();
  for (std::uint32_t i = 1; i <= 1'000; ++i) journal.add(node_change(i, 255));
  EXPECT_TRUE(journal.reaches(1'000 - 64));
  EXPECT_FALSE(journal.reaches(1'000 - 256));
}

TEST(Journal, OnlyCountsUntilItBegins) {
  const Limits limits;
  Journal journal(9, limits);
  EXPECT_FALSE(journal.keeps());
  for (int i = 0; i < 3; ++i) journal.pass();
  EXPECT_EQ(journal.version(), 3u);
  EXPECT_FALSE(journal.reaches(2));
  EXPECT_TRUE(journal.reaches(3));
  journal.begin();
  EXPECT_TRUE(journal.keeps());
  journal.add(node_change(4));
  EXPECT_FALSE(journal.reaches(2)) << "what was only counted";
  EXPECT_TRUE(journal.reaches(3));
  EXPECT_EQ(journal.at(4).subject, node(4));
}

TEST(Journal, TellsServicesFromNodes) {
  const Limits limits;
  Journal journal(9, limits);
  journal.begin();
  ns::Change change;
  change.kind = ns::ChangeKind::advertised;
  change.service.emplace();
  change.service->group = make_id<GroupId>(kHub, 3);
  change.service->name = "robot/odom";
  journal.add(std::move(change));
  EXPECT_EQ(journal.at(1).subject, Subject{make_id<GroupId>(kHub, 3)});
  EXPECT_EQ(journal.at(1).name, "robot/odom");
}

TEST(Journal, ReachesNothingThatWasBeforeItBeganAgain) {
  const Limits limits;
  Journal journal(1, limits);
  journal.begin();
  journal.add(node_change(1));
  journal.begin_again();
  EXPECT_FALSE(journal.reaches(1));
  EXPECT_TRUE(journal.reaches(journal.version()));
  journal.add(node_change(2));
  EXPECT_EQ(journal.at(journal.version()).subject, node(2));
}

}  // namespace
}  // namespace gimnet::hub
