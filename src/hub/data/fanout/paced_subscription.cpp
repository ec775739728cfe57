#include "hub/data/fanout/paced_subscription.hpp"

#include <algorithm>
#include <utility>

#include "base/check.hpp"

namespace gimnet::hub {

void PacedSubscription::set_terms(const PaceTerms& terms) {
  // Without an interval this is when the last one that had one began.
  if (due_us_ != 0) due_us_ = due_us_ - terms_.interval_us + terms.interval_us;
  terms_ = terms;
  terms_.depth = std::max(1u, terms.depth);
  std::vector<KeptMessage> ring(std::max<std::size_t>(terms_.depth, held_));
  for (std::size_t i = 0; i < held_; ++i) ring[i] = std::move(ring_[(first_ + i) % ring_.size()]);
  ring_ = std::move(ring);
  first_ = 0;
}

std::uint64_t PacedSubscription::space() const {
  if (terms_.window == 0) return UINT64_MAX;
  const auto passing = std::count_if(open_.begin(), open_.end(), [](const Open& open) {
    return open.state == Open::State::passing;
  });
  const std::uint64_t under_way = uncredited() + static_cast<std::uint64_t>(passing);
  return terms_.window > under_way ? terms_.window - under_way : 0;
}

void PacedSubscription::on_begun(std::uint64_t now_us) {
  if (terms_.interval_us == 0) return;
  // A little late, the next one is due as if this one had been in time: the rate holds on average.
  const bool in_time = due_us_ != 0 && now_us - due_us_ < terms_.interval_us;
  due_us_ = (in_time ? due_us_ : now_us) + terms_.interval_us;
}

void PacedSubscription::on_lost(std::uint64_t messages) {
  lost_ = std::min(lost_ + messages, sent_);
  // A subscriber may have credited what never left: it counts once.
  credited_ = std::min(credited_, sent_ - lost_);
}

bool PacedSubscription::on_credit(std::uint64_t total) {
  if (total < credited_) return false;
  const std::uint64_t reached = sent_ - lost_;
  credited_ = std::min(total, reached);
  return total <= reached;
}

void PacedSubscription::begin_counts(std::uint8_t number, std::uint64_t waiting) {
  number_ = number;
  sent_ = waiting;
  lost_ = credited_ = 0;
}

void PacedSubscription::pop_oldest() {
  GIMNET_ASSERT(held_ != 0);
  held_bytes_ -= ring_[first_].bytes();
  ring_[first_].clear();
  first_ = (first_ + 1) % ring_.size();
  --held_;
}

void PacedSubscription::push_newest(KeptMessage& message) {
  GIMNET_ASSERT(held_ < ring_.size());
  KeptMessage& place = ring_[(first_ + held_) % ring_.size()];
  std::swap(place, message);
  held_bytes_ += place.bytes();
  ++held_;
}

}  // namespace gimnet::hub
