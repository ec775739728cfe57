#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "gimnet/gimi.hpp"
#include "tools/gimnet/service_follower.hpp"

namespace gimnet::tool {

/// Not all messages are wanted, and the hub has to take the terms.
[[nodiscard]] bool wants_less(const SubscribeOptions& wish);

/// The services that a word of the command line names: one by its full name, which need not exist
/// yet, or all that match a pattern, those that come later too. Thread safety: one thread.
class Subscriptions {
 public:
  /// `node` must outlive it; with a pattern it is closed with it.
  Subscriptions(Node& node, std::string word, const SubscribeOptions& wish)
      : node_(node), word_(std::move(word)), wish_(wish) {}

  /// Subscribes to what is there; of a pattern to the first, and to the others meanwhile. Errors:
  /// as Node::subscribe() and Node::watch().
  [[nodiscard]] Outcome<void> open();
  /// The next message of any of them. Says on standard error, now and then, which services of a
  /// pattern came and went without one. Errors: timeout, closed; not_found: the service came and
  /// accepts data; limit and others: the hub did not take the subscription again after a break; for
  /// a pattern also refused: it takes in no more services.
  [[nodiscard]] Outcome<Message> receive(Timeout timeout);
  /// Says what receive() would still have said.
  void say_rest();

  /// By full name: how many messages were missed.
  [[nodiscard]] std::map<std::string, std::uint64_t> missed() const;
  /// As MatchingServices::take_lateness(); never of one that was called by its full name.
  [[nodiscard]] bool take_lateness(std::string_view service);
  /// The words for the user while there is nothing to subscribe to, or no way to the hub of the
  /// service; "" when there is.
  [[nodiscard]] std::string waits_for() const;

 private:
  [[nodiscard]] Outcome<void> ask_terms();
  [[nodiscard]] bool is_unreachable() const;

  Node& node_;
  std::string word_;
  SubscribeOptions wish_;
  std::optional<Subscription> one_;          ///< by its full name
  std::optional<ServiceFollower> follower_;  ///< of a pattern
};

}  // namespace gimnet::tool
