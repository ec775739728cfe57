#include "client/gimi/message_queue.hpp"

#include <algorithm>
#include <utility>

#include "base/check.hpp"
#include "client/gimi/ending.hpp"
#include "client/gimi/inbox.hpp"
#include "client/gimi/message.hpp"

namespace gimnet::gimi {

void MessageQueue::set(const QueueOptions& options) {
  options_ = options;
  options_.messages =
      options.messages == 0 ? kQueueMessagesDefault : std::min(options.messages, kQueueMessagesMax);
  make_room(options_.messages);
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
  make_room(options_.messages - 1);
  bytes_ += message.size();
  ++received_;
  if (silent_at_ns_ != INT64_MAX) expect(silence_);
  entries_.push_back({std::move(message), arrival});
}

std::optional<Message> MessageQueue::pop() {
  if (entries_.empty()) return std::nullopt;
  std::optional<Message> message(std::move(entries_.front().message));
  bytes_ -= message->size();
  entries_.pop_front();
  count_taken(*message);
  return message;
}

std::optional<Message> MessageQueue::pop_newest() {
  if (entries_.empty()) return std::nullopt;
  for (const Entry& entry : entries_) count_taken(entry.message);
  std::optional<Message> message(std::move(entries_.back().message));
  entries_.clear();
  bytes_ = 0;
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

void MessageQueue::make_room(std::size_t messages) {
  while (entries_.size() > messages) overwrite_oldest();
}

std::size_t MessageQueue::overwrite_oldest() {
  const std::size_t bytes = entries_.front().message.size();
  bytes_ -= bytes;
  count_taken(entries_.front().message);
  entries_.pop_front();
  ++overwritten_;
  inbox_.note_missed();
  return bytes;
}

}  // namespace gimnet::gimi
