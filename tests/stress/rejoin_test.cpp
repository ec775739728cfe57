#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <set>
#include <string>
#include <vector>

#include "tests/stress/support/hub_process.hpp"
#include "tests/stress/support/raw_node.hpp"
#include "tests/stress/support/size.hpp"
#include "tests/stress/support/statistics.hpp"

// A hub that is killed with everybody on it: provable is that each gets its own id and name back,
// and nobody else's.

namespace gimnet::stress {
namespace {

/// As many strangers at a time as a hub hears of at once.
constexpr std::size_t kAtOnce = 256;

/// A node as it knows itself, and its connection.
struct Member {
  std::string name;
  NodeId id;
  std::vector<std::byte> token;
  Descriptor connection;
};

/// Joins all of them, each with the token that it has, and notes what the hub said.
void join(const HubProcess& hub, std::vector<Member>& members) {
  const Deadline deadline;
  for (std::size_t begin = 0; begin < members.size(); begin += kAtOnce) {
    const std::size_t end = std::min(members.size(), begin + kAtOnce);
    std::vector<RawNode> nodes(end - begin);
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      JoinOptions options;
      options.hello.name = members[begin + i].name;
      options.hello.token = members[begin + i].token;
      nodes[i].begin_join(hub.tcp_url(), options);
    }
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      while (!nodes[i].finish_join()) {
        deadline.check("WELCOME");
        wait_readable({nodes[i].descriptor()}, 100);
      }
      Member& member = members[begin + i];
      EXPECT_EQ(nodes[i].welcome().name, member.name);
      member.id = nodes[i].id();
      member.token = nodes[i].welcome().token;
      member.connection = nodes[i].release();
    }
  }
}

TEST(Rejoin, EverybodyHasIdAndNameAgainAfterTheHubWasKilled) {
  const std::size_t count = is_full_size() ? 10'000 : 1'000;
  if (raise_descriptor_limit() < count + 100)
    GTEST_SKIP() << "the hub may hold too few descriptors here";
  // Nobody keeps alive here: silence is not what is looked at.
  HubProcess hub(
      {"--shards", "2", "--limit", "keep_alive_ms=600000", "--limit", "silent_ms=3000000"});
  std::vector<Member> members(count);
  for (std::size_t i = 0; i < count; ++i) members[i].name = "node/" + std::to_string(i);
  join(hub, members);
  std::vector<NodeId> ids;
  for (Member& member : members) {
    ids.push_back(member.id);
    member.connection.reset();
  }
  ASSERT_EQ(std::set<NodeId>(ids.begin(), ids.end()).size(), count);

  const Clock::time_point killed = Clock::now();
  hub.kill_and_restart();
  RawNode newcomer(hub.tcp_url());
  join(hub, members);
  const double seconds = std::chrono::duration<double>(Clock::now() - killed).count();
  std::size_t same = 0;
  for (std::size_t i = 0; i < count; ++i) same += members[i].id == ids[i] ? 1 : 0;
  EXPECT_EQ(same, count);
  EXPECT_EQ(std::count(ids.begin(), ids.end(), newcomer.id()), 0);
  const Statistics end = Statistics::of(newcomer);
  EXPECT_EQ(end["sessions"], count + 1);
  EXPECT_EQ(end["accepted"] + end["delivered"] + end.dropped(), 0u) << "nobody sent anything";
  std::printf("%zu nodes were back %.2f s after kill -9\n", count, seconds);
  ::testing::Test::RecordProperty("seconds", std::to_string(seconds));
}

}  // namespace
}  // namespace gimnet::stress
