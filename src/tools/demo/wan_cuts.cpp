#include "tools/demo/wan_cuts.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace gimnet::demo {

void WanCuts::plan(std::int64_t now_ns, std::optional<double> seconds) {
  const MutexLock lock(mutex_);
  next_ns_ = now_ns + kFirst_ns;
  if (!seconds) return;
  const auto whole_ns = static_cast<std::int64_t>(*seconds * 1e9);
  next_ns_ = now_ns + std::min(kFirst_ns, whole_ns / 2);
  last_ns_ = std::max(next_ns_, now_ns + whole_ns - kCut_ns - 2 * kAfter_ns);
}

WanCuts::Change WanCuts::step(std::int64_t now_ns) {
  const MutexLock lock(mutex_);
  if (!cuts_.empty() && cuts_.back().end_ns == kOpen) {
    if (now_ns < cuts_.back().begin_ns + kCut_ns) return Change::none;
    cuts_.back().end_ns = now_ns;
    return Change::back;
  }
  if (now_ns < next_ns_) return Change::none;
  if (cuts_.size() == kCutsKept) cuts_.pop_front();
  cuts_.push_back({now_ns, kOpen});
  ++count_;
  next_ns_ += kEvery_ns;
  if (next_ns_ > last_ns_) next_ns_ = kNever;
  return Change::cut;
}

void WanCuts::stop() {
  const MutexLock lock(mutex_);
  next_ns_ = kNever;
}

bool WanCuts::explain(std::int64_t sent_ns) const {
  const MutexLock lock(mutex_);
  if (next_ns_ != kNever && sent_ns >= next_ns_ - kUnderWay_ns) return true;
  return std::ranges::any_of(cuts_, [sent_ns](const Cut& cut) {
    return sent_ns >= cut.begin_ns - kUnderWay_ns &&
           (cut.end_ns == kOpen || sent_ns <= cut.end_ns + kAfter_ns);
  });
}

bool WanCuts::quiet(std::int64_t now_ns) const {
  const MutexLock lock(mutex_);
  return cuts_.empty() ||
         (cuts_.back().end_ns != kOpen && now_ns > cuts_.back().end_ns + kAfter_ns);
}

std::uint64_t WanCuts::count() const {
  const MutexLock lock(mutex_);
  return count_;
}

void WanCuts::show(LabsView& view, std::int64_t now_ns,
                   std::optional<std::int64_t> round_trip_ns) const {
  const MutexLock lock(mutex_);
  view.cuts = count_;
  view.wan = LabsView::Wan::up;
  view.wan_text = round_trip_ns
                      ? fmt::format("up, {:.0f} ms", static_cast<double>(*round_trip_ns) * 1e-6)
                      : "up";
  if (cuts_.empty()) return;
  const Cut& last = cuts_.back();
  if (last.end_ns == kOpen) {
    view.wan = LabsView::Wan::cut;
    view.wan_text =
        fmt::format("CUT for {:.1f} s", static_cast<double>(now_ns - last.begin_ns) * 1e-9);
  } else if (now_ns <= last.end_ns + kAfter_ns) {
    view.wan = LabsView::Wan::back;
    view.wan_text = "back";
  }
}

}  // namespace gimnet::demo
