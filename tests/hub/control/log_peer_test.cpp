#include "hub/control/log_peer.hpp"

#include <gtest/gtest.h>

namespace gimnet::hub {
namespace {

TEST(LogPeer, IsTheSameForEveryConnectionOfAPeer) {
  EXPECT_EQ(log_peer("tcp", "10.0.0.1:5000"), "10.0.0.1");
  EXPECT_EQ(log_peer("tcp", "[fe80::1]:5000"), "[fe80::1]");
  EXPECT_EQ(log_peer("unix", "pid 77 uid 1000"), "uid 1000");
}

TEST(LogPeer, IsTheAddressWhereThereIsNothingToLeaveOut) {
  EXPECT_EQ(log_peer("tcp", "unknown"), "unknown");
  EXPECT_EQ(log_peer("unix", "unknown"), "unknown");
  EXPECT_EQ(log_peer("", ""), "");
}

}  // namespace
}  // namespace gimnet::hub
