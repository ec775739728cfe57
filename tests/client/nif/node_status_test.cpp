#include "client/nif/node_status.hpp"

#include <gtest/gtest.h>

namespace gimnet::nif {
namespace {

SessionTerms session_of(const char* name) {
  SessionTerms session;
  session.id = 17;
  session.name = name;
  return session;
}

TEST(NodeStatus, CountsConnectionsAfterTheFirst) {
  NodeStatus record;
  record.connected(session_of("robot"), true);
  EXPECT_EQ(record.info().reconnects, 0u);
  record.disconnected("why", false);
  EXPECT_EQ(record.info().connected, 0u);
  EXPECT_EQ(record.last_error(), "why");
  record.connected(session_of("robot"), false);
  EXPECT_EQ(record.info().reconnects, 1u);
  EXPECT_EQ(record.info().connected, 1u);
  EXPECT_STREQ(record.info().name, "robot");
}

TEST(NodeStatus, ANewNameIsTakenOnce) {
  NodeStatus record;
  record.set_name("arm", {std::byte{1}});
  EXPECT_STREQ(record.info().name, "arm");
  const auto given = record.take_new_name();
  ASSERT_TRUE(given);
  EXPECT_EQ(given->name, "arm");
  EXPECT_EQ(given->token.size(), 1u);
  EXPECT_FALSE(record.take_new_name());
}

TEST(NodeStatus, KnowsTheNamesOfOwnServices) {
  NodeStatus record;
  EXPECT_FALSE(record.is_own_service("/pose"));
  record.connected(session_of("hall/robot"), true);
  EXPECT_TRUE(record.is_own_service("hall/robot/pose"));
  EXPECT_FALSE(record.is_own_service("hall/robot"));
  EXPECT_FALSE(record.is_own_service("hall/robots/pose"));
}

TEST(NodeStatus, EndsForGood) {
  NodeStatus record;
  record.connected(session_of("robot"), true);
  record.ended(true);
  EXPECT_EQ(record.info().ended, 1u);
  EXPECT_EQ(record.info().replaced, 1u);
  EXPECT_EQ(record.info().token_kept, 0u);
}

}  // namespace
}  // namespace gimnet::nif
