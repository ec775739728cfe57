#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <string>
#include <vector>

#include "proto/control/ctrl.hpp"
#include "proto/control/ns.hpp"
#include "tests/stress/support/hub_process.hpp"
#include "tests/stress/support/raw_node.hpp"
#include "tests/stress/support/statistics.hpp"

// Nodes that ask much: provable is that those which do not take the answers are closed, that the
// hub's memory is bounded, and that another node's request waits for few of theirs.

namespace gimnet::stress {
namespace {

constexpr std::int64_t kMiB = 1 << 20;

void put_list(RawNode& node, std::uint16_t number) {
  node.put(parts_of(proto::Kind::ns, 0), proto::encode(proto::ns::List{}, number));
}

/// The last word of the hub before it ended the connection. Its answers before that are skipped.
proto::GoodbyeCode goodbye_of(RawNode& node) {
  const Deadline deadline;
  while (!node.is_closed()) {
    deadline.check("the end of the connection");
    if (!node.read_some()) wait_readable({node.descriptor()}, 100);
    while (node.next()) {
    }
  }
  return node.goodbye() ? node.goodbye()->code : proto::GoodbyeCode::done;
}

TEST(Requests, AMillionThatNobodyWaitsForAreCapped) {
  const HubProcess hub({"--shards", "2"});
  RawNode observer(hub.unix_url());
  RawNode flood(hub.tcp_url());
  const std::int64_t before = hub.resident_bytes();
  std::uint64_t sent = 0;
  while (sent < 1'000'000 && Statistics::of(observer)["too_many_requests"] == 0) {
    for (int i = 0; i < 10'000; ++i) put_list(flood, 1);
    sent += 10'000;
    flood.flush();
  }
  EXPECT_EQ(goodbye_of(flood), proto::GoodbyeCode::too_many_requests);
  const Statistics end = Statistics::of(observer);
  EXPECT_EQ(end["too_many_requests"], 1u);
  EXPECT_EQ(end["accepted"], 0u) << "requests are no part of the ledger";
  EXPECT_LE(hub.resident_bytes() - before, 8 * kMiB);
}

// One that never has more than one request unanswered, and reads nothing: its answers are what
// piles up.
TEST(Requests, AnswersThatAreNeverTakenAreCapped) {
  constexpr std::size_t kNodes = 100;
  const HubProcess hub({"--shards", "2", "--limit", "control_bytes=64k", "--limit",
                        "socket_send_bytes=16k", "--limit", "silent_ms=600000", "--limit",
                        "keep_alive_ms=300000"});
  std::vector<RawNode> nodes;
  for (std::size_t i = 0; i < kNodes; ++i) {
    JoinOptions options;
    options.hello.name = "node/" + std::to_string(i);
    options.hello.description = std::string(256, 'd');
    nodes.emplace_back(hub.unix_url(), options);
  }
  RawNode observer(hub.unix_url());
  RawNode asking(hub.unix_url());
  std::vector<RawNode> silent;
  silent.emplace_back(hub.unix_url());
  const std::int64_t before = hub.resident_bytes();
  const Deadline deadline;
  std::uint64_t asked = 0;
  while (Statistics::of(observer)["too_many_requests"] == 0) {
    deadline.check("the end of who takes no answers");
    put_list(silent[0], 1);
    silent[0].flush();
    ++asked;
    static_cast<void>(wait_for(
        observer,
        [&](const Statistics& now) {
          return now["too_many_requests"] != 0 || now["names.list"] >= asked;
        },
        "the hub's answer"));
  }
  EXPECT_GT(asked, 1u);
  EXPECT_LE(hub.resident_bytes() - before, 8 * kMiB);
  EXPECT_EQ(asking.ask<proto::ns::ListAnswer>(proto::Kind::ns, proto::ns::List{}).nodes.size(),
            kNodes + 2);
}

/// Reads what came for nodes that keep up.
void take_all(std::vector<RawNode>& nodes) {
  for (RawNode& node : nodes) {
    static_cast<void>(node.read_some());
    while (node.next()) {
    }
  }
}

// All requests are there before the hub looks at the first: it stands still while they are written.
TEST(Requests, OfBusyNodesDelayNobodyElses) {
  constexpr std::size_t kNodes = 300;  // more than an answer to LIST has
  constexpr std::size_t kBusy = 8;
  constexpr std::uint16_t kRequests = 60;
  constexpr int kRounds = 5;
  constexpr std::chrono::milliseconds kDelayMax{20};
  const HubProcess hub({"--shards", "1", "--limit", "control_bytes=16M"});
  std::vector<RawNode> nodes;
  for (std::size_t i = 0; i < kNodes; ++i) {
    JoinOptions options;
    options.hello.name = "node/" + std::to_string(i);
    nodes.emplace_back(hub.unix_url(), options);
  }
  std::vector<RawNode> busy;
  for (std::size_t i = 0; i < kBusy; ++i) busy.emplace_back(hub.unix_url());
  RawNode other(hub.unix_url());
  Clock::duration shortest = Clock::duration::max();
  for (int round = 0; round < kRounds; ++round) {
    const std::uint64_t lists = Statistics::of(other).told("names.list");
    EXPECT_EQ(lists, round * kBusy * kRequests);
    ::kill(hub.pid(), SIGSTOP);
    for (RawNode& node : busy) {
      for (std::uint16_t i = 1; i <= kRequests; ++i) put_list(node, i);
      node.flush_all();
    }
    other.put(parts_of(proto::Kind::ns, 0), proto::encode(proto::ns::Resolve{"node/7"}, 1'000));
    other.put(parts_of(proto::Kind::ctrl, 0), proto::encode(proto::ctrl::Statistics{}, 1'001));
    other.flush_all();
    const Clock::time_point begin = Clock::now();
    ::kill(hub.pid(), SIGCONT);
    const auto resolved = proto::decode_answer<proto::ns::ResolveAnswer>(other.wait_next().body());
    shortest = std::min(shortest, Clock::now() - begin);
    ASSERT_TRUE(resolved) << resolved.error().sentence;
    EXPECT_EQ(resolved->node, nodes[7].id());
    const auto counted =
        proto::decode_answer<proto::ctrl::StatisticsAnswer>(other.wait_next().body());
    ASSERT_TRUE(counted) << counted.error().sentence;
    EXPECT_LE(Statistics(*counted).told("names.list") - lists, kBusy * kRequests / 4)
        << "answered before the second answer of the node that asks little";
    static_cast<void>(wait_for(
        other,
        [&](const Statistics& now) {
          take_all(busy);
          return now.told("names.list") == lists + kBusy * kRequests;
        },
        "all answers"));
    take_all(nodes);
  }
  const double ms = std::chrono::duration<double, std::milli>(shortest).count();
  std::printf("an answer beside %zu LISTs took %.2f ms\n", kBusy * kRequests, ms);
  if (is_full_size()) {
    EXPECT_LE(shortest, kDelayMax);
  }
}

}  // namespace
}  // namespace gimnet::stress
