#include "hub/control/link_dialler.hpp"

#include <system_error>

#include "base/clock.hpp"
#include "base/signals_blocked.hpp"

namespace gimnet::hub {

LinkDialler::~LinkDialler() {
  cancel_.raise();
  for (Attempt& attempt : attempts_) attempt.thread.join();
}

void LinkDialler::dial(LinkNumber link, const DialledLink& to, const proto::Hello& hello,
                       const net::SocketOptions& options) {
  net::DialOptions how{options, std::nullopt};
  if (!to.proxy.empty()) {
    const Result<net::ProxyAddress> proxy = net::parse_proxy(to.proxy);
    // Never past a proxy that somebody asked for.
    if (!proxy) return end(link, net::NetError(net::Fault::bad_address, proxy.error().sentence));
    how.proxy = *proxy;
  }
  Attempt& attempt = attempts_.emplace_back();
  attempt.link = link;
  try {
    const SignalsBlocked blocked;  // The conductor alone takes signals.
    attempt.thread = std::thread([this, &attempt, address = to.address, hello, how] {
      note(attempt, net::dial_hub(address, how, hello, steady_now_ns() + kAttemptNs, cancel_));
    });
  } catch (const std::system_error& error) {
    attempts_.pop_back();
    end(link, net::NetError(net::Fault::no_memory,
                            std::string{"no thread to dial with: "} + error.what()));
  }
}

void LinkDialler::end(LinkNumber link, Outcome outcome) {
  {
    const std::lock_guard lock(mutex_);
    ended_.emplace_back(link, std::move(outcome));
  }
  waker_.wake();
}

void LinkDialler::note(Attempt& attempt, Outcome outcome) {
  // First, so that who is woken joins this thread.
  attempt.ended.store(true, std::memory_order_release);  // pairs with the acquire in take_ended()
  end(attempt.link, std::move(outcome));
}

std::vector<std::pair<LinkNumber, LinkDialler::Outcome>> LinkDialler::take_ended() {
  for (auto attempt = attempts_.begin(); attempt != attempts_.end();) {
    // acquire pairs with the release in note()
    if (!attempt->ended.load(std::memory_order_acquire)) {
      ++attempt;
      continue;
    }
    attempt->thread.join();
    attempt = attempts_.erase(attempt);
  }
  const std::lock_guard lock(mutex_);
  return std::exchange(ended_, {});
}

}  // namespace gimnet::hub
