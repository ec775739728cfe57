#include "client/gimi/subscribed_service.hpp"

#include <algorithm>
#include <utility>

#include "client/gimi/deadline.hpp"

namespace gimnet::gimi {

bool SubscribedService::exists() {
  const MutexLock lock(mutex_);
  return exists_;
}

bool SubscribedService::accepts() {
  const MutexLock lock(mutex_);
  return accepts_;
}

Outcome<void> SubscribedService::wait_until_exists(Timeout timeout) {
  const std::int64_t deadline = deadline_after(timeout);
  const MutexLock lock(mutex_);
  while (!exists_) {
    if (end_) return end_.failure("wait for " + *name_);
    if (is_over(deadline)) {
      return Failure{Status::timeout, accepts_ ? *name_ + " takes data and gives none; send to it"
                                               : "nobody provides " + *name_ + " yet"};
    }
    static_cast<void>(changed_.wait_until(mutex_, deadline));
  }
  return {};
}

std::uint64_t SubscribedService::missed() {
  const std::uint64_t overwritten = queue_.inbox().counts(queue_).overwritten;
  const MutexLock lock(mutex_);
  return missed_ + overwritten;
}

QueueOptions SubscribedService::queue_options() const {
  QueueOptions options = chosen_queue;
  if (options.messages == 0 && place.latest) options.messages = 1;
  return options;
}

Outcome<void> SubscribedService::standing() {
  const MutexLock lock(mutex_);
  if (end_) return end_.failure("subscribe " + *name_);
  if (!refusal_) return {};
  return Failure{
      refusal_->status,
      "cannot subscribe " + *name_ +
          ": the hub did not take the subscription again, after a break: " + refusal_->sentence};
}

bool SubscribedService::is_refused() {
  const MutexLock lock(mutex_);
  return refusal_.has_value();
}

bool SubscribedService::is_repeated(const Position& message) {
  const MutexLock lock(mutex_);
  return message.sequence != 0 && message.from == last_.from && message.epoch == last_.epoch &&
         message.sequence == last_.sequence;
}

SubscribedService::Stream* SubscribedService::find(const Position& message) {
  const auto found = std::ranges::find_if(streams_, [&message](const Stream& each) {
    return each.from == message.from && each.key == message.key;
  });
  return found == streams_.end() ? nullptr : &*found;
}

StreamEpochs::Step SubscribedService::look(const Position& message) {
  const MutexLock lock(mutex_);
  const Stream* stream = find(message);
  return stream == nullptr ? StreamEpochs::Step::first : stream->epochs.look(message.epoch);
}

void SubscribedService::on_message(const Position& message) {
  const MutexLock lock(mutex_);
  const auto step = static_cast<std::int32_t>(message.sequence - last_.sequence);
  // The first of a provider, or of an epoch, says where it stands.
  if (message.from == last_.from && message.epoch == last_.epoch && step > 0)
    missed_ += static_cast<std::uint32_t>(step - 1);
  last_ = message;
  Stream* stream = find(message);
  if (stream == nullptr) {
    if (streams_.size() == kProvidersMax) streams_.erase(streams_.begin());
    stream = &streams_.emplace_back(Stream{message.from, message.key, {}});
  }
  stream->epochs.take(message.epoch);
}

void SubscribedService::on_place(const ServicePlace& now) {
  const MutexLock lock(mutex_);
  exists_ = now.group != 0 && !now.accepts;
  accepts_ = now.group != 0 && now.accepts;
  refusal_.reset();
  changed_.notify_all();
}

void SubscribedService::on_refused(Failure refusal) {
  const MutexLock lock(mutex_);
  refusal_ = std::move(refusal);
}

void SubscribedService::end(const Ending& ending) {
  const MutexLock lock(mutex_);
  end_ = ending;
  changed_.notify_all();
}

}  // namespace gimnet::gimi
