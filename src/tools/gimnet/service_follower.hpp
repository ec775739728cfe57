#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "base/mutex.hpp"
#include "gimnet/gimi.hpp"
#include "tools/gimnet/matching_services.hpp"
#include "tools/gimnet/vanished_services.hpp"

namespace gimnet::tool {

/// Messages of one service that wait in this process; then it stops reading from the hub.
inline constexpr std::size_t kQueueMessages = 4096;
/// How long subscribing may take.
inline constexpr Timeout kSubscribe{5'000};

/// Subscribes to all services that match a pattern, to those that come later as soon as the hub
/// tells of them. It has a thread of its own for that, since whoever waits for messages cannot wait
/// for news, too. Says on standard error what it cannot subscribe to, and goes on. Memory: what
/// MatchingServices remembers. Thread safety: one thread.
class ServiceFollower {
 public:
  /// `node` must outlive it, and is closed with it.
  ServiceFollower(Node& node, std::string pattern, const PaceOptions& pace)
      : node_(node), pattern_(std::move(pattern)), pace_(pace) {}
  ~ServiceFollower();
  ServiceFollower(const ServiceFollower&) = delete;
  ServiceFollower& operator=(const ServiceFollower&) = delete;

  /// Learns which services are there, and subscribes to the first of them; to the others meanwhile.
  /// Errors: as Node::watch() and Node::subscribe(). Once.
  [[nodiscard]] Outcome<void> open() GIMNET_EXCLUDES(mutex_);
  /// Is a service there?
  [[nodiscard]] bool any() const GIMNET_EXCLUDES(mutex_);
  /// Why it takes in no more services.
  [[nodiscard]] std::optional<Failure> failure() const GIMNET_EXCLUDES(mutex_);

  /// Of all subscriptions, by full name: how many messages were missed.
  [[nodiscard]] std::map<std::string, std::uint64_t> missed() const GIMNET_EXCLUDES(mutex_);
  /// As MatchingServices::take_lateness().
  [[nodiscard]] bool take_lateness(std::string_view name) GIMNET_EXCLUDES(mutex_);
  /// As VanishedServices::news() and rest(); news() also of subscriptions that the hub did not take
  /// again after a break.
  [[nodiscard]] std::vector<std::string> news(std::int64_t now_ns) GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] std::vector<std::string> rest() GIMNET_EXCLUDES(mutex_);

 private:
  using Subscriptions = std::map<std::string, Subscription, std::less<>>;

  void run() GIMNET_EXCLUDES(mutex_);
  void take(const WatchEvent& event) GIMNET_EXCLUDES(mutex_);
  void fail(Failure failure) GIMNET_EXCLUDES(mutex_);
  /// How long there is nothing to do but to wait for news.
  [[nodiscard]] Timeout patience() const GIMNET_EXCLUDES(mutex_);
  /// One that is wanted, if any. Errors: as Node::subscribe(); it is wanted still.
  [[nodiscard]] Outcome<void> subscribe_next(Timeout timeout) GIMNET_EXCLUDES(mutex_);
  void on_refusal(const Failure& failure) GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] bool remembers_too_many() const GIMNET_EXCLUDES(mutex_);
  /// Ends the subscription of whom has been gone for longest. False: nobody is, or its messages are
  /// still to be taken.
  [[nodiscard]] bool let_one_go() GIMNET_EXCLUDES(mutex_);
  /// About those that the hub did not take again and that were not told yet; "" if there are none.
  [[nodiscard]] std::string refusal_news() GIMNET_REQUIRES(mutex_);

  Node& node_;
  const std::string pattern_;
  const PaceOptions pace_;
  std::optional<Watch> watch_;  ///< open()'s, then the thread's
  std::int64_t retry_ns_ = 0;   ///< not earlier is asked again; the thread's, as the next two
  std::int64_t tidy_ns_ = 0;    ///< not earlier is let go again
  bool told_ = false;           ///< that it cannot subscribe at the moment

  mutable Mutex mutex_;
  MatchingServices matching_ GIMNET_GUARDED_BY(mutex_);
  Subscriptions subscriptions_ GIMNET_GUARDED_BY(mutex_);
  VanishedServices vanished_ GIMNET_GUARDED_BY(mutex_);
  std::set<std::string> refused_ GIMNET_GUARDED_BY(mutex_);  ///< told. Limit: subscriptions_
  std::int64_t look_ns_ GIMNET_GUARDED_BY(mutex_) = 0;       ///< not earlier is looked for others
  std::optional<Failure> failure_ GIMNET_GUARDED_BY(mutex_);
  std::thread thread_;
};

}  // namespace gimnet::tool
