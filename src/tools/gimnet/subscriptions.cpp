#include "tools/gimnet/subscriptions.hpp"

#include <algorithm>
#include <set>

#include "base/clock.hpp"

namespace gimnet::tool {
namespace {

/// Messages of one service that wait in this process; then it stops reading from the hub.
constexpr std::size_t kQueueMessages = 4096;
/// How long subscribing may take.
constexpr Timeout kSubscribe{5'000};
/// How often the hub is asked for services that are new.
constexpr Timeout kLookAgain{1'000};

}  // namespace

bool wants_less(const PaceOptions& pace) {
  return pace.window != 0 || pace.depth != PaceOptions{}.depth || pace.rate_hz > 0.0;
}

Outcome<void> Subscriptions::open() {
  if (!is_pattern(word_)) return subscribe(word_);
  if (auto done = look_again(); !done) return done;
  return all_.empty() && wants_less(pace_) ? ask_terms() : Outcome<void>{};
}

/// Whether the hub takes the pace, before there is a service to which it could say no: by a subscription that ends at
/// once, of a service that nobody has.
Outcome<void> Subscriptions::ask_terms() {
  auto subscription = node_.subscribe("gimnet-echo/terms", {1, AtFullQueue::stop_reading}, kSubscribe, pace_);
  return subscription ? Outcome<void>{} : subscription.failure();
}

Outcome<void> Subscriptions::subscribe(const std::string& service) {
  auto subscription = node_.subscribe(service, {kQueueMessages, AtFullQueue::stop_reading}, kSubscribe, pace_);
  if (!subscription) return subscription.failure();
  all_.insert_or_assign(service, std::move(*subscription));
  return {};
}

Outcome<void> Subscriptions::look_again() {
  looked_ns_ = steady_now_ns();
  const auto services = node_.services(word_);
  if (!services) return services.failure();
  std::set<std::string_view> there;
  for (const ServiceRecord& service : *services) {
    if (service.direction != Direction::provides) continue;
    there.insert(service.name);
    if (all_.contains(service.name)) continue;
    if (auto done = subscribe(service.name); !done) return done;
  }
  // What still waits of a service that is gone is taken before its subscription ends.
  std::erase_if(all_, [&](const auto& one) { return !there.contains(one.first) && one.second.queue().size() == 0; });
  return {};
}

Outcome<Message> Subscriptions::receive(Timeout timeout) {
  const std::int64_t end_ns = steady_now_ns() + timeout.count() * 1'000'000;
  for (;;) {
    Timeout wait = timeout;
    if (is_pattern(word_)) {
      const std::int64_t next_ns = looked_ns_ + kLookAgain.count() * 1'000'000;
      if (steady_now_ns() >= next_ns) {
        // Without a connection what waits here still comes; if none will come any more, the end comes behind it.
        const auto done = look_again();
        if (!done && !done.is(Status::not_connected) && !done.is(Status::refused)) return done.failure();
      }
      wait = std::min(timeout, kLookAgain);
    }
    auto message = node_.receive(wait);
    if (message && message->service().empty()) continue;  // sent to this node by somebody who guessed its id
    if (message || !message.is(Status::timeout)) return message;
    if (steady_now_ns() >= end_ns) return message;
  }
}

std::string Subscriptions::waits_for() const {
  if (is_pattern(word_)) return all_.empty() ? "no service matches " + word_ + " yet; waiting for one" : "";
  const auto found = all_.find(word_);
  return found == all_.end() || found->second.exists() ? "" : "nobody provides " + word_ + " yet; waiting for it";
}

}  // namespace gimnet::tool
