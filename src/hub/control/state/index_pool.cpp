#include "hub/control/state/index_pool.hpp"

#include "base/check.hpp"

namespace gimnet::hub {

IndexPool::IndexPool(std::uint32_t most, std::chrono::milliseconds resting_time)
    : most_(most), resting_time_(resting_time) {
  GIMNET_CHECK(most > 0);
}

std::optional<std::uint32_t> IndexPool::take(std::chrono::milliseconds now) {
  wake(now);
  if (held_ + resting_.size() >= most_) return std::nullopt;
  while (next_ < taken_.size() && taken_[next_]) next_ = next_ == most_ ? 1 : next_ + 1;
  const std::uint32_t index = next_;
  if (index >= taken_.size()) taken_.resize(index + 1);
  taken_[index] = true;
  next_ = index == most_ ? 1 : index + 1;
  ++held_;
  return index;
}

void IndexPool::give_back(std::uint32_t index, std::chrono::milliseconds now) {
  GIMNET_CHECK(index > 0 && index < taken_.size() && taken_[index] && held_ > 0);
  --held_;
  resting_.push_back({now + resting_time_, index});
  wake(now);
}

void IndexPool::wake(std::chrono::milliseconds now) {
  while (!resting_.empty() && resting_.front().until <= now) {
    taken_[resting_.front().index] = false;
    resting_.pop_front();
  }
}

}  // namespace gimnet::hub
