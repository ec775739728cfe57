#include <gtest/gtest.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <deque>
#include <functional>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "tests/stress/support/hub_process.hpp"
#include "tests/stress/support/raw_node.hpp"
#include "tests/stress/support/statistics.hpp"

// Strangers and nodes that mean no good, in numbers: provable is that good nodes join and talk all
// the while, and that the hub's memory is bounded by its limits and given back.

namespace gimnet::stress {
namespace {

constexpr std::int64_t kMiB = 1 << 20;

std::size_t stranger_count() {
  return std::min<std::size_t>(10'000, raise_descriptor_limit() - 200);
}

void write(const Descriptor& socket, std::span<const std::byte> bytes) {
  // Bytes that a closed connection does not take any more are as good as written.
  static_cast<void>(::send(socket.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL));
}

/// True when the hub has ended the connection; what it said is thrown away.
bool is_ended(const Descriptor& socket) {
  std::array<std::byte, 4'096> bytes;
  for (;;) {
    const ssize_t size = ::recv(socket.get(), bytes.data(), bytes.size(), MSG_DONTWAIT);
    if (size == 0 || (size < 0 && errno != EAGAIN && errno != EINTR)) return true;
    if (size < 0) return false;
  }
}

void wait_all_ended(const std::vector<Descriptor>& sockets) {
  const Deadline deadline;
  for (const Descriptor& socket : sockets) {
    while (!is_ended(socket)) {
      deadline.check("the end of a hostile connection");
      wait_readable({socket.get()}, 100);
    }
  }
}

/// Two nodes join now and one message goes from one to the other.
void expect_good_nodes_are_served(const HubProcess& hub) {
  RawNode from(hub.tcp_url());
  RawNode to(hub.tcp_url());
  const std::uint64_t word = 0x0123456789ABCDEF;
  from.put(parts_of(proto::Kind::unicast, to.id().value()), std::as_bytes(std::span(&word, 1)));
  from.flush_all();
  const Frame frame = to.wait_next();
  ASSERT_EQ(frame.body().size(), sizeof word);
  EXPECT_EQ(std::memcmp(frame.body().data(), &word, sizeof word), 0);
  from.leave();
  to.leave();
}

TEST(Strangers, AGoodNodeJoinsBesideTenThousandSilentOnes) {
  const HubProcess hub({"--shards", "2"});
  const std::int64_t before = hub.resident_bytes();
  std::vector<Descriptor> silent;
  std::int64_t highest = 0;
  while (silent.size() < stranger_count()) {
    silent.push_back(dial(hub.tcp_url()));
    if (silent.size() % 1'000 != 0) continue;
    expect_good_nodes_are_served(hub);
    highest = std::max(highest, hub.resident_bytes());
  }
  // 4,096 of them at a time may wait for their HELLO, each with a kibibyte of it at most.
  EXPECT_LE(highest - before, 24 * kMiB);
  wait_all_ended(silent);
  expect_good_nodes_are_served(hub);
  RawNode observer(hub.unix_url());
  EXPECT_EQ(Statistics::of(observer).told("refused.hello_timeout"), silent.size());
}

TEST(Strangers, GarbageIsEndedAndCostsNothing) {
  const HubProcess hub({"--shards", "2"});
  std::mt19937_64 random(5);
  std::uint64_t sent = 0;
  const std::int64_t before = hub.resident_bytes();
  for (int round = 0; round < (is_full_size() ? 20 : 4); ++round) {
    std::vector<Descriptor> strangers;
    for (int i = 0; i < 500; ++i) {
      strangers.push_back(dial(hub.tcp_url()));
      std::vector<std::byte> bytes(1 + random() % 4'000);
      for (std::byte& byte : bytes) byte = static_cast<std::byte>(random());
      // Every second one begins well.
      if (i % 2 == 0) std::copy(proto::kOpening.begin(), proto::kOpening.end(), bytes.begin());
      if (bytes.size() >= proto::kOpeningSize) {
        write(strangers.back(), bytes);
        ++sent;
      }
      ::shutdown(strangers.back().get(), SHUT_WR);
    }
    expect_good_nodes_are_served(hub);
    wait_all_ended(strangers);
  }
  EXPECT_LE(hub.resident_bytes() - before, 8 * kMiB);
  RawNode observer(hub.unix_url());
  const Statistics end = Statistics::of(observer);
  EXPECT_EQ(
      end.told("refused.garbage") + end.told("refused.malformed") + end.told("refused.unfinished"),
      sent);
}

TEST(Strangers, AHelloThatNeverEndsIsEnded) {
  const HubProcess hub({"--shards", "2", "--limit", "handshake_ms=1000"});
  std::vector<Descriptor> slow;
  for (int i = 0; i < 200; ++i) {
    slow.push_back(dial(hub.tcp_url()));
    write(slow.back(), proto::kOpening);
  }
  // One byte now and then does not help: the time counts from the beginning.
  proto::FrameHeader header;
  header.length = 900;
  header.kind = proto::Kind::link;
  std::array<std::byte, proto::kHeaderSize> bytes;
  proto::store_header(bytes.data(), header);
  const Deadline deadline;
  for (std::size_t at = 0; !std::all_of(slow.begin(), slow.end(), is_ended); ++at) {
    deadline.check("the end of slow HELLOs");
    for (const Descriptor& socket : slow) {
      if (at < bytes.size()) write(socket, std::span(bytes).subspan(at, 1));
    }
    wait_readable({}, 50);
  }
  expect_good_nodes_are_served(hub);
  RawNode observer(hub.unix_url());
  EXPECT_EQ(Statistics::of(observer).told("refused.hello_timeout"), slow.size());
}

// Each keeps 64 KiB of a frame in the hub that it never ends, all together more than the hub
// allows.
TEST(BegunFrames, AreBoundedTogetherAndEndInTime) {
  constexpr std::size_t kNodes = 1'000;
  constexpr std::int64_t kPartial = 16 * kMiB;
  const HubProcess hub({"--shards", "2", "--limit", "partial_bytes=16M", "--limit",
                        "stalled_frame_ms=1500", "--limit", "silent_ms=60000"});
  std::deque<RawNode> nodes;
  for (std::size_t i = 0; i < kNodes; ++i) nodes.emplace_back(hub.tcp_url());
  RawNode observer(hub.tcp_url());
  const std::int64_t before = hub.resident_bytes();
  std::int64_t highest = 0;
  std::vector<std::byte> begun(65'000);
  for (RawNode& node : nodes) {
    proto::FrameHeader header;
    header.length = 65'536;
    header.dst = node.id().value();
    header.src = node.id().value();
    proto::store_header(begun.data(), header);
    node.put_bytes(begun);
    node.flush();
    highest = std::max(highest, hub.resident_bytes());
  }
  expect_good_nodes_are_served(hub);
  const Deadline deadline;
  for (RawNode& node : nodes) {
    while (!node.is_closed()) {
      deadline.check("the end of who never ends a frame");
      highest = std::max(highest, hub.resident_bytes());
      node.flush();
      if (!node.read_some()) wait_readable({node.descriptor()}, 20);
      while (node.next()) {
      }
    }
  }
  // Memory that the readers use for themselves comes on top of what is kept.
  EXPECT_LE(highest - before, kPartial + 12 * kMiB);
  const Statistics end = Statistics::of(observer);
  EXPECT_GT(end["stalled_frames"], 0u) << end.text();
  EXPECT_EQ(end["accepted"], 1u) << "of the good nodes";
  EXPECT_TRUE(end.is_balanced());
  expect_good_nodes_are_served(hub);
}

// Beginnings of messages that never end, pieces of one byte between those of others, for a node
// that does not read.
TEST(Fragments, ThatNeverEndAreBoundedByTheBudget) {
  constexpr std::int64_t kBudget = 16 * kMiB;
  const HubProcess hub({"--shards", "2", "--limit", "budget_bytes=16M", "--limit",
                        "lane1_bytes=64M", "--limit", "silent_ms=600000", "--limit",
                        "slow_consumer_ms=600000"});
  RawNode liar(hub.unix_url());
  RawNode stopped(hub.unix_url());
  RawNode observer(hub.unix_url());
  const std::int64_t before = hub.resident_bytes();
  std::int64_t highest = before;
  constexpr std::uint32_t kTotal = 0xFFFFFFFF;
  constexpr std::uint32_t kPieces = 100;
  constexpr std::uint32_t kMessages = 200'000;  // several times what the budget has room for
  std::uint64_t sent = 0;
  for (std::uint32_t piece = 0; piece < kPieces; ++piece) {
    for (std::uint32_t message = piece * kMessages / kPieces;
         message < (piece + 1) * kMessages / kPieces; ++message) {
      for (const std::uint32_t offset : {0u, 1u, 2u}) {
        for (const std::uint32_t back : {0u, 50u}) {
          proto::FrameParts parts =
              parts_of(proto::Kind::unicast, stopped.id().value(), proto::Policy::drop);
          parts.fragment = proto::FragmentHeader{message - std::min(back, message), offset, kTotal};
          liar.put(parts, std::vector<std::byte>(1));
          ++sent;
        }
      }
    }
    liar.flush_all();
    highest = std::max(highest, hub.resident_bytes());
  }
  // Buffers that two shards keep for reading, and memory that one long queue outgrew, come on top.
  EXPECT_LE(highest - before, kBudget + kBudget / 10 + 24 * kMiB);
  expect_good_nodes_are_served(hub);
  const Statistics now = wait_for(
      observer, [&](const Statistics& each) { return each["accepted"] == sent + 1; },
      "all that the liar sent");
  EXPECT_GT(now["queued"], 0u);
  EXPECT_GT(now["dropped.over_budget"], 0u) << "the test is too small";
  EXPECT_TRUE(now.is_balanced()) << now.text();
}

/// Bytes that are wrong after WELCOME, and what they count as.
struct Wrong {
  const char* what;
  const char* counter;
  std::function<void(RawNode&)> send;
};

void send_header(RawNode& node, proto::FrameHeader header) {
  header.src = header.src == 0 ? node.id().value() : header.src;
  std::array<std::byte, proto::kHeaderSize + 4> bytes{};
  proto::store_header(bytes.data(), header);
  node.put_bytes(bytes);
}

std::vector<Wrong> wrongs() {
  using proto::FrameHeader;
  using proto::Kind;
  return {
      {"a length of 2^32-1", "malformed",
       [](RawNode& n) { send_header(n, {.length = 0xFFFFFFFF}); }},
      {"an unknown kind", "malformed",
       [](RawNode& n) { send_header(n, {.length = 4, .kind = Kind{77}}); }},
      {"reserved flags", "malformed",
       [](RawNode& n) { send_header(n, {.length = 4, .flags = 0x40}); }},
      {"a reserved lane", "malformed",
       [](RawNode& n) { send_header(n, {.length = 4, .lane = 9}); }},
      {"hops", "malformed", [](RawNode& n) { send_header(n, {.length = 4, .hops = 1}); }},
      {"1,025 ids", "malformed",
       [](RawNode& n) { send_header(n, {.length = 4, .dst = 1'025, .kind = Kind::list}); }},
      {"another source", "wrong_source",
       [](RawNode& n) { send_header(n, {.length = 4, .dst = 1, .src = 0x00700099}); }},
      {"an extension beyond its frame", "malformed",
       [](RawNode& n) {
         auto parts = parts_of(Kind::unicast, n.id().value());
         parts.header.flags = proto::kFlagExt;
         parts.header.src = n.id().value();
         parts.header.length = 4;
         std::array<std::byte, proto::kHeaderSize + 4> bytes{};
         proto::store_header(bytes.data(), parts.header);
         bytes[16] = std::byte{0xFF};
         n.put_bytes(bytes);
       }},
  };
}

TEST(WrongBytes, EndTheConnectionAndAreCounted) {
  const HubProcess hub({"--shards", "2"});
  for (const Wrong& wrong : wrongs()) {
    SCOPED_TRACE(wrong.what);
    RawNode observer(hub.unix_url());
    const std::uint64_t before = Statistics::of(observer)[wrong.counter];
    RawNode node(hub.tcp_url());
    wrong.send(node);
    node.flush();
    const Deadline deadline;
    while (!node.is_closed()) {
      deadline.check("GOODBYE");
      if (!node.read_some()) wait_readable({node.descriptor()}, 100);
      while (node.next()) {
      }
    }
    ASSERT_TRUE(node.goodbye());
    EXPECT_EQ(node.goodbye()->code, std::string(wrong.counter) == "malformed"
                                        ? proto::GoodbyeCode::malformed
                                        : proto::GoodbyeCode::wrong_source);
    EXPECT_FALSE(node.goodbye()->sentence.empty());
    const Statistics after = Statistics::of(observer);
    EXPECT_EQ(after[wrong.counter], before + 1);
    EXPECT_TRUE(after.is_balanced()) << after.text();
  }
  expect_good_nodes_are_served(hub);
}

}  // namespace
}  // namespace gimnet::stress
