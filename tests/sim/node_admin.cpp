#include "proto/control/ctrl.hpp"
#include "tests/sim/node.hpp"

// Administration of the hub by a simulated node, which may not have the right to.

namespace gimnet::sim {

namespace ctrl = proto::ctrl;

void SimNode::administer() {
  Random& random = around_.setting.random;
  if (known_.empty() || link().open.size() >= around_.setting.plan.limits.requests) return;
  const NodeId whom = random.pick(known_);
  const std::uint64_t choice = random.below(10);
  if (choice < 3) return ask(ctrl::Kick{whom, "it is in the way"}, {}, proto::Kind::ctrl);
  if (choice == 3) return ask(ctrl::Reload{}, {}, proto::Kind::ctrl);
  if (choice == 4 && !administers_) return ask(ctrl::Drain{}, {}, proto::Kind::ctrl);
  ctrl::Reassign order;
  order.node = whom;
  order.new_node = random.pick(known_);  // held, unless it has left
  // Also what the next start hands out first.
  const std::uint64_t distance =
      random.chance(500) ? random.below(1'000) : random.between(1, 2) * 4'096 - random.below(300);
  const auto nearby = static_cast<std::uint32_t>((index_of(whom) + distance) % kEveryIndex);
  if (choice < 9) order.new_node = make_id<NodeId>(hub_of(whom), nearby);
  ask(order, {}, proto::Kind::ctrl);
}

bool SimNode::order_drain() {
  if (!administers_ || hung_ || !is_up() ||
      link().open.size() >= around_.setting.plan.limits.requests)
    return false;
  ask(ctrl::Drain{}, {}, proto::Kind::ctrl);
  return true;
}

}  // namespace gimnet::sim
