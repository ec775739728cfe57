#include "tools/gimnet/service_follower.hpp"

#include <algorithm>
#include <utility>

#include "base/clock.hpp"
#include "tools/gimnet/advice.hpp"
#include "tools/gimnet/session.hpp"

namespace gimnet::tool {

std::optional<std::string> MatchingServices::take(const WatchEvent& event) {
  if (event.change == Change::snapshot_begins) {
    for (auto& [name, service] : services_) service.shown = false;
  } else if (event.change == Change::snapshot_ends) {
    on_snapshot_end();
  }
  if (!event.service) return std::nullopt;
  const std::string& name = event.service->name;
  if (event.change == Change::withdrawn) {
    const auto found = services_.find(name);
    if (found == services_.end() || !found->second.there) return std::nullopt;
    const bool late = found->second.late;
    on_gone(found);
    return late ? std::optional(name) : std::nullopt;
  }
  const bool is_there = event.change == Change::present || event.change == Change::advertised;
  if (is_there && event.service->direction == Direction::provides) on_there(name);
  return std::nullopt;
}

void MatchingServices::on_there(const std::string& name) {
  const auto [found, is_new] = services_.try_emplace(name);
  Service& service = found->second;
  service.shown = true;
  if (service.there) return;
  service.there = true;
  // One with a subscription, from the last time, is not late.
  service.late = complete_ && !service.settled;
  service.lateness = service.late;
  if (is_new) {
    wanted_.push_back(name);
  } else {
    std::erase(gone_, name);
  }
}

void MatchingServices::on_gone(Services::iterator found) {
  found->second.there = false;
  gone_.push_back(found->first);
}

void MatchingServices::on_snapshot_end() {
  for (auto service = services_.begin(); service != services_.end(); ++service) {
    if (service->second.there && !service->second.shown) on_gone(service);
  }
  complete_ = true;
}

void MatchingServices::settle(std::string_view name) {
  std::erase(wanted_, name);
  if (const auto found = services_.find(name); found != services_.end())
    found->second.settled = true;
}

void MatchingServices::forget(const std::string& name) {
  std::erase(wanted_, name);
  std::erase(gone_, name);
  services_.erase(name);
}

bool MatchingServices::take_lateness(std::string_view name) {
  const auto found = services_.find(name);
  return found != services_.end() && std::exchange(found->second.lateness, false);
}

void VanishedServices::judge(const Gone& gone) {
  if (!gone.is_silent()) return;
  if (count_ == 0) first_ = gone.name;
  ++count_;
}

void VanishedServices::on_there(const std::string& name) {
  for (const Gone& gone : waiting_) {
    if (gone.name == name) judge(gone);
  }
  std::erase_if(waiting_, [&](const Gone& gone) { return gone.name == name; });
}

std::vector<std::string> VanishedServices::news(std::int64_t now_ns) {
  while (!waiting_.empty() && waiting_.front().due_ns <= now_ns) {
    judge(waiting_.front());
    waiting_.pop_front();
  }
  if (count_ == 0 || !pace_.due(now_ns)) return {};
  const std::size_t others = std::exchange(count_, 0) - 1;
  const std::string who = others == 0 ? first_
                                      : first_ + " and " + std::to_string(others) +
                                            (others == 1 ? " other" : " others");
  return {who + " came and went, and nothing came of " + (others == 0 ? "it" : "them") +
          ": what is published before this node has heard of a service and subscribed to it passes "
          "it by "
          "(`gimnet pub --wait 1` waits for that)"};
}

std::vector<std::string> VanishedServices::rest() {
  for (const Gone& gone : waiting_) judge(gone);
  waiting_.clear();
  pace_ = {};
  return news(0);
}

namespace {

/// The wait before it asks again for what the hub has refused.
constexpr std::int64_t kRetryNs = 1'000'000'000;
/// The time between two looks whether the hub has its subscriptions still.
constexpr std::int64_t kLookNs = 500'000'000;

}  // namespace

ServiceFollower::~ServiceFollower() {
  if (!thread_.joinable()) return;
  node_.close();  // nothing else ends its waiting
  thread_.join();
}

Outcome<void> ServiceFollower::open() {
  auto watch = node_.watch(pattern_, {.nodes = false, .services = true}, wish_.timeout);
  if (!watch) return watch.failure();
  watch_ = std::move(*watch);
  const std::int64_t end_ns = steady_now_ns() + std::chrono::nanoseconds(wish_.timeout).count();
  for (bool complete = false; !complete;) {
    const std::int64_t left_ns = std::max<std::int64_t>(end_ns - steady_now_ns(), 0);
    const auto event = watch_->receive(Timeout{left_ns / 1'000'000});
    if (!event) return event.failure();
    complete = event->change == Change::snapshot_ends;
    take(*event);
  }
  // Whether the hub takes the terms shows at the first; as long as messages of it wait here, others
  // may wait, too.
  if (auto done = subscribe_next(wish_.timeout); !done) return done;
  thread_ = std::thread([this] { run(); });
  return {};
}

void ServiceFollower::run() {
  for (;;) {
    const auto event = watch_->receive(patience());
    if (event && event->change == Change::ended) {
      return fail({Status::refused, "the hub ended the watch: " + event->why});
    }
    if (event) {
      take(*event);
    } else if (!event.is(Status::timeout)) {
      return fail(event.failure());
    } else if (const auto done = subscribe_next(kForever); !done) {
      on_refusal(done.failure());
    }
  }
}

Timeout ServiceFollower::patience() const {
  const MutexLock lock(mutex_);
  const bool wants = matching_.wanted() != nullptr;
  if (!wants && !matching_.remembers_too_many()) return kForever;
  const std::int64_t left_ns =
      std::max<std::int64_t>((wants ? retry_ns_ : tidy_ns_) - steady_now_ns(), 0);
  return Timeout{(left_ns + 999'999) / 1'000'000};
}

void ServiceFollower::take(const WatchEvent& event) {
  const MutexLock lock(mutex_);
  if (event.service && event.change == Change::advertised) vanished_.on_there(event.service->name);
  auto gone = matching_.take(event);
  if (!gone) return;
  VanishedServices::IsSilent is_silent = [] { return true; };
  if (const auto found = subscriptions_.find(*gone); found != subscriptions_.end()) {
    is_silent = [queue = found->second.queue()] { return queue.received() == 0; };
  }
  vanished_.on_gone(std::move(*gone), std::move(is_silent), steady_now_ns());
}

Outcome<void> ServiceFollower::subscribe_next(Timeout timeout) {
  std::string name;
  {
    const MutexLock lock(mutex_);
    if (const std::string* wanted = matching_.wanted()) name = *wanted;
  }
  if (!name.empty()) {
    SubscribeOptions wish = wish_;
    wish.timeout = timeout;
    auto subscription = node_.subscribe(name, wish);
    if (!subscription) return subscription.failure();
    told_ = false;
    const MutexLock lock(mutex_);
    subscriptions_.insert_or_assign(name, std::move(*subscription));
    matching_.settle(name);
  }
  if (steady_now_ns() >= tidy_ns_ && remembers_too_many() && !let_one_go())
    tidy_ns_ = steady_now_ns() + kRetryNs;
  return {};
}

bool ServiceFollower::remembers_too_many() const {
  const MutexLock lock(mutex_);
  return matching_.remembers_too_many();
}

bool ServiceFollower::let_one_go() {
  std::optional<Subscription> ended;  // by its end, which the hub is told without the lock
  const MutexLock lock(mutex_);
  const std::string* oldest = matching_.oldest_gone();
  if (oldest == nullptr) return false;
  const auto found = subscriptions_.find(*oldest);
  if (found != subscriptions_.end()) {
    if (found->second.queue().size() != 0) return false;
    ended = std::move(found->second);
    subscriptions_.erase(found);
  }
  matching_.forget(std::string(*oldest));
  return true;
}

void ServiceFollower::on_refusal(const Failure& failure) {
  // Those that say that the node is closed or ended come from the watch as well.
  if (failure.status == Status::closed || node_.state().ended) {
    retry_ns_ = steady_now_ns() + kRetryNs;
    return;
  }
  if (failure.status == Status::limit && let_one_go()) return;
  const bool passes = failure.status == Status::limit || failure.status == Status::timeout ||
                      failure.status == Status::not_connected;
  if (passes) {
    retry_ns_ = steady_now_ns() + kRetryNs;
    if (failure.status == Status::limit && !std::exchange(told_, true)) {
      say(failure.sentence + "; without it and others that match, trying again once a second");
    }
    return;
  }
  say(in_commands(failure.sentence, "") + "; going on without it");
  const MutexLock lock(mutex_);
  if (const std::string* wanted = matching_.wanted()) matching_.settle(std::string(*wanted));
}

bool ServiceFollower::any() const {
  const MutexLock lock(mutex_);
  return matching_.any();
}

void ServiceFollower::fail(Failure failure) {
  const MutexLock lock(mutex_);
  failure_ = std::move(failure);
}

std::optional<Failure> ServiceFollower::failure() const {
  const MutexLock lock(mutex_);
  return failure_;
}

std::map<std::string, std::uint64_t> ServiceFollower::missed() const {
  const MutexLock lock(mutex_);
  std::map<std::string, std::uint64_t> counts;
  for (const auto& [name, subscription] : subscriptions_)
    counts.emplace(name, subscription.missed());
  return counts;
}

bool ServiceFollower::take_lateness(std::string_view name) {
  const MutexLock lock(mutex_);
  return matching_.take_lateness(name);
}

std::vector<std::string> ServiceFollower::news(std::int64_t now_ns) {
  const MutexLock lock(mutex_);
  std::vector<std::string> sentences;
  if (!vanished_.empty()) sentences = vanished_.news(now_ns);
  if (now_ns < look_ns_) return sentences;
  look_ns_ = now_ns + kLookNs;
  if (std::string words = refusal_news(); !words.empty()) sentences.push_back(std::move(words));
  return sentences;
}

std::string ServiceFollower::refusal_news() {
  if (node_.state().ended) return "";
  std::set<std::string> refused;
  std::string first;
  std::size_t others = 0;
  for (const auto& [name, subscription] : subscriptions_) {
    const auto stands = subscription.standing();
    if (stands || stands.is(Status::closed)) continue;
    refused.insert(name);
    if (refused_.contains(name)) continue;
    if (first.empty()) {
      first = stands.failure().sentence;
    } else {
      ++others;
    }
  }
  refused_ = std::move(refused);
  if (first.empty()) return "";
  if (others > 0) first += "; nor those of " + std::to_string(others) + " others that match";
  return first + "; going on without";
}

std::vector<std::string> ServiceFollower::rest() {
  const MutexLock lock(mutex_);
  return vanished_.rest();
}

}  // namespace gimnet::tool
