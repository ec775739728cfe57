#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "base/check.hpp"
#include "base/ids.hpp"
#include "hub/data/egress/outbox.hpp"
#include "hub/data/fanout/paced_subscription.hpp"

namespace gimnet::hub {

/// A session as the data plane sees it: a node or a link on this shard, to which frames go. Thread
/// safety: one shard.
struct Recipient {
  NodeId node;  ///< of a link: the hub at its other end, `hub << 20`
  ConnectionSlot slot;
  std::uint32_t generation = 0;
  std::uint32_t frame_bytes = proto::kFrameLengthDefault;  ///< largest `length` that it takes
  Outbox outbox;
  std::unique_ptr<PacedBook> paced;  ///< if one of its subscriptions is (Pacer)
  bool connected = false;
  bool waits_when_away = false;  ///< asked for resume: frames wait during its grace time
  bool dirty = false;            ///< is in the list of those to be flushed
  std::size_t place = 0;         ///< in RecipientTable::nodes() or links()

  [[nodiscard]] bool is_link() const { return index_of(node) == kHubIndex; }
};

/// The sessions of a shard by slot, nodes and links apart without free slots, and those that this
/// turn has something to write for. Thread safety: one shard. Ownership: none; who owns a recipient
/// takes it out before it goes.
class RecipientTable {
 public:
  void put(Recipient& recipient) {
    const std::size_t slot = recipient.slot.value();
    if (slot >= by_slot_.size()) by_slot_.resize(slot + 1);
    GIMNET_CHECK(by_slot_[slot] == nullptr);
    by_slot_[slot] = &recipient;
    std::vector<Recipient*>& list = list_of(recipient);
    recipient.place = list.size();
    list.push_back(&recipient);
  }
  void remove(Recipient& recipient) {
    by_slot_[recipient.slot.value()] = nullptr;
    std::vector<Recipient*>& list = list_of(recipient);
    list.back()->place = recipient.place;
    list[recipient.place] = list.back();
    list.pop_back();
    if (recipient.dirty) std::erase(dirty_, &recipient);
  }
  /// nullptr unless exactly that session is there.
  [[nodiscard]] Recipient* find(ConnectionSlot slot, std::uint32_t generation) const {
    if (slot.value() >= by_slot_.size()) return nullptr;
    Recipient* recipient = by_slot_[slot.value()];
    return recipient != nullptr && recipient->generation == generation ? recipient : nullptr;
  }
  /// In no order.
  [[nodiscard]] const std::vector<Recipient*>& nodes() const { return nodes_; }
  [[nodiscard]] const std::vector<Recipient*>& links() const { return links_; }

  void mark_dirty(Recipient& recipient) {
    if (recipient.dirty) return;
    recipient.dirty = true;
    dirty_.push_back(&recipient);
  }
  [[nodiscard]] std::vector<Recipient*>& dirty() { return dirty_; }

 private:
  /// A session that is given another node id stays a node.
  [[nodiscard]] std::vector<Recipient*>& list_of(const Recipient& recipient) {
    return recipient.is_link() ? links_ : nodes_;
  }

  std::vector<Recipient*> by_slot_;  ///< nullptr: the slot is free
  std::vector<Recipient*> nodes_;
  std::vector<Recipient*> links_;
  std::vector<Recipient*> dirty_;
};

}  // namespace gimnet::hub
