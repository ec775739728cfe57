#include "hub/control/event_turns.hpp"

#include <utility>

#include "base/check.hpp"

namespace gimnet::hub {

EventTurns::Key EventTurns::key_of(const ShardEvent& event) {
  const std::uint32_t shard = event.shard.value();
  return std::visit(
      [shard](const auto& what) -> Key {
        if constexpr (requires { what.session; }) {
          return {shard, what.session.slot.value(), what.session.generation};
        } else {
          GIMNET_CHECK(false);
          return {};
        }
      },
      event.what);
}

void EventTurns::put(ShardEvent event) {
  if (std::holds_alternative<DrainedEvent>(event.what)) return drained_.push_back(std::move(event));
  const Key key = key_of(event);
  if (std::holds_alternative<DetachedEvent>(event.what)) ended_.push_back(key);
  const auto [found, added] = waiting_.try_emplace(key);
  if (added) found->second.turn = turns_.insert(turns_.end(), key);
  found->second.events.push_back(std::move(event));
}

ShardEvent EventTurns::take() {
  GIMNET_CHECK(!empty());
  if (waiting_.empty()) {
    ShardEvent event = std::move(drained_.front());
    drained_.pop_front();
    return event;
  }
  const auto next = waiting_.find(turns_.front());
  Node& node = next->second;
  ShardEvent event = std::move(node.events.front());
  node.events.pop_front();
  if (node.events.empty()) {
    turns_.pop_front();
    waiting_.erase(next);
    if (waiting_.empty()) ended_.clear();
  } else {
    turns_.splice(turns_.end(), turns_, turns_.begin());
  }
  return event;
}

std::vector<ShardEvent> EventTurns::take_ended() {
  std::vector<ShardEvent> taken;
  for (const Key& key : std::exchange(ended_, {})) {
    const auto found = waiting_.find(key);
    if (found == waiting_.end()) continue;
    for (ShardEvent& event : found->second.events) taken.push_back(std::move(event));
    turns_.erase(found->second.turn);
    waiting_.erase(found);
  }
  return taken;
}

}  // namespace gimnet::hub
