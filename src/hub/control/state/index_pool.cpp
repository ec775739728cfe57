#include "hub/control/state/index_pool.hpp"

#include <algorithm>

#include "base/check.hpp"

namespace gimnet::hub {

IndexPool::IndexPool(std::uint32_t most, std::chrono::milliseconds resting_time, const IndexRange& range)
    : most_(most), resting_time_(resting_time), first_(range.first), count_(range.count) {
  GIMNET_CHECK(first_ > 0 && first_ <= most_ && count_ > 0);
}

std::optional<std::uint32_t> IndexPool::take(std::chrono::milliseconds now) {
  wake(now);
  const std::uint64_t window = std::min<std::uint64_t>(count_, most_);
  if (granted_taken_ >= window) return std::nullopt;
  for (;;) {
    // Nothing more was granted: what was handed out first may be free again.
    if (position_ == count_) position_ = count_ - window;
    const std::uint32_t index = index_at(position_++);
    if (taken(index)) continue;
    reached_ = std::max(reached_, position_);
    mark_taken(index);
    ++held_;
    return index;
  }
}

bool IndexPool::take_free(std::uint32_t index, std::chrono::milliseconds now) {
  wake(now);
  if (index == 0 || index > most_ || taken(index)) return false;
  mark_taken(index);
  ++held_;
  return true;
}

bool IndexPool::take_back(std::uint32_t index) {
  if (index == 0 || index > most_ || held(index)) return false;
  if (rests_until_.erase(index) == 0) mark_taken(index);
  ++held_;
  return true;
}

void IndexPool::give_back(std::uint32_t index, std::chrono::milliseconds now) {
  GIMNET_CHECK(held(index) && held_ > 0);
  --held_;
  rests_until_[index] = now + resting_time_;
  resting_.add({now + resting_time_, index}, rests_until_.size(),
               [this](const Resting& each) { return !still_rests(each); });
  wake(now);
}

bool IndexPool::held(std::uint32_t index) const { return taken(index) && !rests_until_.contains(index); }

void IndexPool::grant(std::uint64_t count) {
  GIMNET_CHECK(count >= count_);
  // Those who came back hold indices that were not granted before.
  for (std::uint64_t position = count_; position < std::min<std::uint64_t>(count, most_); ++position) {
    if (taken(index_at(position))) ++granted_taken_;
  }
  count_ = count;
}

std::uint32_t IndexPool::index_at(std::uint64_t position) const {
  return static_cast<std::uint32_t>((first_ - 1 + position) % most_) + 1;
}

bool IndexPool::granted(std::uint32_t index) const { return (index + most_ - first_) % most_ < count_; }

void IndexPool::mark_taken(std::uint32_t index) {
  if (index >= taken_.size()) taken_.resize(index + 1);
  taken_[index] = true;
  if (granted(index)) ++granted_taken_;
}

/// It was not taken back meanwhile, and perhaps given back anew.
bool IndexPool::still_rests(const Resting& note) const {
  const auto found = rests_until_.find(note.index);
  return found != rests_until_.end() && found->second == note.until;
}

void IndexPool::wake(std::chrono::milliseconds now) {
  while (!resting_.empty() && resting_.front().until <= now) {
    const Resting rested = resting_.front();
    resting_.pop_front();
    if (!still_rests(rested)) continue;
    rests_until_.erase(rested.index);
    taken_[rested.index] = false;
    if (granted(rested.index)) --granted_taken_;
  }
}

}  // namespace gimnet::hub
