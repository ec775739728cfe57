#include <gtest/gtest.h>

#include <atomic>
#include <cstdint>
#include <cstring>
#include <deque>
#include <string>
#include <thread>
#include <vector>

#include "tests/stress/support/hub_process.hpp"
#include "tests/stress/support/nif_node.hpp"
#include "tests/stress/support/raw_node.hpp"
#include "tests/stress/support/statistics.hpp"

// Senders that block: provable is that two who flood each other both get to their end, and that who
// waits for a slow peer is held up by nothing else.

namespace gimnet::stress {
namespace {

constexpr std::int32_t kPatienceMs = 60'000;
constexpr std::size_t kPayloadBytes = 4'096;
constexpr std::uint64_t kSteered = 1'000;

std::uint64_t flood_count() { return is_full_size() ? 500'000 : 50'000; }

nif_options at_shard(std::uint8_t shard) {
  nif_options options{};
  options.shard_plus_one = static_cast<std::uint8_t>(shard + 1);
  return options;
}

std::vector<std::string> two_shards() { return {"--shards", "2", "--placement", "hint"}; }

/// The threads of a program that sends and receives: one takes turns, and receives everything that
/// is there before the next message; of two, one sends and waits in nif_send(), and one receives.
enum class Threads { one, two };

struct Flooder {
  std::uint64_t sent = 0;
  std::uint64_t received = 0;
  bool is_in_order = true;
  std::string error;

  void take(const nif_incoming& in) {
    if (in.type != NIF_MESSAGE) {
      error = in.text;
      return;
    }
    std::uint64_t number = 0;
    std::memcpy(&number, in.payload, sizeof number);
    is_in_order = is_in_order && number == ++received;
  }

  [[nodiscard]] bool send_next(const NifNode& node, std::uint32_t peer) {
    char payload[kPayloadBytes] = {};
    const std::uint64_t number = sent + 1;
    std::memcpy(payload, &number, sizeof number);
    if (nif_send_to(node.get(), peer, payload, sizeof payload) != NIF_OK) {
      error = nif_error_text();
      return false;
    }
    ++sent;
    return true;
  }

  void run_apart(const NifNode& node, std::uint32_t peer) {
    std::thread sending([&] {
      while (sent < flood_count() && send_next(node, peer)) {
      }
    });
    Incoming in;
    nif_status status = NIF_OK;
    while (received < flood_count() && (status = in.receive(node, kPatienceMs)) == NIF_OK)
      take(*in.operator->());
    sending.join();
    if (status != NIF_OK) error = nif_status_text(status);
  }

  void run_in_turns(const NifNode& node, std::uint32_t peer) {
    Incoming in;
    while (error.empty() && (sent < flood_count() || received < flood_count())) {
      if (sent < flood_count() && !send_next(node, peer)) return;
      const std::int32_t patience = sent < flood_count() ? 0 : kPatienceMs;
      nif_status status = NIF_OK;
      while (received < flood_count() && (status = in.receive(node, patience)) == NIF_OK)
        take(*in.operator->());
      if (status != NIF_OK && status != NIF_TIMEOUT) error = nif_status_text(status);
      if (patience != 0 && status == NIF_TIMEOUT) error = "waited in vain";
    }
  }
};

void expect_both_end(const HubProcess& hub, std::uint8_t second_shard, Threads threads) {
  const NifNode one(hub.tcp_url(), "one", at_shard(0));
  const NifNode two(hub.tcp_url(), "two", at_shard(second_shard));
  Flooder at_one;
  Flooder at_two;
  const auto run = threads == Threads::one ? &Flooder::run_in_turns : &Flooder::run_apart;
  std::thread running([&] { (at_two.*run)(two, one.id()); });
  (at_one.*run)(one, two.id());
  running.join();
  for (const Flooder* each : {&at_one, &at_two}) {
    EXPECT_EQ(each->error, "");
    EXPECT_EQ(each->sent, flood_count());
    EXPECT_EQ(each->received, flood_count());
    EXPECT_TRUE(each->is_in_order);
  }
}

void expect_exact(const HubProcess& hub, std::uint64_t frames) {
  RawNode observer(hub.unix_url());
  const Statistics end =
      wait_for(observer, [](const Statistics& now) { return now["queued"] == 0; }, "the end");
  EXPECT_EQ(end["accepted"], frames);
  EXPECT_EQ(end["delivered"], frames);
  EXPECT_EQ(end.dropped(), 0u) << end.text();
}

TEST(Flood, TwoWhoFloodEachOtherOnOneShardBothEnd) {
  const HubProcess hub(two_shards());
  expect_both_end(hub, 0, Threads::one);
  expect_exact(hub, 2 * flood_count());
}

TEST(Flood, TwoWhoFloodEachOtherAcrossShardsBothEnd) {
  const HubProcess hub(two_shards());
  expect_both_end(hub, 1, Threads::one);
  expect_exact(hub, 2 * flood_count());
}

TEST(Flood, TwoWhoSendAndReceiveAtOnceBothEnd) {
  for (const std::uint8_t second_shard : {std::uint8_t{0}, std::uint8_t{1}}) {
    const HubProcess hub(two_shards());
    expect_both_end(hub, second_shard, Threads::two);
    expect_exact(hub, 2 * flood_count());
  }
}

// Neither honours PAUSE: the hub stops reading them, which must not stop what comes back.
TEST(Flood, TwoWhoIgnorePauseBothEnd) {
  const HubProcess hub(two_shards());
  std::deque<RawNode> nodes;
  for (std::uint16_t shard = 0; shard < 2; ++shard) {
    JoinOptions options;
    options.hello.shard = shard;
    options.socket = {64 * 1'024, 64 * 1'024};
    nodes.emplace_back(hub.tcp_url(), options);
  }
  const std::vector<std::byte> payload(kPayloadBytes);
  const std::uint64_t count = flood_count() / 2;
  std::uint64_t sent[2] = {};
  std::uint64_t received[2] = {};
  const Deadline deadline;
  while (received[0] < count || received[1] < count) {
    deadline.check("frames of two who flood each other");
    for (std::size_t i = 0; i < 2; ++i) {
      RawNode& node = nodes[i];
      if (node.flush()) {
        for (int burst = 0; burst < 64 && sent[i] < count; ++burst, ++sent[i]) {
          node.put(parts_of(proto::Kind::unicast, nodes[1 - i].id().value(), proto::Policy::block),
                   payload);
        }
      }
      node.keep_alive();
      node.read_some();
      while (const auto frame = node.next())
        received[i] += frame->header.kind == proto::Kind::unicast ? 1 : 0;
    }
    if (nodes[0].unwritten() > 0 && nodes[1].unwritten() > 0) {
      wait_readable({nodes[0].descriptor(), nodes[1].descriptor()}, 1);
    }
  }
  expect_exact(hub, 2 * count);
}

// One thread waits in nif_send() for a peer that does not read; another steers a fast peer and gets
// its answers; the library keeps alive meanwhile, for longer than the silent time.
TEST(Flood, WhoWaitsForASlowPeerSteersAFastOne) {
  std::vector<std::string> arguments = two_shards();
  arguments.insert(arguments.end(), {"--limit", "keep_alive_ms=100", "--limit", "silent_ms=1000"});
  const HubProcess hub(arguments);
  const NifNode operator_node(hub.tcp_url(), "operator", at_shard(0));
  const NifNode robot(hub.tcp_url(), "robot", at_shard(1));
  JoinOptions slow_options;
  slow_options.socket.receive_buffer_bytes = 64 * 1'024;
  RawNode slow(hub.tcp_url(), slow_options);

  std::atomic<bool> is_over{false};
  std::atomic<std::uint64_t> sent_to_slow{0};
  std::thread waiting([&] {
    const std::vector<std::byte> bulk(kPayloadBytes);
    const nif_bytes part{bulk.data(), bulk.size()};
    nif_outgoing message = NIF_OUTGOING_INIT;
    message.to = slow.id().value();
    message.parts = &part;
    message.part_count = 1;
    while (!is_over.load()) {
      if (nif_send(operator_node.get(), &message, 100) == NIF_OK) sent_to_slow.fetch_add(1);
    }
  });
  std::thread answering([&] {
    Incoming in;
    while (!is_over.load()) {
      if (in.receive(robot, 100) != NIF_OK || in->type != NIF_MESSAGE) continue;
      static_cast<void>(nif_send_to(robot.get(), in->from, in->payload, in->size));
    }
  });

  const auto end = Clock::now() + std::chrono::seconds(2);
  std::uint64_t steered = 0;
  std::uint64_t steered_while_paused = 0;
  bool is_answered = true;
  Incoming in;
  const Deadline deadline;
  while (is_answered && (Clock::now() < end || steered_while_paused < kSteered)) {
    deadline.check("answers of the fast peer");
    slow.keep_alive();
    ++steered;
    const bool is_paused = operator_node.counters().pauses > 0;
    is_answered =
        nif_send_to(operator_node.get(), robot.id(), &steered, sizeof steered) == NIF_OK &&
        in.receive(operator_node, 10'000) == NIF_OK && in->type == NIF_MESSAGE &&
        std::memcmp(in->payload, &steered, sizeof steered) == 0;
    steered_while_paused += is_paused && is_answered ? 1 : 0;
  }
  is_over.store(true);
  waiting.join();
  answering.join();
  EXPECT_TRUE(is_answered) << "after " << steered << " rounds: " << in->text;
  EXPECT_GT(sent_to_slow.load(), 0u);
  nif_info info{};
  info.struct_size = sizeof info;
  ASSERT_EQ(nif_get_info(operator_node.get(), &info), NIF_OK);
  EXPECT_EQ(info.reconnects, 0u);
  EXPECT_EQ(info.connected, 1u);
}

/// Receives until a message comes that was sent to this node alone.
bool receive_unicast(Incoming& in, const NifNode& node) {
  while (in.receive(node, kPatienceMs) == NIF_OK) {
    if (in->type == NIF_MESSAGE && in->kind == NIF_UNICAST) return true;
  }
  return false;
}

/// Nobody wants it any more, but what a node does not take waits in the hub.
void take_the_rest(Incoming& in, const NifNode& node) {
  while (in.receive(node, 0) == NIF_OK) {
  }
}

void broadcast_until(const std::atomic<bool>& is_over, std::atomic<std::uint64_t>& broadcasts,
                     RawNode storm) {
  constexpr int kBurst = 64;
  const std::vector<std::byte> payload(1'000);
  while (!is_over.load()) {
    if (storm.flush()) {
      for (int i = 0; i < kBurst; ++i)
        storm.put(parts_of(proto::Kind::broadcast, 0xFFFFFFFF), payload);
      broadcasts.fetch_add(kBurst);
    } else {
      wait_readable({storm.descriptor()}, 1);
    }
    storm.keep_alive();
    storm.read_some();
    while (storm.next()) {
    }
  }
  storm.flush_all();
}

// One node broadcasts as fast as it can, and one of those who get it takes nothing: two others
// steer each other all the while, since what they send waits for nobody and is dropped for nobody's
// sake.
TEST(Flood, ABroadcastStormHindersNobody) {
  const HubProcess hub(two_shards());
  const NifNode operator_node(hub.tcp_url(), "operator", at_shard(0));
  const NifNode robot(hub.tcp_url(), "robot", at_shard(1));
  RawNode deaf(hub.tcp_url());
  std::atomic<bool> is_over{false};
  std::atomic<std::uint64_t> broadcasts{0};
  std::thread storming([&] { broadcast_until(is_over, broadcasts, RawNode(hub.tcp_url())); });
  std::thread answering([&] {
    Incoming in;
    for (std::uint64_t answered = 0; answered != kSteered && receive_unicast(in, robot);) {
      std::memcpy(&answered, in->payload, sizeof answered);
      static_cast<void>(nif_send_to(robot.get(), in->from, in->payload, in->size));
    }
  });
  // The last one is asked when there were broadcasts enough.
  Incoming in;
  bool is_answered = true;
  for (std::uint64_t steered = 1; steered <= kSteered && is_answered; ++steered) {
    const Deadline deadline;
    do {
      deadline.check("a storm of broadcasts");
      deaf.keep_alive();
      std::this_thread::yield();
    } while (broadcasts.load() * kSteered < flood_count() * steered);
    is_answered =
        nif_send_to(operator_node.get(), robot.id(), &steered, sizeof steered) == NIF_OK &&
        receive_unicast(in, operator_node) &&
        std::memcmp(in->payload, &steered, sizeof steered) == 0;
  }
  EXPECT_TRUE(is_answered) << in->text;
  is_over.store(true);
  storming.join();
  if (!is_answered) {
    constexpr std::uint64_t last = kSteered;
    static_cast<void>(nif_send_to(operator_node.get(), robot.id(), &last, sizeof last));
  }
  answering.join();
  deaf = RawNode();
  RawNode observer(hub.unix_url());
  const auto is_empty = [&](const Statistics& now) {
    take_the_rest(in, operator_node);
    take_the_rest(in, robot);
    return now["queued"] == 0;
  };
  const Statistics end = wait_for(observer, is_empty, "the end");
  EXPECT_TRUE(end.is_balanced()) << end.text();
  EXPECT_GT(end["dropped.queue_full"], 0u) << "the deaf one's";
  EXPECT_EQ(end["dropped.timed_out"], 0u);
}

}  // namespace
}  // namespace gimnet::stress
