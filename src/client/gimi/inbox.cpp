#include "client/gimi/inbox.hpp"

#include <algorithm>
#include <utility>

#include "client/gimi/ending.hpp"
#include "client/gimi/message.hpp"

namespace gimnet::gimi {
namespace {

/// Later than any due time, and far from an overflow.
constexpr std::int64_t kAnyTimeNs = INT64_MAX / 2;

Failure none(Timeout timeout) {
  return {Status::timeout,
          "nothing was received within " + std::to_string(timeout.count()) + " ms"};
}

}  // namespace

MessageQueue& Inbox::queue(MessageKey key, const QueueOptions* options) {
  MessageQueue* found = nullptr;
  News news;
  {
    const MutexLock lock(mutex_);
    const auto place = by_key_.find(key);
    if (place != by_key_.end()) {
      found = place->second;
      std::erase(unasked_, found);
      if (options != nullptr) found->set({*options});
      news = news_of(*found);
    } else {
      const QueueOptions unasked{unasked_messages_, AtFullQueue::overwrite_oldest};
      found = &queues_.emplace_back(*this, QueueTerms{options != nullptr ? *options : unasked},
                                    bytes_max_);
      by_key_.emplace(key, found);
    }
  }
  tell(news);
  return *found;
}

MessageQueue& Inbox::add_queue(const QueueTerms& terms, Timeout silence) {
  const MutexLock lock(mutex_);
  MessageQueue& queue = queues_.emplace_back(*this, terms, bytes_max_);
  queue.expect(silence);
  growing_.look_at(queue);
  return queue;
}

void Inbox::pace(MessageQueue& queue, double rate_hz) {
  const MutexLock lock(mutex_);
  std::erase(paced_, &queue);
  queue.pace(rate_hz == 0.0 ? 0 : static_cast<std::int64_t>(1e9 / rate_hz), steady_now_ns());
  if (queue.is_paced()) paced_.push_back(&queue);
}

void Inbox::remove(MessageQueue& queue) {
  News news;
  {
    const MutexLock lock(mutex_);
    std::erase(paced_, &queue);
    growing_.leave(queue);
    queue.drop_held();
    static_cast<void>(queue.pop_newest());
    news = {refusing_ == &queue, false, queue.take_taken()};
    if (news.room) refusing_ = nullptr;
    if (queue.counted) count(queue, false);
    queues_.remove_if([&queue](const MessageQueue& each) { return &each == &queue; });
  }
  tell(news);
}

std::size_t Inbox::queues() {
  const MutexLock lock(mutex_);
  return queues_.size();
}

bool Inbox::push(MessageQueue& queue, Message& message, Receipt* receipt) {
  if (queue.refuses()) {
    refusing_ = &queue;
    return false;
  }
  if (queue.is_paced()) {
    const std::int64_t now = steady_now_ns();
    give_due(queue, now);
    queue.hold(std::move(message));
    give_due(queue, now);
    set_due();
  } else {
    push_now(queue, std::move(message));
  }
  if (receipt != nullptr) receipt->on_kept();
  return true;
}

void Inbox::push_now(MessageQueue& queue, Message message) {
  queue.push(std::move(message), ++arrivals_);
  recount(queue);
  queue.filled().notify_one();
  if (any_waiters_ != 0) any_.notify_one();
}

void Inbox::give_due(MessageQueue& queue, std::int64_t now_ns) {
  if (auto due = queue.take_due(now_ns)) push_now(queue, std::move(*due));
}

void Inbox::set_due() {
  std::int64_t next = INT64_MAX;
  for (const MessageQueue* queue : paced_) next = std::min(next, queue->due_ns());
  // relaxed: see due_ns()
  if (next < due_ns_.exchange(next, std::memory_order_relaxed) && missing_.begin) missing_.begin();
}

bool Inbox::put(MessageQueue& queue, Message& message, Receipt* receipt) {
  News news;
  {
    const MutexLock lock(mutex_);
    if (!push(queue, message, receipt)) return false;
    news.taken = queue.take_taken();
  }
  tell(news);
  return true;
}

bool Inbox::put_in_all(std::span<MessageQueue* const> queues, Message& message) {
  News news;
  {
    const MutexLock lock(mutex_);
    for (MessageQueue* queue : queues) {
      if (!queue->refuses()) continue;
      refusing_ = queue;
      return false;
    }
    if (epoch_of(message) != 0) news.taken.push_back({group_of(message), epoch_of(message), 1});
    message = without_count(std::move(message));
    for (MessageQueue* queue : queues) {
      Message one = queue == queues.back() ? std::move(message) : share(message);
      static_cast<void>(push(*queue, one, nullptr));  // as asked before
      const auto overwritten = queue->take_taken();
      news.taken.insert(news.taken.end(), overwritten.begin(), overwritten.end());
    }
  }
  tell(news);
  return true;
}

bool Inbox::put(MessageKey key, Message& message, Receipt* receipt) {
  const MutexLock lock(mutex_);
  const auto place = by_key_.find(key);
  if (place != by_key_.end()) {
    if (!push(*place->second, message, receipt)) return false;
    bound_unasked();
    return true;
  }
  if (unasked_.size() == kUnaskedKeysMax) forget_unasked();
  MessageQueue& queue = queues_.emplace_back(
      *this, QueueTerms{{unasked_messages_, AtFullQueue::overwrite_oldest}}, bytes_max_);
  by_key_.emplace(key, &queue);
  unasked_.push_back(&queue);
  static_cast<void>(push(queue, message, receipt));  // it refuses nothing
  bound_unasked();
  return true;
}

void Inbox::forget_unasked() {
  const auto goes = std::ranges::min_element(unasked_, {}, [](const MessageQueue* queue) {
    return queue->empty() ? 0 : queue->first_arrival();
  });
  MessageQueue* const queue = *goes;
  unasked_.erase(goes);
  dropped_ += queue->size();
  if (queue->counted) count(*queue, false);
  std::erase_if(by_key_, [queue](const auto& each) { return each.second == queue; });
  queues_.remove_if([queue](const MessageQueue& each) { return &each == queue; });
}

void Inbox::bound_unasked() {
  std::size_t bytes = 0;
  for (const MessageQueue* queue : unasked_) bytes += queue->bytes();
  while (bytes > kUnaskedBytesMax) {
    MessageQueue* oldest = nullptr;
    for (MessageQueue* queue : unasked_) {
      if (queue->empty() || queue->first_arrival() == arrivals_) continue;
      if (oldest == nullptr || queue->first_arrival() < oldest->first_arrival()) oldest = queue;
    }
    if (oldest == nullptr) return;
    bytes -= oldest->overwrite_oldest();
    recount(*oldest);
  }
}

void Inbox::count_dropped() {
  const MutexLock lock(mutex_);
  ++dropped_;
}

std::uint64_t Inbox::dropped() {
  const MutexLock lock(mutex_);
  return dropped_;
}

void Inbox::count(MessageQueue& queue, bool filled) {
  queue.counted = filled;
  if (filled) {
    ++filled_;
  } else {
    --filled_;
  }
  const bool has_ended{end_};
  queue.source().update(filled || has_ended);
  any_source_.update(filled_ != 0 || has_ended);
}

bool Inbox::visit(MessageQueue& queue, const SourceVisitor& visitor) {
  const MutexLock lock(mutex_);
  visitor(queue.source(), !queue.empty() || end_);
  return queue.silent_at_ns() != INT64_MAX && queue.source().is_member();
}

bool Inbox::tick() {
  bool more = false;
  bool tells = false;
  {
    const MutexLock lock(mutex_);
    more = look_at_silence() && !end_;
    if (is_over(due_ns())) {
      const std::int64_t now = steady_now_ns();
      for (MessageQueue* queue : paced_) give_due(*queue, now);
      set_due();
    }
    // relaxed: see note_missed()
    if (missed_.load(std::memory_order_relaxed)) {
      tells = is_over(missed_due_ns_);
      more = more || (!tells && !end_);
    }
    if (tells) {
      missed_due_ns_ = deadline_after(kMissedPeriod);
      missed_.store(false, std::memory_order_relaxed);  // see note_missed()
    }
  }
  if (tells) missing_.tell();
  return more;
}

bool Inbox::look_at_silence() {
  bool more = false;
  for (MessageQueue& queue : queues_) {
    if (queue.silent_at_ns() == INT64_MAX || !queue.source().is_member()) continue;
    more = true;
    if (is_over(queue.silent_at_ns())) queue.source().update(true);
  }
  return more;
}

void Inbox::visit_any(const SourceVisitor& visitor) {
  const MutexLock lock(mutex_);
  visitor(any_source_, filled_ != 0 || end_);
}

Inbox::News Inbox::news_of(MessageQueue& queue) {
  if (queue.is_paced()) {
    // It had no room. After the end nobody looks again when it is due.
    give_due(queue, end_ ? kAnyTimeNs : steady_now_ns());
    set_due();
  }
  recount(queue);
  return {is_room_wanted(queue), !queue.empty(), queue.take_taken()};
}

void Inbox::tell(const News& news) const {
  if (news.room) on_room_();
  if (!on_taken_) return;
  for (const TakenMessages& taken : news.taken) on_taken_(taken, news.more);
}

bool Inbox::is_room_wanted(const MessageQueue& queue) {
  if (refusing_ != &queue || queue.refuses() || !queue.wants_more()) return false;
  refusing_ = nullptr;
  return true;
}

void Inbox::leave(MessageQueue& queue, std::atomic<bool>& left) {
  const MutexLock lock(mutex_);
  left = true;
  queue.filled().notify_all();
}

Outcome<Message> Inbox::receive(MessageQueue& queue, Timeout timeout,
                                const std::atomic<bool>* left) {
  const std::int64_t deadline = deadline_after(timeout);
  std::optional<Message> message;
  News news;
  {
    const MutexLock lock(mutex_);
    while (queue.empty()) {
      if (end_) return end_.failure("receive");
      if (left != nullptr && *left) return Failure{Status::closed, "the handle was closed"};
      if (queue.tells_silence()) {
        queue.source().update(false);
        return Failure{Status::silence,
                       "nothing came for " + std::to_string(queue.silence_ms()) + " ms"};
      }
      if (is_over(deadline)) return none(timeout);
      static_cast<void>(
          queue.filled().wait_until(mutex_, std::min(deadline, queue.silent_at_ns())));
    }
    message = queue.pop();
    news = news_of(queue);
  }
  tell(news);
  return std::move(*message);
}

MessageQueue* Inbox::first_waiting() {
  MessageQueue* first = nullptr;
  for (MessageQueue& queue : queues_) {
    if (!queue.empty() && (first == nullptr || queue.first_arrival() < first->first_arrival()))
      first = &queue;
  }
  return first;
}

Outcome<Message> Inbox::receive_any(Timeout timeout) {
  const std::int64_t deadline = deadline_after(timeout);
  std::optional<Message> message;
  News news;
  {
    const MutexLock lock(mutex_);
    MessageQueue* queue = nullptr;
    while ((queue = first_waiting()) == nullptr) {
      if (end_) return end_.failure("receive");
      if (is_over(deadline)) return none(timeout);
      ++any_waiters_;
      static_cast<void>(any_.wait_until(mutex_, deadline));
      --any_waiters_;
    }
    message = queue->pop();
    news = news_of(*queue);
  }
  tell(news);
  return std::move(*message);
}

std::optional<Message> Inbox::take(MessageQueue& queue, bool newest) {
  std::optional<Message> message;
  News news;
  {
    const MutexLock lock(mutex_);
    message = newest ? queue.pop_newest() : queue.pop();
    news = news_of(queue);
  }
  tell(news);
  return message;
}

void Inbox::set(MessageQueue& queue, const QueueTerms& terms) {
  News news;
  {
    const MutexLock lock(mutex_);
    queue.set(terms);
    growing_.look_at(queue);
    news = news_of(queue);
  }
  tell(news);
}

void Inbox::resize(MessageQueue& queue, std::size_t messages) {
  News news;
  {
    const MutexLock lock(mutex_);
    queue.resize(messages);
    growing_.look_at(queue);
    news = news_of(queue);
  }
  tell(news);
}

Inbox::Counts Inbox::counts(MessageQueue& queue) {
  const MutexLock lock(mutex_);
  return {queue.size(), queue.received(), queue.overwritten(), queue.left_out()};
}

void Inbox::end(const Ending& ending) {
  const MutexLock lock(mutex_);
  end_ = ending;
  for (MessageQueue* queue : paced_) give_due(*queue, kAnyTimeNs);
  any_.notify_all();
  any_source_.update(true);
  for (MessageQueue& queue : queues_) {
    queue.filled().notify_all();
    queue.source().update(true);
  }
}

}  // namespace gimnet::gimi
