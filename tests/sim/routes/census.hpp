#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace gimnet::sim::routes {

/// Faults and collisions: a run of many worlds in which one never came proves little.
enum class Event : std::uint8_t {
  reset,
  cut,
  lost_record,
  other_cost,
  damped,
  forged_record,
  refused_record,
  removed_link,
  resumed,
  partition,
  lost_state,
  outage,
  restart,
  refused_copy,
  left_as_copy,
  refused_id,
  left_for_its_id,
  drew_again,
  asked_old_link,
  too_far,
  refused_name,
  took_over,
  lost_name,
};
inline constexpr std::array<std::string_view, 23> kEventNames = {
    "reset",           "cut",           "lost_record",    "other_cost",
    "damped",          "forged_record", "refused_record", "removed_link",
    "resumed",         "partition",     "lost_state",     "outage",
    "restart",         "refused_copy",  "left_as_copy",   "refused_id",
    "left_for_its_id", "drew_again",    "asked_old_link", "too_far",
    "refused_name",    "took_over",     "lost_name"};

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

}  // namespace gimnet::sim::routes
