#include "tools/gimnet/meter.hpp"

#include <algorithm>
#include <cmath>

namespace gimnet::tool {
namespace {

double seconds_of(std::int64_t ns) {
  return static_cast<double>(std::max<std::int64_t>(ns, 0)) / 1e9;
}

}  // namespace

void Statistics::add(double value) {
  min_ = count_ == 0 ? value : std::min(min_, value);
  max_ = count_ == 0 ? value : std::max(max_, value);
  ++count_;
  const double from_old_mean = value - mean_;
  mean_ += from_old_mean / static_cast<double>(count_);
  squares_ += from_old_mean * (value - mean_);
}

double Statistics::deviation() const {
  return count_ < 2 ? 0.0 : std::sqrt(std::max(squares_, 0.0) / static_cast<double>(count_));
}

double Reading::rate_hz() const {
  return gaps_ms.sum() > 0.0 ? 1000.0 * static_cast<double>(gaps_ms.count()) / gaps_ms.sum() : 0.0;
}

void Meter::count(Reading& reading, const Arrival& arrival) {
  reading.sizes_bytes.add(static_cast<double>(arrival.bytes));
  if (arrival.gap_ns >= 0) reading.gaps_ms.add(static_cast<double>(arrival.gap_ns) / 1e6);
}

void Meter::add(std::int64_t at_ns, std::size_t bytes) {
  const bool is_first = whole_.sizes_bytes.count() == 0;
  // A clock that was set back makes no negative gap.
  const Arrival arrival{at_ns, is_first ? -1 : std::max<std::int64_t>(at_ns - last_ns_, 0), bytes};
  last_ns_ = at_ns;
  count(whole_, arrival);
  if (arrivals_.size() == kMessagesMax) arrivals_.pop_front();
  arrivals_.push_back(arrival);
}

Reading Meter::recent(std::int64_t now_ns) {
  const std::int64_t from_ns = std::max(begin_ns_, now_ns - window_ns_);
  while (!arrivals_.empty() && arrivals_.front().at_ns < from_ns) arrivals_.pop_front();
  Reading reading;
  for (const Arrival& arrival : arrivals_) count(reading, arrival);
  reading.seconds = seconds_of(now_ns - from_ns);
  reading.silent_s = whole(now_ns).silent_s;
  return reading;
}

Reading Meter::whole(std::int64_t now_ns) const {
  Reading reading = whole_;
  reading.seconds = seconds_of(now_ns - begin_ns_);
  reading.silent_s =
      reading.sizes_bytes.count() == 0 ? reading.seconds : seconds_of(now_ns - last_ns_);
  return reading;
}

}  // namespace gimnet::tool
