#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>

#include "gimnet/gimi.hpp"

namespace gimnet::tool {

/// Are several names meant?
[[nodiscard]] inline bool is_pattern(std::string_view word) { return word.find('*') != std::string_view::npos; }

/// Not all messages are wanted, and the hub has to take the terms.
[[nodiscard]] bool wants_less(const PaceOptions& pace);

/// The services that a word of the command line names: one by its full name, which need not exist yet, or all that
/// match a pattern, those that come later too. Thread safety: one thread.
class Subscriptions {
 public:
  /// `node` must outlive it.
  Subscriptions(Node& node, std::string word, const PaceOptions& pace = {})
      : node_(node), word_(std::move(word)), pace_(pace) {}

  /// Subscribes to what is there. Errors: as Node::subscribe() and Node::services().
  [[nodiscard]] Outcome<void> open();
  /// The next message of any of them. Errors: timeout, closed; for a pattern also those of open().
  [[nodiscard]] Outcome<Message> receive(Timeout timeout);

  /// By full name.
  [[nodiscard]] const std::map<std::string, Subscription, std::less<>>& all() const { return all_; }
  /// What to tell the user while there is nothing to subscribe to; "" when there is.
  [[nodiscard]] std::string waits_for() const;

 private:
  [[nodiscard]] Outcome<void> subscribe(const std::string& service);
  /// Takes what is new, and lets go of what is gone.
  [[nodiscard]] Outcome<void> look_again();
  [[nodiscard]] Outcome<void> ask_terms();

  Node& node_;
  std::string word_;
  PaceOptions pace_;
  std::map<std::string, Subscription, std::less<>> all_;
  std::int64_t looked_ns_ = 0;
};

}  // namespace gimnet::tool
