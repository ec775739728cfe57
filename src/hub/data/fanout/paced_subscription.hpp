#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <unordered_map>
#include <utility>
#include <vector>

#include "base/ids.hpp"
#include "hub/data/egress/counted_groups.hpp"
#include "hub/data/egress/kept_message.hpp"

namespace gimnet::hub {

struct Recipient;

/// The limits of what a subscriber gets of a service.
struct PaceTerms {
  std::uint32_t window = 0;       ///< messages that it has not credited; 0: any number
  std::uint32_t depth = 1;        ///< newest messages that are held for it
  std::uint32_t interval_us = 0;  ///< between two messages at least; 0: none
  friend bool operator==(const PaceTerms&, const PaceTerms&) = default;
};

/// One subscriber of one group, where the hub decides which messages it gets when: how many are on
/// their way to it, the newest ones that are held, and those of which only the beginning has come.
/// It decides; the Pacer moves the frames.
///
/// What is on the way is counted in ends of messages: a frame that is a message, or the last
/// fragment of one. Both ends see the same ones, whatever became of the rest of the message
/// (docs/protocol.md, section 8). Thread safety: one shard.
class PacedSubscription {
 public:
  PacedSubscription(Recipient& recipient, GroupId group, const PaceTerms& terms)
      : recipient_(recipient), group_(group) {
    set_terms(terms);
  }

  [[nodiscard]] Recipient& recipient() const { return recipient_; }
  [[nodiscard]] GroupId group() const { return group_; }
  [[nodiscard]] const PaceTerms& terms() const { return terms_; }
  /// Messages that are held stay, even if they are more than the new depth. A new interval counts
  /// from the message that began last.
  void set_terms(const PaceTerms& terms);

  // ---- the window and the clock

  /// Messages that may begin now, if the clock allows more than one.
  [[nodiscard]] std::uint64_t space() const;
  [[nodiscard]] bool is_due(std::uint64_t now_us) const {
    return terms_.interval_us == 0 || now_us >= due_us_;
  }
  [[nodiscard]] bool may_begin(std::uint64_t now_us) const {
    return space() != 0 && is_due(now_us);
  }
  /// A message begins to go to the subscriber.
  void on_begun(std::uint64_t now_us);
  /// So many messages ended on their way to the subscriber.
  void on_sent(std::uint64_t messages) { sent_ += messages; }
  /// Of them, so many were dropped before they left.
  void on_lost(std::uint64_t messages);
  /// The subscriber says how many it took in total. False: it cannot be, and counts as all that
  /// were sent, or not at all where it is less than before.
  [[nodiscard]] bool on_credit(std::uint64_t total);
  /// Both ends count from 0 under that number; so many ended messages still wait to be written.
  void begin_counts(std::uint8_t number, std::uint64_t waiting);
  [[nodiscard]] std::uint8_t number() const { return number_; }
  [[nodiscard]] std::uint64_t uncredited() const { return sent_ - lost_ - credited_; }
  [[nodiscard]] std::uint64_t due_us() const { return due_us_; }

  // ---- messages

  /// A fragmented message of one lane that has begun and not ended.
  struct Open {
    enum class State : std::uint8_t {
      none,
      plain,  ///< it may have begun before the pace, when everything came: what comes of it passes
      passing,   ///< its fragments go to the subscriber as they come
      arriving,  ///< they are kept until the message is whole, or may go
      cut,       ///< the rest is dropped
    };
    State state = State::none;
    std::uint32_t number = 0;
    std::uint32_t next_offset = 0;
    std::uint64_t came_ms = 0;  ///< its last fragment
    KeptMessage message;
  };
  [[nodiscard]] Open& open(std::size_t lane) { return open_[lane]; }
  [[nodiscard]] std::array<Open, proto::kLaneCount>& open() { return open_; }

  [[nodiscard]] std::size_t held() const { return held_; }
  [[nodiscard]] std::uint64_t held_bytes() const { return held_bytes_; }
  /// The oldest held message. REQUIRES: held() != 0.
  [[nodiscard]] KeptMessage& oldest() { return ring_[first_]; }
  /// Lets the oldest go: clears it. REQUIRES: held() != 0.
  void pop_oldest();
  /// Holds a whole message behind the others; `message` is empty afterwards. REQUIRES: held() <
  /// terms().depth.
  void push_newest(KeptMessage& message);

  NodeId source;  ///< of the latest frame
  /// The start that it asked the provider's shard for last (RetainedMessages), and that nothing is
  /// for it before that.
  std::uint32_t start_ticket = 0;
  bool awaits_start = false;
  bool retained = false;   ///< of a service whose last message is kept
  bool by_queue = false;   ///< of a link: what waits in its outbox counts, and no CREDIT comes
  bool ripe = false;       ///< is in the pacer's list of those that may have room
  bool scheduled = false;  ///< is in the pacer's list of those that wait for their time, once

 private:
  Recipient& recipient_;
  const GroupId group_;
  PaceTerms terms_;
  std::uint8_t number_ = 0;
  std::uint64_t sent_ = 0;
  std::uint64_t lost_ = 0;
  std::uint64_t credited_ = 0;
  std::uint64_t due_us_ = 0;  ///< of the next message; 0: none has begun
  std::vector<KeptMessage> ring_;
  std::size_t first_ = 0;
  std::size_t held_ = 0;
  std::uint64_t held_bytes_ = 0;
  std::array<Open, proto::kLaneCount> open_;
};

/// The paced subscriptions of one recipient, by group. Thread safety: one shard.
class PacedBook final : public CountedGroups {
 public:
  /// ripe: where subscriptions are put that may have room because something was lost; the shard's.
  PacedBook(Recipient& recipient, std::vector<PacedSubscription*>& ripe)
      : recipient_(recipient), ripe_(ripe) {}
  ~PacedBook() { clear(); }
  PacedBook(const PacedBook&) = delete;
  PacedBook& operator=(const PacedBook&) = delete;

  [[nodiscard]] PacedSubscription* find(GroupId group) const {
    const auto found = by_group_.find(group.value());
    return found == by_group_.end() ? nullptr : found->second.get();
  }
  PacedSubscription& add(GroupId group, const PaceTerms& terms) {
    auto& place = by_group_[group.value()];
    place = std::make_unique<PacedSubscription>(recipient_, group, terms);
    return *place;
  }
  void erase(PacedSubscription& subscription) {
    unripe(subscription);
    by_group_.erase(subscription.group().value());
  }
  void clear() {
    for (auto& [group, subscription] : by_group_) unripe(*subscription);
    by_group_.clear();
  }
  [[nodiscard]] std::size_t size() const { return by_group_.size(); }
  template <class Take>
  void for_each(Take&& take) {
    for (auto& [group, subscription] : by_group_) take(*subscription);
  }

  [[nodiscard]] bool counts(GroupId group) const override {
    const PacedSubscription* found = find(group);
    return found != nullptr && found->terms().window != 0 && !found->by_queue;
  }
  void on_lost(GroupId group, std::uint32_t messages) override {
    PacedSubscription* found = find(group);
    if (found == nullptr || messages == 0) return;
    found->on_lost(messages);
    if (std::exchange(found->ripe, true)) return;
    ripe_.push_back(found);
  }

 private:
  void unripe(PacedSubscription& subscription) {
    if (std::exchange(subscription.ripe, false)) std::erase(ripe_, &subscription);
  }

  Recipient& recipient_;
  std::vector<PacedSubscription*>& ripe_;
  std::unordered_map<std::uint32_t, std::unique_ptr<PacedSubscription>> by_group_;
};

}  // namespace gimnet::hub
