#pragma once

#include <cstdint>
#include <memory>
#include <unordered_map>
#include <utility>
#include <vector>

#include "hub/data/egress/counted_groups.hpp"
#include "hub/data/fanout/paced_subscription.hpp"

namespace gimnet::hub {

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
