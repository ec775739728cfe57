// Random bursts to a full outbox, from a seed: once against the rule of docs/protocol.md, section
// 5, written down in lane_rule.hpp; and once, with everything else that happens to an outbox
// between them, for the counts and the limits.

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
  [[nodiscard]] std::uint32_t bytes() const {
    std::size_t sum = 0;
    for (const std::string& payload : payloads) sum += proto::kHeaderSize + payload.size();
    return static_cast<std::uint32_t>(sum);
  }
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
  /// A run as a read may find it, with that policy. Its destination is its own, so that it joins no
  /// other in the lane.
  Burst burst(Kind kind, std::uint8_t policy) {
    Burst burst{{.kind = kind, .flags = policy, .lane = kLane, .src = 1 + below(sources)}, {}};
    burst.frame.dst = 100 + made_;
    if (below(2) == 0) burst.frame.flags |= proto::kFlagReport;
    const std::uint32_t base = below(8) == 0 ? below(1'500) : below(60);
    const std::uint32_t spread = below(2) == 0 ? 1 : 1 + below(below(4) == 0 ? 1'200 : 40);
    const std::uint32_t frames = 1 + below(base > 100 ? 4 : 8);
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

/// Counts what is lost of groups.
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
  void push(const Burst& burst, bool fan_out) {
    const hub::Run run = rig.run(burst.payloads, burst.frame);
    connection.outbox.push(run, run.header(), {fan_out}, rig.context);
  }
  /// The peer takes so much more.
  void drain(std::size_t bytes) {
    connection.peer.set_room(connection.peer.readable() + bytes);
    connection.flush();
    connection.peer.read(received);
  }
  void drain_all() {
    connection.peer.set_room(MemoryPeer::kAll);
    while (connection.flush() != Flush::emptied) continue;
    connection.peer.read(received);
  }
  [[nodiscard]] std::uint64_t dropped() const {
    std::uint64_t all = 0;
    for (const std::uint64_t each : rig.tally.dropped) all += each;
    return all;
  }

  EgressRig rig;
  SessionCounters counters;
  Counted counted;
  TestConnection connection;
  std::vector<std::byte> received;
};

// ---- against the rule, entry by entry
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
  for (int i = 0; i < 40; ++i) {
    const std::uint8_t policy = dice.below(8) == 0   ? kBlock
                                : dice.below(3) == 0 ? kDrop
                                                     : std::uint8_t{0};
    const Burst burst = dice.burst(Kind::group, policy);
    rule.come({NodeId{7u << 20 | burst.frame.src}, burst.bytes(), policy == kBlock, policy == kDrop,
               burst.payloads});
    side.push(burst, dice.below(2) == 0);
    ASSERT_EQ(side.rig.dropped(DropReason::queue_full), rule.dropped)
        << "seed " << seed << ", operation " << i;
    ASSERT_EQ(side.counted.lost, rule.dropped);
  }
  side.drain_all();
  side.connection.stream = std::move(side.received);
  std::vector<std::string> came = side.connection.take();
  came.erase(came.begin(), came.begin() + (under_way.size == 0 ? 1 : 2));
  EXPECT_EQ(came, rule.left()) << "seed " << seed;
  EXPECT_TRUE(side.rig.ledger_exact());
}

TEST(FullOutboxProperty, BurstsFollowTheRule) {
  for (std::uint32_t seed = 1; seed <= kSeeds && !::testing::Test::HasFailure(); ++seed)
    run_against_the_rule(seed);
}

// ---- with everything else that happens to an outbox
// ---------------------------------------------------------------

class Mixture {
 public:
  explicit Mixture(std::uint32_t seed) : dice_(seed) { side_.drain(0); }

  void step() {
    switch (dice_.below(14)) {
      case 0:
        return side_.drain(dice_.below(kLaneBytes));
      case 1:
        return side_.drain(dice_.below(proto::kHeaderSize));
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
        if (dice_.below(4) == 0) side_.connection.outbox.time_out_block(side_.rig.context);
        return;
      default:
        return burst();
    }
  }
  void check(const std::string& where) {
    ASSERT_TRUE(side_.rig.ledger_exact()) << where;
    ASSERT_EQ(side_.counters.dropped.value(), side_.dropped()) << where;
    LaneQueue& lane = side_.connection.outbox.lane(kLane);
    std::uint64_t droppable = 0;
    std::uint64_t largest = 0;
    std::uint64_t all = 0;
    RingQueue<Entry>& entries = lane.entries();
    for (std::uint64_t number = entries.first_number(); number != entries.end_number(); ++number) {
      const Entry& entry = entries.at(number);
      all += entry.size;
      // A fragment joins its message, and a newer message takes the place of the older one, however
      // large they are.
      if (entry.frames == 0 || entry.block || entry.touched || entry.fragmented || entry.latest)
        continue;
      droppable += entry.size;
      largest = std::max<std::uint64_t>(largest, entry.size);
    }
    ASSERT_EQ(lane.bytes(), all) << where;
    ASSERT_LE(droppable, std::max<std::uint64_t>(kLaneBytes, largest)) << where;
  }
  void end() {
    if (used_up_) side_.rig.lease.give_back(kMuch);
    side_.drain_all();
    check("at the end");
    EXPECT_EQ(side_.rig.tally.queued, 0);
  }

 private:
  static constexpr std::uint64_t kMuch = std::uint64_t{1} << 40;

  void burst() {
    const Kind kind = dice_.below(3) == 0 ? Kind::unicast : Kind::group;
    const std::uint8_t policies[] = {0, 0, kDrop, kDrop, kBlock};
    side_.push(dice_.burst(kind, policies[dice_.below(5)]), dice_.below(2) == 0);
  }
  void latest() {
    const std::string payload =
        "key____" + std::to_string(dice_.below(3)) + dice_.payload(dice_.below(300));
    side_.rig.push(side_.connection.outbox, payload,
                   {.kind = Kind::group, .flags = kLatest, .lane = kLane});
  }
  /// Messages in three parts, of which now and then a part is missing.
  void fragment() {
    if (dice_.below(12) == 0) ++message_;
    const std::uint32_t part = part_++ % 3;
    side_.rig.push_fragment(
        side_.connection.outbox, message_, 100 * part, 300,
        std::string(100, static_cast<char>('a' + part)),
        {.kind = Kind::group, .flags = message_ % 2 == 0 ? kDrop : std::uint8_t{0}, .lane = kLane});
    if (part == 2) ++message_;
  }
  /// Not worth writing after a while.
  void aged() {
    std::byte memory[64];
    proto::ExtensionWriter writer(memory);
    ASSERT_TRUE(writer.add_age({side_.rig.context.now_wall_ns, 1 + dice_.below(100)}));
    std::string payload(2, '\0');
    payload[0] = static_cast<char>(writer.written().size());
    payload.append(reinterpret_cast<const char*>(writer.written().data()), writer.written().size());
    payload += dice_.payload(dice_.below(50));
    side_.rig.push(side_.connection.outbox, payload,
                   {.kind = Kind::group, .flags = proto::kFlagExt, .lane = kLane});
    side_.rig.context.now_wall_ns += 10'000'000;
  }
  /// Of what comes while the budget is used up nothing is taken where something waits.
  void toggle_budget() {
    if (used_up_) {
      side_.rig.lease.give_back(kMuch);
      used_up_ = false;
    } else if (dice_.below(3) == 0) {
      side_.rig.lease.take(kMuch);
      used_up_ = true;
    }
  }

  Dice dice_;
  Side side_;
  std::uint32_t message_ = 1;
  std::uint32_t part_ = 0;
  bool used_up_ = false;
};

TEST(FullOutboxProperty, CountsStayExactAndTheLaneWithinItsLimit) {
  for (std::uint32_t seed = 1; seed <= kSeeds && !::testing::Test::HasFailure(); ++seed) {
    Mixture mixture(seed);
    for (int i = 0; i < kOperations && !::testing::Test::HasFailure(); ++i) {
      mixture.step();
      mixture.check("seed " + std::to_string(seed) + ", operation " + std::to_string(i));
    }
    mixture.end();
  }
}

}  // namespace
}  // namespace gimnet::hub
