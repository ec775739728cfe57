// Random messages to a paced subscription, from a seed, with everything else that happens to one
// between them. What a run does to it at once is what its frames do one by one, as long as the
// outbox has room: one side gets each burst as the run that it is, the other one each of its frames
// alone. Where lanes are small, counts stay exact and limits hold.

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "hub/observe/session_gauges.hpp"
#include "proto/frame/frame_parser.hpp"
#include "tests/hub/data/support/route_rig.hpp"

namespace gimnet::hub {
namespace {

using proto::DropReason;
using proto::Kind;
using testing::RouteRig;
using testing::TestFrame;

constexpr std::uint32_t kSeeds = 400;
constexpr int kOperations = 120;
constexpr GroupId kGroup{7u << 20 | 5};
constexpr std::uint32_t kSmallLaneBytes = 1'000;
constexpr std::uint32_t kLargeLaneBytes = 1 << 30;
constexpr std::uint8_t kDrop = 2;
constexpr std::uint64_t kMuch = std::uint64_t{1} << 40;

Limits limits(std::uint32_t lane_bytes) {
  Limits limits;
  limits.lane0_bytes = limits.lane1_bytes = limits.lane2_bytes = limits.lane3_bytes = lane_bytes;
  limits.block_ms = std::uint64_t{1} << 40;
  return limits;
}

/// Frames with one header; every payload is another one, as far as its length allows.
struct Burst {
  TestFrame frame;
  std::vector<std::string> payloads;
};

/// A shard with one subscriber, and all that can be seen of it.
struct Side {
  explicit Side(std::uint32_t lane_bytes) : rig(limits(lane_bytes)) {
    recipient.outbox.set_counters(counters);
  }

  void subscribe(const PaceTerms& terms) { one = &rig.pacer.subscribe(recipient, kGroup, terms); }
  void offer(const hub::Run& run, Handover handover) {
    rig.pacer.begin_run(run, testing::last_bytes_of(run));
    EXPECT_TRUE(rig.pacer.offer(*one, run, run.header(), handover));
  }
  void offer_whole(const Burst& burst, bool fan_out) {
    offer(rig.make_run(kGroup.value(), burst.payloads, burst.frame), {fan_out});
  }
  void offer_singly(const Burst& burst, bool fan_out) {
    hub::Run rest = rig.make_run(kGroup.value(), burst.payloads, burst.frame);
    while (rest.frames != 0) {
      const hub::Run frame = rest.take_frame();
      offer(frame, {fan_out});
    }
  }
  void end_turn(std::uint64_t ms) {
    rig.pacer.release_due();
    rig.egress.context.now_ms += ms;
    rig.pacer.release_due();
  }
  /// The subscriber takes all that waits for it.
  void drain() {
    for (std::size_t lane = 0; lane < proto::kLaneCount; ++lane) {
      LaneQueue& queue = recipient.outbox.lane(lane);
      for (; !queue.empty(); queue.pop_front()) {
        Entry& entry = queue.front();
        do {
          received.emplace_back(reinterpret_cast<const char*>(entry.run.bytes), entry.run.size);
          for (hub::Run rest = entry.run.share(); rest.frames != 0; rest.skip_frame()) {
            const auto frame = proto::parse_frame({rest.bytes, rest.size}, proto::Origin::hub);
            if (frame && frame->ends_message()) ++taken;
          }
        } while (entry.next_piece());
        rig.egress.tally.queued -= entry.frames;
        rig.egress.tally.delivered += entry.frames;
        queue.on_left(entry, entry.size);
      }
    }
  }
  std::string seen() {
    std::string all = "queued " + std::to_string(rig.egress.tally.queued) + " held " +
                      std::to_string(one->held()) + " of " + std::to_string(one->held_bytes()) +
                      " uncredited " + std::to_string(one->uncredited()) + " space " +
                      std::to_string(one->space()) + " due " + std::to_string(one->due_us()) +
                      " next " + std::to_string(rig.pacer.next_due_ms()) + " dropped " +
                      std::to_string(counters.dropped.value()) + " taken " + std::to_string(taken);
    for (const std::uint64_t dropped : rig.egress.tally.dropped)
      all += " " + std::to_string(dropped);
    return all;
  }
  /// The bytes that were received, however they were cut into runs.
  std::string bytes() const {
    std::string all;
    for (const std::string& each : received) all += each;
    return all;
  }

  SessionCounters counters;
  RouteRig rig;
  Recipient& recipient = rig.add_here(2);
  PacedSubscription* one = nullptr;
  std::vector<std::string> received;
  std::uint64_t taken = 0;
};

class Pair {
 public:
  Pair(std::uint32_t seed, std::uint32_t lane_bytes)
      : random_(seed), whole_(lane_bytes), singly_(lane_bytes) {
    new_terms();
    if (below(4) == 0) both([](Side& side) { side.recipient.frame_bytes = 40; });
  }

  void step() {
    switch (below(16)) {
      case 0:
        return new_terms();
      case 1:
      case 2:
        return both([](Side& side) { side.drain(); });
      case 3:
      case 4:
      case 5:
        return credit();
      case 6:
        return fragment();
      case 7:
        return toggle_budget();
      case 8:
        return lose_all();
      case 9:
        return pass_time();
      default:
        return burst();
    }
  }
  void check_equal(const std::string& where) { ASSERT_EQ(whole_.seen(), singly_.seen()) << where; }
  void check_limits(const std::string& where) {
    for (Side* side : {&whole_, &singly_}) {
      ASSERT_TRUE(side->rig.ledger_exact()) << where;
      ASSERT_LE(side->one->held(), side->one->terms().depth) << where;
      if (side->one->held() <= 1) continue;
      ASSERT_LE(side->one->held_bytes(), kSmallLaneBytes) << where;
    }
  }
  void end() {
    if (used_up_) both([](Side& side) { side.rig.egress.lease.give_back(kMuch); });
    // Another window lets all that is held go.
    both([](Side& side) {
      side.drain();
      side.subscribe({});
      side.drain();
    });
    check_limits("at the end");
  }
  void check_equal_end() {
    check_equal("at the end");
    EXPECT_TRUE(whole_.bytes() == singly_.bytes());
    EXPECT_LE(whole_.rig.egress.tally.copied_bytes, singly_.rig.egress.tally.copied_bytes);
  }

 private:
  template <class Do>
  void both(Do&& what) {
    what(whole_);
    what(singly_);
  }
  std::uint32_t below(std::uint32_t n) { return static_cast<std::uint32_t>(random_() % n); }

  void new_terms() {
    PaceTerms terms;
    if (below(3) != 0) terms.window = 1 + below(below(2) == 0 ? 3 : 40);
    if (below(2) == 0) terms.interval_us = 1 + below(below(2) == 0 ? 3'000 : 20'000);
    terms.depth = below(2) == 0 ? 1 : 1 + below(below(2) == 0 ? 4 : 80);
    both([&](Side& side) { side.subscribe(terms); });
  }
  std::string payload(std::size_t size) {
    std::string text = std::to_string(++made_);
    text.resize(size, '.');
    return text;
  }
  void burst() {
    Burst burst{{.kind = Kind::group, .flags = below(3) == 0 ? kDrop : std::uint8_t{0}}, {}};
    // Not that of the fragments: one that is given up makes room for what is held, once all of the
    // run is.
    burst.frame.lane = below(8) == 0 ? 3 : 1;
    burst.frame.src = 1;  // of another one a run gives up what is coming as its first frame does
    if (below(2) == 0) burst.frame.flags |= proto::kFlagReport;
    const std::uint32_t base = below(8) == 0 ? below(1'500) : below(30);
    const std::uint32_t spread = below(2) == 0 ? 1 : 1 + below(below(4) == 0 ? 1'200 : 30);
    const std::uint32_t frames = 1 + below(base > 100 ? 4 : 120);
    for (std::uint32_t i = 0; i < frames; ++i)
      burst.payloads.push_back(payload(base + below(spread)));
    const bool fan_out = below(2) == 0;
    whole_.offer_whole(burst, fan_out);
    singly_.offer_singly(burst, fan_out);
    if (below(2) == 0) both([](Side& side) { side.end_turn(0); });
  }
  /// Messages in three parts, of which now and then a part is missing.
  void fragment() {
    if (below(12) == 0) ++message_;
    const std::uint32_t part = part_++ % 3;
    std::string bytes(proto::kFragmentHeaderSize, '\0');
    proto::store_fragment_header(reinterpret_cast<std::byte*>(bytes.data()),
                                 {message_, 100 * part, 300});
    bytes += std::string(100, static_cast<char>('a' + part));
    const Burst burst{{.kind = Kind::group, .flags = proto::kFlagFragment, .lane = 2}, {bytes}};
    both([&](Side& side) { side.offer_singly(burst, false); });
    if (part == 2) ++message_;
  }
  /// So many as it took, or some of them.
  void credit() {
    const std::uint64_t total =
        whole_.taken - below(2) * std::min<std::uint64_t>(whole_.taken, below(3));
    both([&](Side& side) {
      std::ignore = side.rig.pacer.on_credit(side.recipient, {kGroup, total});
    });
  }
  void pass_time() {
    const std::uint64_t ms = below(4) == 0 ? 1'000 : below(12);
    both([&](Side& side) { side.end_turn(ms); });
  }
  void lose_all() {
    if (below(3) != 0) return;
    both([](Side& side) {
      side.recipient.outbox.drop_all(DropReason::link_lost, side.rig.egress.context);
      side.rig.pacer.release_due();
    });
  }
  void toggle_budget() {
    if (used_up_) {
      both([](Side& side) { side.rig.egress.lease.give_back(kMuch); });
      used_up_ = false;
    } else if (below(3) == 0) {
      both([](Side& side) { side.rig.egress.lease.take(kMuch); });
      used_up_ = true;
    }
  }

  std::mt19937 random_;
  Side whole_;
  Side singly_;
  std::uint32_t made_ = 0;
  std::uint32_t message_ = 1;
  std::uint32_t part_ = 0;
  bool used_up_ = false;
};

TEST(PacerProperty, ARunIsTakenAsItsFramesAre) {
  for (std::uint32_t seed = 1; seed <= kSeeds && !::testing::Test::HasFailure(); ++seed) {
    Pair pair(seed, kLargeLaneBytes);
    for (int i = 0; i < kOperations && !::testing::Test::HasFailure(); ++i) {
      pair.step();
      pair.check_equal("seed " + std::to_string(seed) + ", operation " + std::to_string(i));
    }
    pair.end();
    pair.check_equal_end();
  }
}

TEST(PacerProperty, InSmallLanesCountsStayExactAndLimitsHold) {
  for (std::uint32_t seed = 1; seed <= kSeeds && !::testing::Test::HasFailure(); ++seed) {
    Pair pair(seed, kSmallLaneBytes);
    for (int i = 0; i < kOperations && !::testing::Test::HasFailure(); ++i) {
      pair.step();
      pair.check_limits("seed " + std::to_string(seed) + ", operation " + std::to_string(i));
    }
    pair.end();
  }
}

}  // namespace
}  // namespace gimnet::hub
