#include "hub/control/log_peer.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>

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

TEST(LogSeldom, WritesALineEach10SecondsAndCountsTheOthers) {
  using std::chrono::milliseconds;
  const auto lines = [](int count, const char* peer, milliseconds now) {
    testing::internal::CaptureStderr();
    for (int i = 0; i < count; ++i) log_seldom(LogLevel::error, {"seldom", peer}, "again", now);
    return testing::internal::GetCapturedStderr();
  };
  const auto count = [](const std::string& text) { return std::ranges::count(text, '\n'); };
  EXPECT_EQ(count(lines(20, "10.0.0.1", milliseconds{1'000})), 1);
  EXPECT_EQ(count(lines(1, "10.0.0.2", milliseconds{1'000})), 1);
  EXPECT_EQ(count(lines(9, "10.0.0.1", milliseconds{10'990})), 0);
  const std::string next = lines(1, "10.0.0.1", milliseconds{11'000});
  EXPECT_NE(next.find("again (28 lines like this were left out)"), std::string::npos) << next;
}

TEST(RemoteAddress, IsThatOfAnotherMachine) {
  EXPECT_EQ(remote_address("tcp", "10.0.0.1:5000"), "10.0.0.1");
  EXPECT_EQ(remote_address("tcp", "12.7.0.1:5000"), "12.7.0.1");
  EXPECT_EQ(remote_address("tcp", "[::ffff:10.0.0.1]:5000"), "10.0.0.1") << "the same as by IPv4";
  EXPECT_EQ(remote_address("tcp", "unknown"), "unknown");
  EXPECT_EQ(remote_address("tcp", "[unknown]:5000"), "[unknown]");
}

// One host has as many addresses of its network as it likes.
TEST(RemoteAddress, IsTheNetworkOfAnIpv6Host) {
  for (const char* host :
       {"[2001:db8:0:7::1]:5000", "[2001:db8:0:7:ffff::2]:5000", "[2001:db8::7:9:8:7:6]:5000"}) {
    EXPECT_EQ(remote_address("tcp", host), "2001:db8:0:7::/64") << host;
  }
  EXPECT_EQ(remote_address("tcp", "[2001:db8:0:8::1]:5000"), "2001:db8:0:8::/64");
  EXPECT_EQ(remote_address("tcp", "[fe80::1%eth0]:5000"), "[fe80::1%eth0]") << "neighbours";
  EXPECT_EQ(remote_address("tcp", "[::12]:5000"), "::/64");
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
  EXPECT_EQ(crowd_of(Identity::open(), "[2001:db8::1]:5000"), "2001:db8::/64");
  EXPECT_EQ(crowd_of(Identity::of_user(1000), "pid 77 uid 1000"), "uid 1000");
  EXPECT_EQ(crowd_of(Identity{}, "unknown"), "unknown");
}

}  // namespace
}  // namespace gimnet::hub
