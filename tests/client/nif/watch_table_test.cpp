#include "client/nif/watch_table.hpp"

#include <gtest/gtest.h>

#include "tests/client/nif/support/fake_hub.hpp"
#include "tests/client/nif/support/recording_host.hpp"

namespace gimnet::nif {
namespace {

namespace ns = proto::ns;

ns::WatchEvents events(std::uint32_t watch, std::uint64_t after, std::uint64_t version,
                       ns::ChangeKind kind) {
  ns::WatchEvents made;
  made.watch = watch;
  made.hub = HubId{7};
  made.epoch = 5;
  made.after = after;
  made.version = version;
  made.changes.resize(1);
  made.changes[0].kind = kind;
  made.changes[0].version = version;
  return made;
}

/// A table that is not connected: what it would send goes nowhere.
class WatchTableTest : public testing::Test {
 protected:
  net::WakeSignal wake_;
  Outbound outbound_{SendQueue::Limits{}, wake_};
  RequestTable requests_{outbound_};
  WatchTable watches_{requests_};
};

TEST_F(WatchTableTest, GivesEachWatchANumberOfItsOwn) {
  const ns::Watch a = watches_.add("a/*", ns::kWatchNodes, false);
  const ns::Watch b = watches_.add("", ns::kWatchAll, false);
  EXPECT_NE(a.watch, 0u);
  EXPECT_NE(a.watch, b.watch);
  EXPECT_EQ(a.pattern, "a/*");
  EXPECT_EQ(a.subjects, ns::kWatchNodes);
  EXPECT_TRUE(watches_.remove(a.watch));
  EXPECT_FALSE(watches_.remove(a.watch));
}

TEST_F(WatchTableTest, TakesASnapshotAndWhatFollowsWithoutAGap) {
  const std::uint32_t number = watches_.add("", ns::kWatchAll, false).watch;
  EXPECT_FALSE(watches_.on_events(events(number, 3, 4, ns::ChangeKind::joined)))
      << "it has not begun";
  EXPECT_TRUE(watches_.on_events(events(number, 9, 9, ns::ChangeKind::begin)));
  EXPECT_TRUE(watches_.on_events(events(number, 9, 12, ns::ChangeKind::joined)));
  EXPECT_TRUE(watches_.on_events(events(number, 12, 13, ns::ChangeKind::left)));
  EXPECT_FALSE(watches_.on_events(events(number + 1, 13, 14, ns::ChangeKind::left)))
      << "of no watch";
}

TEST_F(WatchTableTest, BeginsAnewBehindAGap) {
  const std::uint32_t number = watches_.add("", ns::kWatchAll, false).watch;
  ASSERT_TRUE(watches_.on_events(events(number, 9, 9, ns::ChangeKind::begin)));
  EXPECT_FALSE(watches_.on_events(events(number, 11, 12, ns::ChangeKind::joined)));
  EXPECT_FALSE(watches_.on_events(events(number, 12, 13, ns::ChangeKind::joined)))
      << "until there is a snapshot";
  EXPECT_TRUE(watches_.on_events(events(number, 13, 13, ns::ChangeKind::begin)));
}

TEST_F(WatchTableTest, AsksToGoOnWhereItWas) {
  const std::uint32_t number = watches_.add("", ns::kWatchAll, false).watch;
  ASSERT_TRUE(watches_.on_events(events(number, 9, 9, ns::ChangeKind::begin)));
  ASSERT_TRUE(watches_.on_events(events(number, 9, 12, ns::ChangeKind::joined)));
  const ns::Watch again = watches_.again(number);
  EXPECT_EQ(again.watch, number);
  EXPECT_EQ(again.epoch, 0u) << "a new snapshot was asked for";
  EXPECT_FALSE(watches_.on_events(events(number, 12, 13, ns::ChangeKind::joined)));
  EXPECT_EQ(watches_.again(99).watch, 0u);
}

TEST_F(WatchTableTest, ARecordHoldsAllThatItPointsTo) {
  ns::WatchEvents made = events(3, 9, 12, ns::ChangeKind::renamed);
  made.changes[0].former_name = "old";
  made.changes[0].node.emplace();
  made.changes[0].node->node = NodeId{0x00700012};
  made.changes[0].node->name = "robot";
  Record* record = make_watched(made, made.changes[0]);
  made.changes.clear();
  nif_incoming in = record->incoming;
  ASSERT_NE(in.watched, nullptr);
  EXPECT_EQ(in.type, static_cast<std::uint32_t>(NIF_WATCHED));
  EXPECT_EQ(in.watched->watch, 3u);
  EXPECT_EQ(in.watched->change, static_cast<std::uint32_t>(NIF_NODE_RENAMED));
  EXPECT_EQ(in.watched->hub_id, 7u);
  EXPECT_EQ(in.watched->version, 12u);
  EXPECT_EQ(in.watched->last, 1);
  EXPECT_STREQ(in.watched->former_name, "old");
  ASSERT_NE(in.watched->node, nullptr);
  EXPECT_STREQ(in.watched->node->name, "robot");
  EXPECT_EQ(in.watched->service, nullptr);
  nif_release(&in);
  EXPECT_EQ(in.watched, nullptr);
}

}  // namespace
}  // namespace gimnet::nif
