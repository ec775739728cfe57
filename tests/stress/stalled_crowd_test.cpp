#include <gtest/gtest.h>

#include <algorithm>
#include <ctime>
#include <memory>
#include <string>
#include <vector>

#include "tests/hub/data/support/route_rig.hpp"

// A publisher of small messages and 10,000 subscribers that read nothing. Provable is that a
// shard's turn does not depend on whether the messages are all equally long: neither for plain
// subscriptions, nor where the hub holds the newest messages.

namespace gimnet::hub {
namespace {

using proto::Kind;
using testing::last_bytes_of;
using testing::RouteRig;

constexpr std::uint32_t kSubscribers = 10'000;
constexpr std::uint32_t kGroup = 5;
constexpr std::uint32_t kPayloadBytes = 16;
constexpr int kRounds = 7;

double thread_seconds() {
  timespec now{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + static_cast<double>(now.tv_nsec) * 1e-9;
}

/// A run as long as the parser makes it. Unequal: as long on average.
std::vector<std::string> payloads(bool equal) {
  std::vector<std::string> all(proto::kRunBytesMax / (proto::kHeaderSize + kPayloadBytes));
  for (std::size_t i = 0; i < all.size(); ++i)
    all[i].assign(equal ? kPayloadBytes : i % (2 * kPayloadBytes), 'x');
  return all;
}

/// Subscribers whose lanes, windows and held messages are full.
struct Crowd {
  explicit Crowd(const PaceTerms* terms) {
    std::vector<std::uint32_t> plain;
    GroupMembers& members = rig.members;
    members.paced_by_shard.assign(2, {});
    for (std::uint32_t index = 2; index < 2 + kSubscribers; ++index) {
      Recipient& recipient = rig.add_here(index);
      recipient.outbox.settle(rig.egress.context);  // as after a write that did not take all
      if (terms == nullptr) {
        plain.push_back(index);
      } else {
        std::ignore = rig.pacer.subscribe(recipient, group(), *terms);
        members.paced_by_shard[0].put({recipient.slot, recipient.generation, false});
      }
    }
    rig.publish_group(kGroup, 1, plain, {});
  }
  static GroupId group() { return make_id<GroupId>(HubId{7}, kGroup); }

  /// Seconds of one turn with one run.
  double turn(const std::vector<std::string>& texts) {
    const hub::Run run = rig.make_run(group().value(), texts, {.kind = Kind::group});
    const std::uint32_t last_bytes = last_bytes_of(run);
    const double before = thread_seconds();
    rig.router.route(run.buffer, {run.bytes, run.size, run.frames, last_bytes});
    return thread_seconds() - before;
  }

  RouteRig rig;
};

void expect_as_quick(const PaceTerms* terms) {
  Crowd crowd(terms);
  const auto equal = payloads(true);
  const auto unequal = payloads(false);
  // Until every lane is full.
  const std::uint64_t lane_bytes = crowd.rig.egress.limits.lane1_bytes;
  for (std::uint64_t bytes = 0; bytes <= lane_bytes; bytes += proto::kRunBytesMax / 2)
    static_cast<void>(crowd.turn(unequal));
  double equal_s = 1e9;
  double unequal_s = 1e9;
  for (int round = 0; round < kRounds; ++round) {
    equal_s = std::min(equal_s, crowd.turn(equal));
    unequal_s = std::min(unequal_s, crowd.turn(unequal));
  }
  EXPECT_LE(unequal_s, 2 * equal_s) << "of " << equal_s << " s";
  EXPECT_TRUE(crowd.rig.egress.tally.any_dropped);
  EXPECT_TRUE(crowd.rig.ledger_exact());
}

TEST(StalledCrowd, PlainTakesUnequalRunsAsQuicklyAsEqualOnes) { expect_as_quick(nullptr); }

TEST(StalledCrowd, Sync1TakesUnequalRunsAsQuicklyAsEqualOnes) {
  constexpr PaceTerms kTerms{.window = 1, .depth = 1};
  expect_as_quick(&kTerms);
}

TEST(StalledCrowd, Depth8TakesUnequalRunsAsQuicklyAsEqualOnes) {
  constexpr PaceTerms kTerms{.window = 1, .depth = 8};
  expect_as_quick(&kTerms);
}

}  // namespace
}  // namespace gimnet::hub
