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

TEST(RemoteAddress, IsThatOfAnotherMachine) {
  EXPECT_EQ(remote_address("tcp", "10.0.0.1:5000"), "10.0.0.1");
  EXPECT_EQ(remote_address("tcp", "12.7.0.1:5000"), "12.7.0.1");
  EXPECT_EQ(remote_address("tcp", "[fe80::1]:5000"), "[fe80::1]");
  EXPECT_EQ(remote_address("tcp", "[::ffff:10.0.0.1]:5000"), "[::ffff:10.0.0.1]");
  EXPECT_EQ(remote_address("tcp", "[::12]:5000"), "[::12]");
}

TEST(RemoteAddress, IsNoneForThisMachinesOwn) {
  for (const char* address :
       {"127.0.0.1:5000", "127.255.0.9:5000", "[::1]:5000", "[::ffff:127.0.0.1]:5000"}) {
    EXPECT_EQ(remote_address("tcp", address), "") << address;
  }
  EXPECT_EQ(remote_address("unix", "pid 77 uid 1000"), "");
}

TEST(CrowdOf, IsTheAddressOfAnotherMachineOrTheUser) {
  EXPECT_EQ(crowd_of(Identity::open(), "10.0.0.1:5000"), "10.0.0.1");
  EXPECT_EQ(crowd_of(Identity::open(), "127.0.0.1:5000"), "");
  EXPECT_EQ(crowd_of(Identity::of_user(1000), "pid 77 uid 1000"), "uid 1000");
  EXPECT_EQ(crowd_of(Identity{}, "unknown"), "unknown");
}

}  // namespace
}  // namespace gimnet::hub
