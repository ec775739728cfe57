#include "client/nif/callback_delivery.hpp"

namespace gimnet::nif {
namespace {

/// While it lives the program's callback may be running.
class InCallbacks {
 public:
  explicit InCallbacks(Outbound& outbound) : outbound_(outbound) { outbound_.begin_callbacks(); }
  ~InCallbacks() { outbound_.end_callbacks(); }
  InCallbacks(const InCallbacks&) = delete;
  InCallbacks& operator=(const InCallbacks&) = delete;

 private:
  Outbound& outbound_;
};

}  // namespace

void CallbackDelivery::run() {
  if (options_.callback == nullptr) return;
  if (held_ && again_calls_.load() == held_at_) return;
  held_ = false;
  std::size_t count = closing_.load() ? 0 : received_.take(in_hand_);
  if (count == 0) return;
  const InCallbacks in_callbacks(
      outbound_);  // for all of them: between two batches nothing is written
  while (count > 0) {
    const std::span<const Item> taken(in_hand_.data(), count);
    received_.give_back(taken.subspan(give(taken)));
    const bool more = !held_ && !closing_.load() && count == in_hand_.size();
    count = more ? received_.take(in_hand_) : 0;
  }
}

/// Returns how many the program took; fewer than there are if it has no room (`held_`), or the node
/// closes.
std::size_t CallbackDelivery::give(std::span<const Item> items) {
  std::size_t taken = 0;
  while (taken < items.size() && !closing_.load()) {
    nif_incoming in = incoming_of(items[taken]);
    const std::uint32_t calls = again_calls_.load();
    const nif_verdict verdict = options_.callback(options_.user, &in);
    if (verdict == NIF_NOT_NOW) {
      if (again_calls_.load() != calls) continue;  // room came while it was asked
      held_ = true;
      held_at_ = calls;
      break;
    }
    ++taken;
    const bool credited = verdict == NIF_DONE || !options_.credit_by_program;
    if (credited && in.epoch != 0) credits_.take(in.to, in.epoch, 1, false);
    if (verdict == NIF_DONE) nif_release(&in);
  }
  return taken;
}

}  // namespace gimnet::nif
