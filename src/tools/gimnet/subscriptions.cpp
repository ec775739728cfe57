#include "tools/gimnet/subscriptions.hpp"

#include <algorithm>

#include "base/clock.hpp"
#include "base/ids.hpp"
#include "tools/gimnet/options.hpp"
#include "tools/gimnet/session.hpp"

namespace gimnet::tool {

bool wants_less(const SubscribeOptions& wish) {
  return wish.window != 0 || wish.depth > 1 || wish.rate_hz > 0.0;
}

Outcome<void> Subscriptions::open() {
  if (!is_pattern(word_)) {
    auto subscription = node_.subscribe(word_, wish_);
    if (!subscription) return subscription.failure();
    one_ = std::move(*subscription);
    return {};
  }
  follower_.emplace(node_, word_, wish_);
  if (auto done = follower_->open(); !done) return done;
  return !follower_->any() && wants_less(wish_) ? ask_terms() : Outcome<void>{};
}

/// Whether the hub takes the pace, before there is a service to which it could say no: by a
/// subscription that ends at once, of a service that nobody has.
Outcome<void> Subscriptions::ask_terms() {
  const auto subscription = node_.subscribe("gimnet-echo/terms", wish_);
  return subscription ? Outcome<void>{} : subscription.failure();
}

Outcome<Message> Subscriptions::receive(Timeout timeout) {
  const std::int64_t end_ns = steady_now_ns() + std::chrono::nanoseconds(timeout).count();
  for (;;) {
    const std::int64_t now_ns = steady_now_ns();
    const Timeout left{std::max<std::int64_t>((end_ns - now_ns) / 1'000'000, 0)};
    auto message = node_.receive(std::min(timeout, left));
    if (message && message->service().empty())
      continue;  // sent to this node by somebody who guessed its id
    if (!follower_ && !message && message.is(Status::timeout) && one_) {
      if (one_->accepts())
        return Failure{Status::not_found, word_ + " takes data and gives none; send to it"};
      if (const auto stands = one_->standing(); !stands) return stands.failure();
    }
    if (!follower_) return message;
    for (const std::string& sentence : follower_->news(now_ns)) say(sentence);
    if (message || !message.is(Status::timeout)) return message;
    // Messages that waited here came before.
    if (const auto failure = follower_->failure()) return *failure;
    return message;
  }
}

void Subscriptions::say_rest() {
  if (!follower_) return;
  for (const std::string& sentence : follower_->rest()) say(sentence);
}

std::map<std::string, std::uint64_t> Subscriptions::missed() const {
  if (follower_) return follower_->missed();
  return one_ ? std::map<std::string, std::uint64_t>{{word_, one_->missed()}}
              : std::map<std::string, std::uint64_t>{};
}

bool Subscriptions::take_lateness(std::string_view service) {
  return follower_ && follower_->take_lateness(service);
}

std::string Subscriptions::waits_for() const {
  if (follower_)
    return follower_->any() ? "" : "no service matches " + word_ + " yet; waiting for one";
  if (!one_ || one_->exists()) return "";
  return is_unreachable() ? "there is no way to the hub of " + word_ +
                                "; waiting for one; `gimnet hubs` shows it"
                          : "nobody provides " + word_ + " yet; waiting for it";
}

/// The hub lists services of another one as long as it keeps their nodes' names.
bool Subscriptions::is_unreachable() const {
  const auto services = node_.services(word_);
  if (!services || services->empty()) return false;
  const std::uint32_t hub_id = hub_of(NodeId{services->front().node.id}).value();
  if (hub_id == hub_of(NodeId{node_.peer().id}).value()) return false;
  const auto hubs = node_.hubs();
  if (!hubs) return false;
  const auto hub = std::ranges::find(*hubs, hub_id, &NetworkHub::hub_id);
  return hub != hubs->end() && !hub->reachable;
}

}  // namespace gimnet::tool
