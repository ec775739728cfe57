#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "gimnet/gimi.hpp"

namespace gimnet::tool {

/// The services that match a pattern, as a watch tells, and which of them want a subscription.
/// Thread safety: one thread.
class MatchingServices {
 public:
  /// How many services that are gone are remembered. Their subscriptions stay, so that a service
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

}  // namespace gimnet::tool
