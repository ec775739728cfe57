#include "client/gimi/published_service.hpp"

#include <utility>

namespace gimnet::gimi {

Outcome<void> PublishedService::publish(BytesView data, Timeout timeout, More more) {
  const std::int64_t deadline = deadline_after(timeout);
  // Not while the hub is away: when it is back there are newer ones.
  Envelope envelope{0,
                    NIF_GROUP,
                    NIF_POLICY_DEFAULT,
                    options_.lane,
                    options_.key,
                    options_.age_ms_max,
                    NIF_FLAG_NOT_WHILE_AWAY};
  if (options_.delivery == Delivery::latest) envelope.policy = NIF_LATEST;
  if (more == More::yes) envelope.flags |= NIF_FLAG_MORE;
  std::uint32_t sequence = 0;
  {
    const MutexLock lock(mutex_);
    while (sending_ && !end_) {
      if (is_over(deadline)) {
        return Failure{Status::timeout,
                       "not published by " + full_name_ +
                           ": another thread published there for all of the time given"};
      }
      static_cast<void>(changed_.wait_until(mutex_, deadline));
    }
    if (end_) return end_.failure("publish " + full_name_);
    if (group_ == 0) {
      return Failure{Status::refused, refusal("publish").sentence};
    }
    sequence = ++sequence_;
    if (subscribers_ == 0 && subscribers_known_ && !options_.retain) {
      ++published_;
      return {};
    }
    envelope.to = group_;
    not_retained_.reset();  // what is said from now on is about this message
    sending_ = true;
  }
  const nif_status status =
      uplink_.transmit(envelope, {sequence, proto::gimi::MessageOperation::data, 0, 0, epoch_},
                       options_.timestamp, data, nif_timeout_until(deadline));
  const bool sent = status == NIF_OK || status == NIF_NOT_RETAINED;
  Failure failure;
  if (status == NIF_NOT_RETAINED) {
    failure = {Status::not_retained, full_name() + " was published, but: " + nif_error_text()};
  } else if (!sent) {
    failure = failure_of(status, "publish " + full_name());
  }
  if (!sent) uplink_.note_unsent(status, AtTimeout::give_up);
  const MutexLock lock(mutex_);
  sending_ = false;
  changed_.notify_all();
  if (sent) ++published_;
  if (!sent) --sequence_;  // subscribers would count it as missed, and it may be published again
  if (status == NIF_NOT_CONNECTED) ++unsent_;
  if (status == NIF_OK) return {};
  if (sent) not_retained_ = failure;
  return failure;
}

Outcome<void> PublishedService::retained() {
  const MutexLock lock(mutex_);
  if (end_) return end_.failure("keep " + full_name_);
  if (not_retained_) return *not_retained_;
  return {};
}

void PublishedService::on_not_retained(const std::optional<proto::gimi::MessageHeader>& sent) {
  const MutexLock lock(mutex_);
  const bool of_the_last = !sent || (sent->epoch == epoch_ && sent->sequence == sequence_);
  if (!of_the_last || not_retained_) return;
  not_retained_ = {Status::not_retained,
                   "the hub does not keep the last message of " + full_name_ +
                       " for those who subscribe later: its memory for such messages is used up; "
                       "raise its limit retained_budget_bytes, of which one node has half"};
}

std::string PublishedService::full_name() {
  const MutexLock lock(mutex_);
  return full_name_;
}

std::size_t PublishedService::subscribers() {
  const MutexLock lock(mutex_);
  return subscribers_;
}

Outcome<void> PublishedService::wait_for_subscribers(std::size_t count, Timeout timeout) {
  const std::int64_t deadline = deadline_after(timeout);
  const MutexLock lock(mutex_);
  while (end_ || subscribers_ < count) {
    if (end_) return end_.failure("wait for subscribers of " + full_name_);
    if (is_over(deadline)) {
      return Failure{Status::timeout, full_name_ + " has " + std::to_string(subscribers_) +
                                          " subscribers, not " + std::to_string(count)};
    }
    static_cast<void>(changed_.wait_until(mutex_, deadline));
  }
  return {};
}

Outcome<std::size_t> PublishedService::subscribers_changed(Timeout timeout) {
  const std::int64_t deadline = deadline_after(timeout);
  const MutexLock lock(mutex_);
  while (!has_news()) {
    if (is_over(deadline)) {
      return Failure{Status::timeout,
                     full_name_ + " still has " + std::to_string(subscribers_) + " subscribers"};
    }
    static_cast<void>(changed_.wait_until(mutex_, deadline));
  }
  if (end_) return end_.failure("wait for subscribers of " + full_name_);
  told_subscribers_ = subscribers_;
  source_.update(false);
  return subscribers_;
}

void PublishedService::visit(const SourceVisitor& visitor) {
  const MutexLock lock(mutex_);
  visitor(source_, has_news());
}

std::uint64_t PublishedService::published() {
  const MutexLock lock(mutex_);
  return published_;
}

std::uint64_t PublishedService::unsent() {
  const MutexLock lock(mutex_);
  return unsent_;
}

Outcome<void> PublishedService::standing() {
  const MutexLock lock(mutex_);
  if (end_) return end_.failure("provide " + full_name_);
  if (group_ == 0) return refusal("provide");
  return {};
}

Failure PublishedService::refusal(std::string_view doing) const {
  std::string sentence = "cannot " + std::string(doing) + " " + full_name_ +
                         ": the hub did not take the service again, after a break or another name";
  if (!refusal_.sentence.empty()) sentence += ": " + refusal_.sentence;
  return {refusal_.status, std::move(sentence)};
}

std::uint32_t PublishedService::group() {
  const MutexLock lock(mutex_);
  return group_;
}

void PublishedService::on_group(std::uint32_t group) {
  const MutexLock lock(mutex_);
  group_ = group;
  refusal_ = {Status::refused, ""};
}

void PublishedService::on_refused(Failure refusal) {
  const MutexLock lock(mutex_);
  refusal_ = std::move(refusal);
}

void PublishedService::on_subscribers(std::size_t count) {
  const MutexLock lock(mutex_);
  subscribers_ = count;
  subscribers_known_ = true;
  changed_.notify_all();
  source_.update(has_news());
}

void PublishedService::on_renamed(const std::string& own_name) {
  const MutexLock lock(mutex_);
  full_name_ = own_name.empty() ? name_ : own_name + "/" + name_;
}

void PublishedService::on_reconnected() {
  const MutexLock lock(mutex_);
  subscribers_known_ = false;
}

void PublishedService::end(const Ending& ending) {
  const MutexLock lock(mutex_);
  end_ = ending;
  changed_.notify_all();
  source_.update(true);
}

}  // namespace gimnet::gimi
