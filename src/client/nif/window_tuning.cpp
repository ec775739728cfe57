#include "client/nif/window_tuning.hpp"

#include <algorithm>

namespace gimnet::nif {
namespace {

/// No path takes longer; what does has stood still.
constexpr double kPathNsMax = 10e9;

std::uint32_t within(double bytes, std::uint32_t least, std::uint32_t most) {
  return static_cast<std::uint32_t>(
      std::clamp(bytes, static_cast<double>(least), static_cast<double>(most)));
}

}  // namespace

/// In this time the bytes of a window should have come. A long path is given a quarter more than it
/// needs, to find out whether it carries more.
std::int64_t WindowTuning::limit_ns() const { return std::max(kLoopNs, path_ns_ + path_ns_ / 4); }

void WindowTuning::on_taken(std::uint32_t taken, std::int64_t now_ns) {
  // A sender that uses a number twice at once tells of two messages in turns: there is nothing to
  // learn from it.
  if (taken < begin_ || received_ < begin_ || received_ns_ < begin_ns_) phase_ = Phase::first;
  // On a path that has become slow the round of a large window would take long to end.
  const bool overdue = phase_ == Phase::steady && now_ns - begin_ns_ >= 2 * limit_ns();
  const bool ended = phase_ == Phase::first || received_ >= end_ || overdue;
  if (phase_ == Phase::first) {
    phase_ = Phase::steady;
  } else if (ended) {
    end_round();
  }
  allowed_ = std::max(allowed_, taken + window_);
  if (!ended) return;
  begin_ns_ = received_ns_ = now_ns;
  begin_ = received_ = taken;
  end_ = allowed_;
}

void WindowTuning::end_round() {
  const double bytes = received_ - begin_;
  const double bytes_per_ns =
      bytes / static_cast<double>(std::max<std::int64_t>(received_ns_ - begin_ns_, 1));
  switch (phase_) {
    case Phase::draining:
      // The path may have become slower, or this end may have slept and then read in one go. What
      // is left of the former window takes a whole loop on a long path, too.
      former_rate_ = std::min(former_rate_, bytes_per_ns * former_ / std::max(bytes, 1.0));
      phase_ = Phase::proving;
      return;
    case Phase::proving:
    case Phase::doubting: {
      const double share = static_cast<double>(window_) / static_cast<double>(former_);
      if (bytes_per_ns >= former_rate_ * (1.0 + share) / 2.0) break;
      if (phase_ == Phase::proving) {
        phase_ = Phase::doubting;
        return;
      }
      path_ns_ = static_cast<std::int64_t>(
          std::min({window_ / bytes_per_ns, former_ / former_rate_, kPathNsMax}));
      trust_left_ = kTrustedRounds;
      window_ = former_;
      phase_ = Phase::steady;
      return;
    }
    case Phase::first:
    case Phase::steady:
      break;
  }
  phase_ = Phase::steady;
  adapt(bytes_per_ns);
}

void WindowTuning::adapt(double bytes_per_ns) {
  const double wanted = bytes_per_ns * static_cast<double>(limit_ns());
  const bool known = path_ns_ != 0;
  if (known && --trust_left_ == 0) path_ns_ = 0;
  if (wanted >= window_) {
    // Not faster than this: what came may have waited, and come at once.
    window_ = std::min(within(wanted, window_ + window_ / 4, window_ * 2), kWindowMax);
    return;
  }
  former_ = window_;
  const std::uint32_t most = known ? window_ : window_ - window_ / 4;
  window_ = std::max(within(wanted, window_ / 4, most), kWindowMin);
  if (known || window_ >= former_) return;
  former_rate_ = bytes_per_ns;
  phase_ = Phase::draining;
}

}  // namespace gimnet::nif
