#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace gimnet::sim::hubs {

/// Faults and collisions: a run of many worlds in which one never came proves little.
enum class Event : std::uint8_t {
  stalled,
  reset,
  cut,
  one_way,
  partition,
  killed,
  lost_power,
  lost_state,
  drained,
  stopped,
  clock_jump,
  link_removed,
  link_added,
  other_cost,
  node_crashed,
  moved,
  resumed,
  unsure,
  no_route,
  id_collision,
  copied_state,
  refused_name,
  lost_name,
  paused_sender,
  asked_another_hub,
  counted_on,
  service_away,
};
inline constexpr std::array<std::string_view, 27> kEventNames = {
    "stalled",      "reset",        "cut",        "one_way",       "partition",
    "killed",       "lost_power",   "lost_state", "drained",       "stopped",
    "clock_jump",   "link_removed", "link_added", "other_cost",    "node_crashed",
    "moved",        "resumed",      "unsure",     "no_route",      "id_collision",
    "copied_state", "refused_name", "lost_name",  "paused_sender", "asked_another_hub",
    "counted_on",   "service_away"};

/// Counts of each. Thread safety: none.
class Census {
 public:
  void note(Event event) { ++counts_[static_cast<std::size_t>(event)]; }
  void add(const Census& other) {
    for (std::size_t i = 0; i < counts_.size(); ++i) counts_[i] += other.counts_[i];
  }
  [[nodiscard]] const std::array<std::uint64_t, kEventNames.size()>& counts() const {
    return counts_;
  }

 private:
  std::array<std::uint64_t, kEventNames.size()> counts_{};
};

}  // namespace gimnet::sim::hubs
