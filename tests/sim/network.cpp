#include "tests/sim/network.hpp"

#include <algorithm>

namespace gimnet::sim {
namespace {

/// The kernel's least time until it sends again what was lost (Linux, TCP_RTO_MIN). What comes
/// after it waits for it.
constexpr Time kResendAfter = std::chrono::milliseconds{200};
constexpr Time kClogMost = std::chrono::seconds{5};

}  // namespace

WirePointer Network::dial(std::uint32_t node) {
  auto wire = std::make_shared<Wire>();
  wire->number = ++last_;
  wire->node = node;
  return wire;
}

Time Network::arrival(Time& next) {
  next = std::max(next, setting_.agenda.now() + time_under_way());
  return next;
}

Time Network::time_under_way() {
  const Time delay{
      setting_.random.between(20, static_cast<std::uint64_t>(setting_.plan.latency_most.count()))};
  const Time now = setting_.agenda.now();
  if (now >= setting_.plan.faults_until) return delay;
  if (setting_.random.chance(setting_.plan.clog)) {
    setting_.census.add(Happening::connection_clogged);
    const Time clogged{setting_.random.between(0, static_cast<std::uint64_t>(kClogMost.count()))};
    return delay + std::min(clogged, setting_.plan.faults_until - now);
  }
  if (setting_.random.chance(setting_.plan.stall)) {
    setting_.census.add(Happening::frame_stalled);
    return delay + kResendAfter;
  }
  return delay;
}

void Network::to_hub(const WirePointer& wire, Bytes frame) {
  if (!wire->node_open) return;
  setting_.agenda.at(arrival(wire->next_at_hub), [this, wire, frame = std::move(frame)]() mutable {
    if (!wire->hub_open) return;
    wire->at_hub.push_back(std::move(frame));
    ends_.hub_has_something(*wire);
  });
}

void Network::to_node(const WirePointer& wire, Bytes frame) {
  if (!wire->hub_open) return;
  setting_.agenda.at(arrival(wire->next_at_node), [this, wire, frame = std::move(frame)] {
    if (wire->node_open) ends_.node_hears(wire, frame);
  });
}

void Network::close_by_node(const WirePointer& wire, bool unseen) {
  if (!wire->node_open) return;
  wire->node_open = false;
  if (unseen) return;
  setting_.agenda.at(arrival(wire->next_at_hub), [this, wire] {
    wire->end_arrived = true;
    if (wire->hub_open) ends_.hub_has_something(*wire);
  });
}

void Network::close_by_hub(const WirePointer& wire) {
  if (!wire->hub_open) return;
  wire->hub_open = false;
  wire->at_hub.clear();
  setting_.agenda.at(arrival(wire->next_at_node), [this, wire] {
    if (!wire->node_open) return;
    wire->node_open = false;
    ends_.node_sees_the_end(wire);
  });
}

}  // namespace gimnet::sim
