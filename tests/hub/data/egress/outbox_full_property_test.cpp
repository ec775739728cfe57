// Random messages to a full outbox, from a seed: what a run does to it at once is what its frames
// do one by one. Once against the rule of docs/protocol.md, section 5, written down frame by frame;
// and once, with everything else that happens to an outbox between them, against an outbox that
// gets each frame alone.

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "hub/data/egress/outbox.hpp"
#include "hub/observe/session_gauges.hpp"
#include "proto/frame/extensions.hpp"
#include "proto/frame/frame_parser.hpp"
#include "tests/hub/data/support/egress_rig.hpp"
#include "tests/hub/data/support/lane_rule.hpp"

namespace gimnet::hub {
namespace {

using proto::DropReason;
using proto::Kind;
using testing::EgressRig;
using testing::LaneRule;
using testing::TestConnection;
using testing::TestFrame;

constexpr std::uint32_t kSeeds = 400;
constexpr int kOperations = 120;
constexpr std::uint8_t kBlock = 1;
constexpr std::uint8_t kDrop = 2;
constexpr std::uint8_t kLatest = 3 | proto::kFlagKeyed;
constexpr std::uint32_t kLaneBytes = 1'000;
constexpr std::uint8_t kLane = 1;

Limits limits() {
  Limits small;
  small.lane0_bytes = small.lane1_bytes = small.lane2_bytes = small.lane3_bytes = kLaneBytes;
  return small;
}

/// Frames with one header; every payload is another one, as far as its length allows.
struct Burst {
  TestFrame frame;
  std::vector<std::string> payloads;
};

class Dice {
 public:
  explicit Dice(std::uint32_t seed) : random_(seed), sources(1 + below(4)) {}
  std::uint32_t below(std::uint32_t n) { return static_cast<std::uint32_t>(random_() % n); }

  std::string payload(std::size_t size) {
    std::string text = std::to_string(++made_);
    text.resize(size, '.');
    return text;
  }
  /// A run as a read may find it, with that policy.
  Burst burst(Kind kind, std::uint8_t policy) {
    Burst burst{{.kind = kind, .flags = policy, .lane = kLane, .src = 1 + below(sources)}, {}};
    if (below(2) == 0) burst.frame.flags |= proto::kFlagReport;
    const std::uint32_t base = below(8) == 0 ? below(1'500) : below(60);
    const std::uint32_t spread = below(2) == 0 ? 1 : 1 + below(below(4) == 0 ? 1'200 : 40);
    const std::uint32_t frames = 1 + below(base > 100 ? 4 : 50);
    for (std::uint32_t i = 0; i < frames; ++i)
      burst.payloads.push_back(payload(base + below(spread)));
    return burst;
  }

 private:
  std::mt19937 random_;
  std::uint32_t made_ = 0;

 public:
  const std::uint32_t sources;
};

/// Counts what is lost of the one group there is.
struct Counted final : CountedGroups {
  [[nodiscard]] bool counts(GroupId) const override { return false; }
  void on_lost(GroupId, std::uint32_t messages) override { lost += messages; }
  std::uint64_t lost = 0;
};

/// A full outbox with all that can be seen of it.
struct Side {
  Side() : rig(limits()), connection(rig) {
    connection.outbox.set_counters(counters);
    connection.outbox.set_counted_groups(&counted);
  }
  void push(const hub::Run& run, bool fan_out, std::uint32_t shortest_bytes) {
    connection.outbox.push(run, run.header(), {fan_out, shortest_bytes}, rig.context);
  }
  /// shortest: is it known how long the shortest frame is?
  void push_whole(const Burst& burst, bool fan_out, bool shortest) {
    const hub::Run run = rig.run(burst.payloads, burst.frame);
    const auto found = proto::next_run(run.bytes, run.bytes + run.size, proto::kFrameLengthDefault);
    push(run, fan_out, shortest ? found.shortest_bytes : proto::kHeaderSize);
  }
  void push_singly(const Burst& burst, bool fan_out) {
    hub::Run rest = rig.run(burst.payloads, burst.frame);
    while (rest.frames != 0) {
      const hub::Run frame = rest.take_frame();
      push(frame, fan_out, proto::kHeaderSize);
    }
  }
  /// The peer takes so much more.
  void drain(std::size_t bytes) {
    connection.peer.set_room(connection.peer.readable() + bytes);
    connection.flush();
    connection.peer.read(received);
  }
  std::string seen() {
    LaneQueue& lane = connection.outbox.lane(kLane);
    std::string all =
        "queued " + std::to_string(rig.tally.queued) + " bytes " + std::to_string(lane.bytes()) +
        " block " + std::to_string(lane.block_bytes()) + " whole " +
        std::to_string(lane.holds_whole()) + " lost " + std::to_string(counted.lost) + " dropped " +
        std::to_string(counters.dropped.value()) + " received " + std::to_string(received.size());
    for (const std::uint64_t dropped : rig.tally.dropped) all += " " + std::to_string(dropped);
    for (const std::string& said : rig.signals.take()) all += " " + said;
    return all;
  }
  std::string reports() {
    std::string all;
    rig.drops.flush(now_ms += 10'000, [&](NodeId sender, std::span<const std::byte> report) {
      all += std::to_string(sender.value()) + ":" +
             std::string(reinterpret_cast<const char*>(report.data()), report.size()) + "\n";
    });
    return all;
  }

  EgressRig rig;
  SessionCounters counters;
  Counted counted;
  TestConnection connection;
  std::vector<std::byte> received;
  std::uint64_t now_ms = 0;
};

// ---- against the rule, frame by frame
// --------------------------------------------------------------------------

void run_against_the_rule(std::uint32_t seed) {
  Dice dice(seed);
  Side side;
  LaneRule::UnderWay under_way;
  if (dice.below(2) == 0) {
    // Of a message the first fragment is begun, and the second one is under way with it.
    const std::string rest(1 + dice.below(dice.below(2) == 0 ? 100 : 1'500), 'r');
    under_way.block = dice.below(2) == 0;
    const TestFrame frame{.kind = under_way.block ? Kind::unicast : Kind::group, .lane = kLane};
    side.rig.push_fragment(side.connection.outbox, 1, 0, 100'000, "begin", frame);
    side.rig.push_fragment(side.connection.outbox, 1, 5, 100'000, rest, frame);
    under_way.size =
        proto::kHeaderSize + proto::kFragmentHeaderSize + static_cast<std::uint32_t>(rest.size());
  } else {
    side.rig.push(side.connection.outbox, "begun", {.lane = kLane});
  }
  side.drain(1);
  LaneRule rule(kLaneBytes, under_way);
  for (int i = 0; i < 20; ++i) {
    const std::uint8_t policy = dice.below(8) == 0   ? kBlock
                                : dice.below(3) == 0 ? kDrop
                                                     : std::uint8_t{0};
    const Burst burst = dice.burst(Kind::group, policy);
    for (const std::string& payload : burst.payloads) {
      rule.come({NodeId{7u << 20 | burst.frame.src},
                 static_cast<std::uint32_t>(proto::kHeaderSize + payload.size()), policy == kBlock,
                 policy == kDrop, payload});
    }
    side.push_whole(burst, dice.below(2) == 0, dice.below(4) != 0);
    ASSERT_EQ(side.rig.dropped(DropReason::queue_full), rule.dropped)
        << "seed " << seed << ", operation " << i;
    ASSERT_EQ(side.counted.lost, rule.dropped);
  }
  side.connection.peer.set_room(MemoryPeer::kAll);
  while (side.connection.flush() != Flush::emptied) continue;
  side.connection.stream = std::move(side.received);
  std::vector<std::string> came = side.connection.take();
  came.erase(came.begin(), came.begin() + (under_way.size == 0 ? 1 : 2));
  EXPECT_EQ(came, rule.left()) << "seed " << seed;
  EXPECT_TRUE(side.rig.ledger_exact());
}

TEST(FullOutboxProperty, ARunFollowsTheRuleFrameByFrame) {
  for (std::uint32_t seed = 1; seed <= kSeeds && !::testing::Test::HasFailure(); ++seed)
    run_against_the_rule(seed);
}

// ---- against an outbox that gets each frame alone
// ---------------------------------------------------------------

class Pair {
 public:
  explicit Pair(std::uint32_t seed) : dice_(seed) {
    both([](Side& side) { side.drain(0); });
  }

  void step() {
    switch (dice_.below(14)) {
      case 0:
        return drain(dice_.below(kLaneBytes));
      case 1:
        return drain(dice_.below(proto::kHeaderSize));
      case 2:
        return latest();
      case 3:
      case 4:
        return fragment();
      case 5:
        return aged();
      case 6:
        return toggle_budget();
      case 7:
        return time_out();
      default:
        return burst();
    }
  }
  void check(const std::string& where) {
    const std::string expected = singly_.seen();
    ASSERT_EQ(whole_.seen(), expected) << where;
    if (dice_.below(8) != 0) return;
    const std::string reports = singly_.reports();
    ASSERT_EQ(whole_.reports(), reports) << where;
  }
  void end() {
    both([](Side& side) {
      side.connection.peer.set_room(MemoryPeer::kAll);
      while (side.connection.flush() != Flush::emptied) continue;
      side.connection.peer.read(side.received);
    });
    check("at the end");
    EXPECT_EQ(whole_.received, singly_.received);
    EXPECT_TRUE(whole_.rig.ledger_exact());
    EXPECT_TRUE(singly_.rig.ledger_exact());
  }

 private:
  template <class Do>
  void both(Do&& what) {
    what(whole_);
    what(singly_);
  }
  void drain(std::size_t bytes) {
    // Where nothing waits, a run that does not fit is refused as one thing.
    if (used_up_) return;
    both([&](Side& side) { side.drain(bytes); });
  }
  void burst() {
    const Kind kind = dice_.below(3) == 0 ? Kind::unicast : Kind::group;
    const std::uint8_t policies[] = {0, 0, kDrop, kDrop, kBlock};
    const Burst burst = dice_.burst(kind, policies[dice_.below(5)]);
    const bool fan_out = dice_.below(2) == 0;
    whole_.push_whole(burst, fan_out, dice_.below(4) != 0);
    // BLOCK counts what is under way by runs, and is not taken apart.
    proto::FrameHeader header;
    header.kind = kind;
    header.flags = burst.frame.flags;
    if (proto::is_block(header)) return singly_.push_whole(burst, fan_out, true);
    singly_.push_singly(burst, fan_out);
  }
  void latest() {
    const std::string payload =
        "key____" + std::to_string(dice_.below(3)) + dice_.payload(dice_.below(300));
    both([&](Side& side) {
      side.rig.push(side.connection.outbox, payload,
                    {.kind = Kind::group, .flags = kLatest, .lane = kLane});
    });
  }
  /// Messages in three parts, of which now and then a part is missing.
  void fragment() {
    if (dice_.below(12) == 0) ++message_;
    const std::uint32_t part = part_++ % 3;
    const std::string payload(100, static_cast<char>('a' + part));
    both([&](Side& side) {
      side.rig.push_fragment(side.connection.outbox, message_, 100 * part, 300, payload,
                             {.kind = Kind::group,
                              .flags = message_ % 2 == 0 ? kDrop : std::uint8_t{0},
                              .lane = kLane});
    });
    if (part == 2) ++message_;
  }
  /// Not worth writing after a while.
  void aged() {
    std::byte memory[64];
    proto::ExtensionWriter writer(memory);
    ASSERT_TRUE(writer.add_age({whole_.rig.context.now_wall_ns, 1 + dice_.below(100)}));
    std::string payload(2, '\0');
    payload[0] = static_cast<char>(writer.written().size());
    payload.append(reinterpret_cast<const char*>(writer.written().data()), writer.written().size());
    payload += dice_.payload(dice_.below(50));
    both([&](Side& side) {
      side.rig.push(side.connection.outbox, payload,
                    {.kind = Kind::group, .flags = proto::kFlagExt, .lane = kLane});
      side.rig.context.now_wall_ns += 10'000'000;
    });
  }
  /// Of what comes while the budget is used up nothing is taken where something waits.
  void toggle_budget() {
    constexpr std::uint64_t kMuch = std::uint64_t{1} << 40;
    if (used_up_) {
      both([](Side& side) { side.rig.lease.give_back(kMuch); });
      used_up_ = false;
    } else if (dice_.below(3) == 0) {
      drain(0);  // which drops what is too old
      if (whole_.connection.outbox.empty()) return;
      both([](Side& side) { side.rig.lease.take(kMuch); });
      used_up_ = true;
    }
  }
  void time_out() {
    if (dice_.below(4) != 0) return;
    both([](Side& side) { side.connection.outbox.time_out_block(side.rig.context); });
  }

  Dice dice_;
  Side whole_;
  Side singly_;
  std::uint32_t message_ = 1;
  std::uint32_t part_ = 0;
  bool used_up_ = false;
};

TEST(FullOutboxProperty, ARunIsTakenAsItsFramesAre) {
  for (std::uint32_t seed = 1; seed <= kSeeds && !::testing::Test::HasFailure(); ++seed) {
    Pair pair(seed);
    for (int i = 0; i < kOperations && !::testing::Test::HasFailure(); ++i) {
      pair.step();
      pair.check("seed " + std::to_string(seed) + ", operation " + std::to_string(i));
    }
    pair.end();
  }
}

}  // namespace
}  // namespace gimnet::hub
