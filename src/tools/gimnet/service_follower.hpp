#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "base/mutex.hpp"
#include "gimnet/gimi.hpp"
#include "tools/gimnet/losses.hpp"

namespace gimnet::tool {

/// The services that match a pattern, as a watch tells, and which of them want a subscription.
/// Thread safety: one thread.
class MatchingServices {
 public:
  /// Services that are gone and remembered. Their subscriptions stay, so that a service
  /// that is back loses nothing: more than programs that are started again, fewer than would fill
  /// the hub's subscriptions_per_node.
  static constexpr std::size_t kGoneMax = 256;

  /// Takes what the watch tells next. Returns the name of a latecomer that is withdrawn again.
  std::optional<std::string> take(const WatchEvent& event);
  /// The first snapshot has ended.
  [[nodiscard]] bool complete() const { return complete_; }
  [[nodiscard]] bool any() const { return services_.size() > gone_.size(); }

  /// The one to subscribe to next, also one that is gone already: it may come back. Null: none.
  /// Valid until: the next call that changes something.
  [[nodiscard]] const std::string* wanted() const {
    return wanted_.empty() ? nullptr : &wanted_.front();
  }
  /// It has its subscription, or will not get one. REQUIRES: is wanted() or was.
  void settle(std::string_view name);
  /// Of those that are gone and remembered, the one that has been for longest. Null: none. As
  /// wanted().
  [[nodiscard]] const std::string* oldest_gone() const {
    return gone_.empty() ? nullptr : &gone_.front();
  }
  [[nodiscard]] bool remembers_too_many() const { return gone_.size() > kGoneMax; }
  void forget(const std::string& name);

  /// Did the service come while its pattern was watched, and without a subscription, so that there
  /// may be messages from before that? True once each time it came.
  bool take_lateness(std::string_view name);

 private:
  struct Service {
    bool there = false;
    bool shown = false;     ///< in the snapshot that is under way
    bool settled = false;   ///< is not wanted
    bool late = false;      ///< this time
    bool lateness = false;  ///< not taken yet
  };
  using Services = std::map<std::string, Service, std::less<>>;

  void on_there(const std::string& name);
  void on_gone(Services::iterator found);
  void on_snapshot_end();

  Services services_;
  std::deque<std::string>
      wanted_;  ///< in the order of their coming. Limit: the services there are, and gone_
  std::deque<std::string>
      gone_;  ///< those not there. Limit: kGoneMax, and what is still to be forgotten
  bool complete_ = false;
};

/// Services that came and went before anything of them came, and when to say so. Times are those of
/// steady_now_ns(). Thread safety: one thread.
class VanishedServices {
 public:
  /// A message may still come this long behind the news that its service is gone.
  static constexpr std::int64_t kLateNs = 1'000'000'000;
  /// Has no message of the service ever come?
  using IsSilent = std::function<bool()>;

  void on_gone(std::string name, IsSilent is_silent, std::int64_t now_ns) {
    waiting_.push_back({std::move(name), std::move(is_silent), now_ns + kLateNs});
  }
  /// Whatever comes from now on is not of its former time.
  void on_there(const std::string& name);
  [[nodiscard]] bool empty() const { return waiting_.empty() && count_ == 0; }

  /// A sentence about those not told yet; none within NewsPace::kPeriodNs of the last one.
  [[nodiscard]] std::vector<std::string> news(std::int64_t now_ns);
  /// As news(), at the end: whatever the time is.
  [[nodiscard]] std::vector<std::string> rest();

 private:
  struct Gone {
    std::string name;
    IsSilent is_silent;
    std::int64_t due_ns = 0;
  };
  void judge(const Gone& gone);

  std::deque<Gone> waiting_;  ///< Limit: what comes and goes in kLateNs
  std::string first_;         ///< of those that are to be told
  std::size_t count_ = 0;
  NewsPace pace_;
};

/// So many messages of one service wait in this process; then it stops reading from the hub.
inline constexpr SubscribeOptions kAllMessages{.queue = 4096, .at_full = AtFullQueue::stop_reading};

/// Subscribes to all services that match a pattern, to those that come later as soon as the hub
/// tells of them. It has a thread of its own for that, since whoever waits for messages cannot wait
/// for news, too. Says on standard error what it cannot subscribe to, and goes on. Memory: what
/// MatchingServices remembers. Thread safety: one thread.
class ServiceFollower {
 public:
  /// `node` must outlive it, and is closed with it.
  ServiceFollower(Node& node, std::string pattern, const SubscribeOptions& wish)
      : node_(node), pattern_(std::move(pattern)), wish_(wish) {}
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
  /// The time for which there is nothing to do but to wait for news.
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
  const SubscribeOptions wish_;
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
