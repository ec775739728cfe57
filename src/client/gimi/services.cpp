#include "client/gimi/services.hpp"

#include <algorithm>
#include <utility>

#include "client/gimi/ending.hpp"
#include "proto/gimi/request.hpp"

namespace gimnet::gimi {

Share Subscriber::share() const {
  // With one message in the queue and another one on its way the one in the queue never gets old.
  constexpr std::uint32_t kNewestWindow = 2;
  Share wanted{wish.window, std::max(1u, wish.depth), wish.rate_hz};
  if (wish.newest_only && wanted.window == 0) wanted.window = kNewestWindow;
  return wanted;
}

QueueTerms Subscriber::queue_terms(bool latest) const {
  if (wish.newest_only || (wish.queue == 0 && (latest || wish.rate_hz > 0.0)))
    return {{1, AtFullQueue::overwrite_oldest}};
  const bool any = wish.queue == 0 && wish.at_full == AtFullQueue::overwrite_oldest;
  return {{wish.queue, wish.at_full}, any};
}

SubscribedService::SharedSubscriber SubscribedService::add(const SubscribeOptions& wish) {
  const MutexLock lock(mutex_);
  auto subscriber = std::make_shared<Subscriber>(inbox_, wish, latest_);
  if (!subscribers_.empty()) subscriber->numbers.begin(subscribers_.front()->numbers.highest());
  subscribers_.push_back(subscriber);
  // The hub may begin before its answer is seen here.
  const double asked_hz = widest_share().rate_hz;
  hub_rate_hz_ = higher_bound(hub_rate_hz_.value_or(asked_hz), asked_hz);
  pace_queues();
  return subscriber;
}

void SubscribedService::remove(const Subscriber& subscriber) {
  const MutexLock lock(mutex_);
  std::erase_if(subscribers_,
                [&subscriber](const SharedSubscriber& each) { return each.get() == &subscriber; });
  if (subscribers_.empty()) last_ = counted_ = {};
}

bool SubscribedService::is_read() {
  const MutexLock lock(mutex_);
  return !subscribers_.empty();
}

Share SubscribedService::share() {
  const MutexLock lock(mutex_);
  return widest_share();
}

void SubscribedService::pace_queues() {
  const double of_hub = hub_rate_hz_.value_or(0.0);
  for (const SharedSubscriber& each : subscribers_) {
    const double wanted = each->wish.rate_hz;
    const bool kept_by_hub = higher_bound(of_hub, wanted) == wanted;
    inbox_.pace(each->queue, kept_by_hub ? 0.0 : wanted);
  }
}

Share SubscribedService::widest_share() const {
  std::optional<Share> widest;
  for (const SharedSubscriber& subscriber : subscribers_) {
    const Share one = subscriber->share();
    if (!widest) widest = one;
    widest->window = higher_bound(widest->window, one.window);
    widest->depth = std::max(widest->depth, one.depth);
    widest->rate_hz = higher_bound(widest->rate_hz, one.rate_hz);
  }
  return widest.value_or(Share{});
}

std::uint64_t SubscribedService::missed(const Subscriber& subscriber) {
  const MutexLock lock(mutex_);
  return subscriber.numbers.count();
}

std::uint64_t SubscribedService::missed_by(const Subscriber& subscriber) {
  const std::uint64_t overwritten = inbox_.counts(subscriber.queue).overwritten;
  return subscriber.wish.rate_hz == 0.0 ? overwritten + subscriber.numbers.count() : overwritten;
}

std::uint64_t SubscribedService::missed_in_all() {
  const MutexLock lock(mutex_);
  std::uint64_t sum = 0;
  for (const SharedSubscriber& each : subscribers_) sum += missed_by(*each);
  return sum;
}

std::string SubscribedService::news_of_missed() {
  const MutexLock lock(mutex_);
  std::uint64_t sum = 0;
  for (const SharedSubscriber& each : subscribers_) {
    const bool wants_all = !latest_ && !each->wish.newest_only && each->wish.rate_hz == 0.0;
    if (wants_all) sum += missed_by(*each);
  }
  if (sum <= std::exchange(missed_news_, sum)) return {};
  return name_->text + ": " + std::to_string(sum) + " messages were missed so far";
}

const char* SubscribedService::gives_none() {
  const MutexLock lock(mutex_);
  return reason();
}

const char* SubscribedService::reason() const {
  if (!accepts_) return nullptr;
  return answers_ ? "answers questions and gives no data; ask it by request()"
                  : "takes data and gives none; send to it";
}

Outcome<void> SubscribedService::wait_until_exists(Timeout timeout) {
  const std::int64_t deadline = deadline_after(timeout);
  const MutexLock lock(mutex_);
  while (!exists_) {
    if (end_) return end_.failure("wait for " + name_->text);
    if (is_over(deadline)) {
      const char* const why = reason();
      return Failure{Status::timeout, why != nullptr ? name_->text + " " + why
                                                     : "nobody provides " + name_->text + " yet"};
    }
    static_cast<void>(changed_.wait_until(mutex_, deadline));
  }
  return {};
}

Outcome<void> SubscribedService::standing() {
  const MutexLock lock(mutex_);
  if (end_) return end_.failure("subscribe " + name_->text);
  if (!refusal_) return {};
  return Failure{
      refusal_->status,
      "cannot subscribe " + name_->text +
          ": the hub did not take the subscription again, after a break: " + refusal_->sentence};
}

bool SubscribedService::is_refused() {
  const MutexLock lock(mutex_);
  return refusal_.has_value();
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

SubscribedService::Put SubscribedService::put(const std::optional<Position>& position,
                                              Message& message) {
  const MutexLock lock(mutex_);
  const bool repeated = position && position->sequence != 0 && *position == last_;
  // After a break, and for a subscriber more, the hub gives the last message of a retained service
  // again: it does not know who had it.
  const auto wants = [repeated](const SharedSubscriber& subscriber) {
    return !repeated || !subscriber->begun;
  };
  const auto wanted = std::ranges::count_if(subscribers_, wants);
  if (wanted == 0) return Put::unwanted;
  if (position && !repeated) count_missed(*position);
  bool kept = false;
  if (wanted == 1) {
    kept = inbox_.put((*std::ranges::find_if(subscribers_, wants))->queue, message, nullptr);
  } else {
    std::vector<MessageQueue*> queues;
    for (const SharedSubscriber& subscriber : subscribers_)
      if (wants(subscriber)) queues.push_back(&subscriber->queue);
    kept = inbox_.put_in_all(queues, message);
  }
  if (!kept) return Put::no_room;
  for (const SharedSubscriber& subscriber : subscribers_) subscriber->begun = true;
  if (position) take(*position);
  return Put::kept;
}

void SubscribedService::count_missed(const Position& message) {
  if (message == counted_) return;  // it found no room the last time
  counted_ = message;
  bool changed = false;
  for (const SharedSubscriber& each : subscribers_) {
    if (goes_on(message)) {
      changed |= each->numbers.take(message.sequence);
    } else {
      each->numbers.begin(message.sequence);
    }
  }
  if (changed) inbox_.note_missed();
}

void SubscribedService::miss(const Position& position) {
  const MutexLock lock(mutex_);
  const Stream* stream = find(position);
  const bool outdated =
      stream != nullptr && stream->epochs.look(position.epoch) == StreamEpochs::Step::former;
  if (outdated || subscribers_.empty()) return;
  bool changed = false;
  for (const SharedSubscriber& each : subscribers_) {
    if (!goes_on(position)) each->numbers.begin(position.sequence - 1);
    changed |= each->numbers.miss(position.sequence);
  }
  take(position);
  if (changed) inbox_.note_missed();
}

void SubscribedService::take(const Position& message) {
  // The hub gives the newest one again, also behind one that came late.
  const bool late =
      goes_on(message) && static_cast<std::int32_t>(message.sequence - last_.sequence) < 0;
  if (!late) last_ = message;
  Stream* stream = find(message);
  if (stream == nullptr) {
    if (streams_.size() == kProvidersMax) streams_.erase(streams_.begin());
    stream = &streams_.emplace_back(Stream{message.from, message.key, {}});
  }
  stream->epochs.take(message.epoch);
}

void SubscribedService::on_place(const ServicePlace& now) {
  const MutexLock lock(mutex_);
  exists_ = now.destination() != 0 && !now.accepts;
  accepts_ = now.destination() != 0 && now.accepts;
  answers_ = accepts_ && now.key.type == proto::gimi::kRequestType;
  if (now.group != 0 && std::exchange(latest_, now.latest) != now.latest) {
    for (const SharedSubscriber& subscriber : subscribers_)
      inbox_.set(subscriber->queue, subscriber->queue_terms(latest_));
  }
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
