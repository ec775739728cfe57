#include "client/nif/window_tuning.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <deque>
#include <utility>

#include "proto/frame/fragmenter.hpp"
#include "proto/frame/taken.hpp"

namespace gimnet::nif::test {
namespace {

constexpr std::int64_t kMs = 1'000'000;
constexpr std::int64_t kSecond = 1'000 * kMs;
constexpr double kSlow = 8e6 / 8;     // 8 Mbit/s
constexpr double kGigabit = 1e9 / 8;  // 1 Gbit/s

/// A sender that always has more, a way of a given rate and length with a queue without end, and a
/// receiver that tunes its window, by a clock of their own.
class Path {
 public:
  Path(double bytes_per_s, std::int64_t round_trip_ns,
       std::uint32_t total = proto::kMessageBytesMax)
      : rate_(bytes_per_s),
        round_trip_ns_(round_trip_ns),
        total_(total),
        sender_(1, total),
        receiver_(1, total) {}

  void set_rate(double bytes_per_s) { rate_ = bytes_per_s; }
  /// The receiver looks only so often for what has come.
  void set_nap(std::int64_t nap_ns) { nap_ns_ = nap_ns; }

  /// Lets fragments arrive until that long has passed, or all came. Returns how many bytes those
  /// were.
  std::uint32_t run(std::int64_t ns) {
    const std::int64_t end_ns = now_ns_ + ns;
    const std::uint32_t before = taken_;
    while (now_ns_ < end_ns && taken_ < total_) step();
    return taken_ - before;
  }

  [[nodiscard]] std::uint32_t window() const { return tuning_.window(); }
  [[nodiscard]] std::uint32_t under_way() const { return sender_.sent() - taken_; }
  [[nodiscard]] std::int64_t now_ns() const { return now_ns_; }
  /// The most under way since the last call.
  std::uint32_t most_under_way() { return std::exchange(most_, 0u); }
  [[nodiscard]] std::uint32_t least_allowed() const { return least_allowed_; }

 private:
  struct Fragment {
    std::int64_t ready_ns = 0;  ///< it is at the narrow place
    std::uint32_t size = 0;
  };
  struct Told {
    std::int64_t at_ns = 0;
    proto::Taken taken;
  };

  void send(std::int64_t now_ns) {
    while (sender_.room() > 0) {
      const std::uint32_t size = std::min(sender_.room(), proto::kFragmentPayload);
      sender_.on_sent(size);
      queue_.push_back({now_ns, size});
    }
    most_ = std::max(most_, under_way());
  }

  /// One fragment arrives, and before it all TAKENs that are told by then.
  void step() {
    if (now_ns_ == 0) send(0);
    if (queue_.empty()) {
      ASSERT_FALSE(told_.empty()) << "stands still at " << taken_;
      hear();
      return;
    }
    const std::int64_t through_ns =
        std::max(through_ns_, queue_.front().ready_ns) +
        static_cast<std::int64_t>(static_cast<double>(queue_.front().size) / rate_ * 1e9);
    const std::int64_t arrival_ns = (through_ns + nap_ns_ - 1) / nap_ns_ * nap_ns_;
    if (!told_.empty() && told_.front().at_ns <= arrival_ns) return hear();
    through_ns_ = through_ns;
    now_ns_ = arrival_ns;
    taken_ += queue_.front().size;
    queue_.pop_front();
    tuning_.on_received(taken_, now_ns_);
    if (!receiver_.due(taken_)) return;
    tuning_.on_taken(taken_, now_ns_);
    receiver_.set_window(tuning_.window());
    const proto::Taken told = receiver_.tell(taken_);
    if (told.allowed < total_) least_allowed_ = std::min(least_allowed_, told.allowed - told.taken);
    told_.push_back({now_ns_ + round_trip_ns_, told});
  }

  /// The whole length of the way is counted on its way back.
  void hear() {
    const Told told = told_.front();
    told_.pop_front();
    static_cast<void>(sender_.on_taken(told.taken));
    send(told.at_ns);
  }

  double rate_;
  const std::int64_t round_trip_ns_;
  const std::uint32_t total_;
  proto::SendWindow sender_;
  proto::ReceiveWindow receiver_;
  WindowTuning tuning_;
  std::deque<Fragment> queue_;
  std::deque<Told> told_;
  std::int64_t nap_ns_ = 1;
  std::int64_t through_ns_ = 0;  ///< when the narrow place had handled the last fragment
  std::int64_t now_ns_ = 0;
  std::uint32_t taken_ = 0;
  std::uint32_t most_ = 0;
  std::uint32_t least_allowed_ = UINT32_MAX;
};

TEST(WindowTuning, BeginsWithTheProtocolsFirstWindow) {
  EXPECT_EQ(WindowTuning().window(), proto::kWindowDefault);
}

TEST(WindowTuning, OnASlowPathLittleIsUnderWay) {
  Path path(kSlow, 2 * kMs);
  path.run(4 * kSecond);
  EXPECT_LE(path.most_under_way(), proto::kWindowDefault) << "never more than at first";
  const std::uint32_t bytes = path.run(20 * kSecond);
  EXPECT_LE(path.most_under_way(), 300'000u) << "0.3 s at that rate";
  EXPECT_GE(bytes, 19 * static_cast<std::uint32_t>(kSlow)) << "the path is never idle";
}

TEST(WindowTuning, OnAFastPathTheWindowIsTheLargest) {
  Path path(kGigabit, 10 * kMs);
  path.run(300 * kMs);
  EXPECT_EQ(path.window(), WindowTuning::kWindowMax);
  EXPECT_GE(path.run(kSecond), 99 * static_cast<std::uint32_t>(kGigabit) / 100);
  EXPECT_EQ(path.window(), WindowTuning::kWindowMax);
}

TEST(WindowTuning, ALargeMessageOnAFastPathLosesNoTime) {
  constexpr std::uint32_t kTotal = 64u << 20;
  Path path(kGigabit, kMs, kTotal);
  EXPECT_EQ(path.run(10 * kSecond), kTotal);
  EXPECT_LE(path.now_ns(), static_cast<std::int64_t>(kTotal / kGigabit * 1e9 * 1.01));
}

TEST(WindowTuning, FollowsAPathThatBecomesSlow) {
  Path path(kGigabit, 2 * kMs);
  path.run(kSecond);
  ASSERT_EQ(path.window(), WindowTuning::kWindowMax);
  path.set_rate(kSlow);
  path.run(9 * kSecond);
  EXPECT_LE(path.window(), proto::kWindowDefault * 2)
      << "what was allowed before took so long to come";
  path.run(8 * kSecond);
  static_cast<void>(path.most_under_way());
  path.run(10 * kSecond);
  EXPECT_LE(path.most_under_way(), 300'000u);
}

TEST(WindowTuning, FollowsAPathThatBecomesFast) {
  Path path(kSlow, 2 * kMs);
  path.run(10 * kSecond);
  ASSERT_LE(path.window(), 300'000u);
  path.set_rate(kGigabit);
  path.run(kSecond);
  EXPECT_EQ(path.window(), WindowTuning::kWindowMax);
}

TEST(WindowTuning, KeepsALongPathBusy) {
  // 100 Mbit/s over two satellites: 7.5 MB on their way when it is full.
  Path path(100e6 / 8, 600 * kMs);
  path.run(15 * kSecond);
  const std::uint32_t bytes = path.run(60 * kSecond);
  EXPECT_GE(bytes, 60u * 12'500'000u / 10u * 7u) << "the trials take a part";
}

TEST(WindowTuning, KeepsAPathOfAboutItsLoopBusy) {
  for (const std::int64_t round_trip_ms : {150, 190, 200, 210, 250}) {
    Path path(kGigabit / 5, round_trip_ms * kMs);
    path.run(10 * kSecond);
    EXPECT_GE(path.run(10 * kSecond), 10u * 25'000'000u / 10u * 7u) << round_trip_ms;
  }
}

/// Of all paths: never wider than allowed, never so narrow that a fragment has no room, and a slow
/// one has no long queue.
TEST(WindowTuning, StaysWithinItsBoundsOnEveryPath) {
  for (double rate = 1e4; rate < 2e9; rate *= 4) {
    for (const std::int64_t round_trip_ms : {0, 1, 30, 180, 220, 700, 2'000}) {
      Path path(rate, round_trip_ms * kMs);
      const std::uint32_t bytes = path.run(30 * kSecond);
      EXPECT_GT(bytes, 0u) << rate << ' ' << round_trip_ms;
      EXPECT_GE(path.least_allowed(), WindowTuning::kWindowMin) << rate << ' ' << round_trip_ms;
      EXPECT_GE(path.window(), WindowTuning::kWindowMin);
      EXPECT_LE(path.most_under_way(), WindowTuning::kWindowMax + WindowTuning::kWindowMax / 4);
      const double loop_s = static_cast<double>(std::max<std::int64_t>(round_trip_ms, 200)) / 1e3;
      const double most =
          std::max(rate * loop_s * 1.6, static_cast<double>(WindowTuning::kWindowMin));
      if (rate < 1e5) continue;  // the first window took all the time
      static_cast<void>(path.run(60 * kSecond));
      EXPECT_LE(path.under_way(), most) << rate << ' ' << round_trip_ms;
    }
  }
}

TEST(WindowTuning, AReceiverThatSleepsDoesNotTakeASlowPathForAFastOne) {
  for (const std::int64_t nap_ms : {20, 100, 300}) {
    Path path(kSlow, 2 * kMs);
    path.set_nap(nap_ms * kMs);
    path.run(10 * kSecond);
    EXPECT_LE(path.most_under_way(), proto::kWindowDefault) << nap_ms;
    const std::uint32_t bytes = path.run(60 * kSecond);
    EXPECT_LE(path.most_under_way(), 900'000u) << nap_ms;
    EXPECT_GE(bytes, 40 * static_cast<std::uint32_t>(kSlow)) << nap_ms;
  }
}

TEST(WindowTuning, NumbersThatContradictThemselvesBreakNothing) {
  WindowTuning tuning;
  std::uint64_t random = 88'172'645'463'325'252;
  for (int i = 0; i < 100'000; ++i) {
    random ^= random << 13;
    random ^= random >> 7;
    random ^= random << 17;
    const auto taken = static_cast<std::uint32_t>(random % proto::kMessageBytesMax);
    const auto now_ns = static_cast<std::int64_t>(random >> (random % 64)) / 2;
    tuning.on_received(taken, now_ns);
    if (i % 3 != 0) tuning.on_taken(taken, now_ns);
    ASSERT_GE(tuning.window(), WindowTuning::kWindowMin);
    ASSERT_LE(tuning.window(), WindowTuning::kWindowMax);
  }
}

}  // namespace
}  // namespace gimnet::nif::test
