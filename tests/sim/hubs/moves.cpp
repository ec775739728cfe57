#include "tests/sim/hubs/world.hpp"

// Looks at a world that was left alone: nodes that move.

namespace gimnet::sim::hubs {
namespace {

constexpr std::size_t kMovesMost = 4;
/// The question and its answer come within the time that a hub waits for it.
constexpr int kLinksMost = 4;
constexpr milliseconds kWithin{1'300};

}  // namespace

/// A node still counts as connected at its former hub when it shows its token elsewhere.
void Settled::check_moves() {
  std::vector<SimNode*> moved;
  for (SimNode& node : world_.nodes_) {
    const std::size_t to = node.at() == node.plan().hub ? node.plan().other : node.plan().hub;
    const int links = distance_[node.at()][to];
    // Another node may take a name that several want as soon as it is let go.
    const bool has_own = node.name() == node.plan().name && !node.name().starts_with("shared");
    if (!node.is_up() || !has_own || links < 1 || links > kLinksMost) continue;
    node.move(world_.now());
    moved.push_back(&node);
    if (moved.size() == kMovesMost) break;
  }
  if (moved.empty()) return;
  world_.run_until(world_.now() + kWithin);
  for (const SimNode* node : moved) {
    if (node->is_up() && node->name() == node->plan().name) continue;
    broken(Checker::moves, "node " + node->plan().name + " has no name at hub " +
                               std::to_string(node->at()) + ", and " + node->last());
  }
}

}  // namespace gimnet::sim::hubs
