#include "hub/control/handle/names.hpp"

#include <gtest/gtest.h>

#include "base/log.hpp"
#include "proto/control/ns_register.hpp"
#include "proto/control/ns_watch.hpp"
#include "tests/hub/control/support/test_conductor.hpp"

namespace gimnet::hub {
namespace {

using proto::Status;
namespace ns = proto::ns;

class WatchHandlerTest : public ::testing::Test, protected TestConductor {
 protected:
  WatchHandlerTest() { set_log_level(LogLevel::off); }
  ~WatchHandlerTest() override { set_log_level(LogLevel::info); }
  /// All changes that were told since the last call.
  std::vector<ns::Change> told() {
    while (conductor.tell_rest(now)) {
    }
    std::vector<ns::Change> changes;
    const auto all = events<ns::WatchEvents>();
    for (; taken_ < all.size(); ++taken_) {
      changes.insert(changes.end(), all[taken_].changes.begin(), all[taken_].changes.end());
    }
    return changes;
  }
  std::size_t taken_ = 0;
};

TEST_F(WatchHandlerTest, TellsASnapshotAndThenChanges) {
  const Node viewer = join("viewer");
  const auto answer = ask<ns::WatchAnswer>(viewer, ns::Watch{.watch = 1, .pattern = "*"});
  ASSERT_TRUE(answer);
  EXPECT_TRUE(answer->snapshot);
  EXPECT_EQ(told().size(), 3u);
  const Node robot = join("robot");
  ASSERT_TRUE(ask<ns::RegisterNameAnswer>(robot, ns::RegisterName{"forklift"}));
  detach(robot);
  const auto changes = told();
  ASSERT_EQ(changes.size(), 3u);
  EXPECT_EQ(changes[0].kind, ns::ChangeKind::joined);
  EXPECT_EQ(changes[0].node->node, robot.id);
  EXPECT_EQ(changes[1].kind, ns::ChangeKind::renamed);
  EXPECT_EQ(changes[1].former_name, "robot");
  EXPECT_EQ(changes[2].kind, ns::ChangeKind::away);
  EXPECT_FALSE(changes[2].node->connected);
}

TEST_F(WatchHandlerTest, AWatchEndsWithItsConnection) {
  const Node viewer = join("viewer");
  ASSERT_TRUE(ask<ns::WatchAnswer>(viewer, ns::Watch{.watch = 1}));
  told();
  proto::Hello hello;
  hello.name = "viewer";
  hello.token = viewer.welcome.token;
  join(hello);
  EXPECT_TRUE(told().empty());
  EXPECT_EQ(conductor.watches().size(), 0u);
}

TEST_F(WatchHandlerTest, WhatIsNotTakenIsNotFollowedByMore) {
  const Node viewer = join("viewer");
  ASSERT_TRUE(ask<ns::WatchAnswer>(viewer, ns::Watch{.watch = 1}));
  for (int i = 0; i < 100; ++i) {
    join("robot-" + std::to_string(i));
    static_cast<void>(conductor.tell_rest(now));
  }
  EXPECT_EQ(events<ns::WatchEvents>().size(), 4u);
  ASSERT_TRUE(ask<ns::WatchTakenAnswer>(viewer, ns::WatchTaken{1, 1}));
  static_cast<void>(conductor.tell_rest(now));
  EXPECT_EQ(events<ns::WatchEvents>().size(), 5u);
  ASSERT_TRUE(ask<ns::UnwatchAnswer>(viewer, ns::Unwatch{1}));
  EXPECT_EQ(ask<ns::UnwatchAnswer>(viewer, ns::Unwatch{1}).error().status, Status::not_found);
}

}  // namespace
}  // namespace gimnet::hub
