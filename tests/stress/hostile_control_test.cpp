#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <vector>

#include "proto/control/ns.hpp"
#include "tests/stress/support/hub_process.hpp"
#include "tests/stress/support/raw_node.hpp"
#include "tests/stress/support/statistics.hpp"

// Nodes that ask and do not take the answers: provable is that they are closed, and that the hub's
// memory is bounded.

namespace gimnet::stress {
namespace {

constexpr std::int64_t kMiB = 1 << 20;

void put_list(RawNode& node, std::uint16_t number) {
  node.put(parts_of(proto::Kind::ns, 0), proto::encode(proto::ns::List{}, number));
}

/// What the hub said before it ended the connection. What it answered before that is not looked at.
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

}  // namespace
}  // namespace gimnet::stress
