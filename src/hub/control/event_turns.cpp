#include "hub/control/event_turns.hpp"

#include <utility>

#include "base/check.hpp"

namespace gimnet::hub {
namespace {

/// Of a frame that waits: its event, and the memory that the allocator takes for both.
constexpr std::size_t kEventOverhead = 256;

/// 0: it is no frame of a link.
std::size_t link_bytes_of(const ShardEvent& event) {
  const auto* frame = std::get_if<ControlFrameEvent>(&event.what);
  const bool of_link = frame != nullptr && index_of(frame->node) == kHubIndex;
  return of_link ? frame->frame.size() + kEventOverhead : 0;
}

bool is_route(const ShardEvent& event) {
  const auto* frame = std::get_if<ControlFrameEvent>(&event.what);
  return frame != nullptr && frame->frame.size() >= proto::kHeaderSize &&
         proto::load_header(frame->frame.data()).kind == proto::Kind::route;
}

}  // namespace

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
  const std::size_t bytes = link_bytes_of(event);
  const auto known = waiting_.find(key);
  if ((known == waiting_.end() ? 0 : known->second.link_bytes) + bytes > kLinkBytesMax) {
    overrun_ = hub_of(std::get<ControlFrameEvent>(event.what).node);
    ++dropped_;
    return;
  }
  const auto [found, added] = waiting_.try_emplace(key);
  if (added) found->second.turn = turns_.insert(turns_.end(), key);
  found->second.link_bytes += bytes;
  if (std::holds_alternative<DetachedEvent>(event.what)) {
    ended_.push_back(key);
    found->second.events.remove_if([&](const ShardEvent& each) {
      if (is_route(each)) found->second.link_bytes -= link_bytes_of(each);
      return is_route(each);
    });
  }
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
  node.link_bytes -= link_bytes_of(event);
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
