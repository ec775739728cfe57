#include "client/gimi/message_queue.hpp"

#include <algorithm>
#include <utility>

#include "base/check.hpp"
#include "client/gimi/ending.hpp"
#include "client/gimi/inbox.hpp"
#include "client/gimi/message.hpp"

namespace gimnet::gimi {

void MessageQueue::set(const QueueTerms& terms) {
  options_ = terms.options;
  options_.messages = options_.messages == 0 ? kQueueMessagesDefault
                                             : std::min(options_.messages, kQueueMessagesMax);
  grows_ = terms.grows;
  make_room(options_.messages, 0);
}

void MessageQueue::allow(std::size_t cost_bytes_max) {
  cost_bytes_max_ = cost_bytes_max;
  make_room(options_.messages, 0);
}

std::size_t MessageQueue::cost_of(const Message& message, const Message* neighbour) {
  const std::size_t own = message.size() + kPlaceBytes;
  const auto* const storage = static_cast<const nif::Storage*>(message.c_message().storage);
  if (storage == nullptr) return own;
  if (neighbour != nullptr && neighbour->c_message().storage == storage) return own;
  return own + storage->shared_bytes();
}

bool MessageQueue::is_full() const {
  if (options_.at_full != AtFullQueue::stop_reading || entries_.empty()) return false;
  return entries_.size() >= options_.messages || bytes_ >= bytes_max_;
}

void MessageQueue::pace(std::int64_t period_ns, std::int64_t now_ns) {
  // The first of a paced one comes at once; otherwise the last one may just have come.
  if (period_ns_ == 0 && received_ != 0) due_ns_ = now_ns + period_ns;
  period_ns_ = period_ns;
}

void MessageQueue::hold(Message message) {
  if (held_) ++left_out_;
  drop_held();
  held_ = std::move(message);
}

void MessageQueue::drop_held() {
  if (held_) count_taken(*held_);
  held_.reset();
}

std::optional<Message> MessageQueue::take_due(std::int64_t now_ns) {
  if (now_ns < due_ns()) return std::nullopt;
  // Due times keep their distance, whenever a thread looks at them.
  const bool in_step = now_ns - due_ns_ < period_ns_;
  due_ns_ = (in_step ? due_ns_ : now_ns) + period_ns_;
  return std::exchange(held_, std::nullopt);
}

void MessageQueue::expect(Timeout silence) {
  silence_ = silence;
  silent_at_ns_ = silence == Timeout{0} ? INT64_MAX : deadline_after(silence);
}

bool MessageQueue::tells_silence() {
  if (!is_over(silent_at_ns_)) return false;
  expect(silence_);
  return true;
}

void MessageQueue::push(Message message, std::uint64_t arrival) {
  GIMNET_ASSERT(!refuses());
  const std::size_t cost = cost_of(message, entries_.empty() ? nullptr : &entries_.back().message);
  make_room(options_.messages - 1, cost);
  bytes_ += message.size();
  cost_bytes_ += cost;
  ++received_;
  if (silent_at_ns_ != INT64_MAX) expect(silence_);
  entries_.push_back({std::move(message), arrival});
}

std::optional<Message> MessageQueue::pop() {
  if (entries_.empty()) return std::nullopt;
  count_taken(entries_.front().message);
  leave_first();
  std::optional<Message> message(std::move(entries_.front().message));
  entries_.pop_front();
  return message;
}

std::optional<Message> MessageQueue::pop_newest() {
  if (entries_.empty()) return std::nullopt;
  for (const Entry& entry : entries_) count_taken(entry.message);
  std::optional<Message> message(std::move(entries_.back().message));
  entries_.clear();
  bytes_ = cost_bytes_ = 0;
  return message;
}

void MessageQueue::count_taken(const Message& message) {
  const std::uint32_t epoch = epoch_of(message);
  if (epoch == 0) return;
  const std::uint32_t group = group_of(message);
  if (taken_.empty() || taken_.back().group != group || taken_.back().epoch != epoch) {
    taken_.push_back({group, epoch, 0});
  }
  ++taken_.back().count;
}

void MessageQueue::make_room(std::size_t messages, std::size_t more_bytes) {
  while (entries_.size() > messages && !(grows_ && cost_bytes_ + more_bytes <= cost_bytes_max_))
    overwrite_oldest();
}

/// The next one in the same slab goes on to keep that.
void MessageQueue::leave_first() {
  const Message& first = entries_.front().message;
  bytes_ -= first.size();
  cost_bytes_ -= cost_of(first, entries_.size() > 1 ? &entries_[1].message : nullptr);
}

std::size_t MessageQueue::overwrite_oldest() {
  const std::size_t bytes = entries_.front().message.size();
  count_taken(entries_.front().message);
  leave_first();
  entries_.pop_front();
  ++overwritten_;
  inbox_.note_missed();
  return bytes;
}

}  // namespace gimnet::gimi
