#include "base/log_throttle.hpp"

#include <utility>

namespace gimnet {

bool LogBudget::take(std::uint64_t per_s, std::chrono::milliseconds now) {
  if (bucket_.take({per_s, 2 * per_s}, now)) return true;
  ++left_out_;
  return false;
}

std::uint64_t LogBudget::take_left_out() { return std::exchange(left_out_, 0); }

LogThrottle::Verdict LogThrottle::take(std::string_view reason, std::string_view peer,
                                       std::uint64_t per_s, std::chrono::milliseconds now) {
  std::string name{reason};
  name += '\0';
  name += peer;
  Subject& subject = find(std::move(name));
  if (!subject.bucket.take({per_s, per_s}, now)) {
    ++subject.left_out;
    return {};
  }
  return {true, std::exchange(subject.left_out, 0)};
}

std::uint64_t LogThrottle::take_forgotten() { return std::exchange(forgotten_, 0); }

LogThrottle::Subject& LogThrottle::find(std::string name) {
  if (const auto known = by_name_.find(name); known != by_name_.end()) {
    subjects_.splice(subjects_.begin(), subjects_, known->second);
    return subjects_.front();
  }
  if (subjects_.size() == kSubjectsMax) {
    forgotten_ += subjects_.back().left_out;
    by_name_.erase(subjects_.back().name);
    subjects_.pop_back();
  }
  subjects_.emplace_front().name = std::move(name);
  by_name_.emplace(subjects_.front().name, subjects_.begin());
  return subjects_.front();
}

}  // namespace gimnet
