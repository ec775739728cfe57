#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "gimnet/gimi/records.hpp"
#include "tools/gimnet/ping.hpp"

namespace gimnet::tool {

/// The clock of one hub against that of a neighbour.
struct ClockOffset {
  std::int64_t ns = 0;
  std::int64_t error_ns = 0;
};
/// By (hub, its neighbour): the neighbour's clock minus the hub's.
using ClockOffsets = std::map<std::pair<std::uint32_t, std::uint32_t>, ClockOffset>;

/// A hub on a way, with what was measured there.
struct HopReport {
  std::uint32_t hub_id = 0;
  RoundTrips::Summary delay_us;  ///< from arrival to departure at this hub
  /// From this hub to the one before it; none at the first, or where the clocks are not known.
  RoundTrips::Summary link_us;
  double clock_offset_us = RoundTrips::kNone;  ///< to the first hub
  double clock_error_us = RoundTrips::kNone;
};

/// Collects the ways of traced pings. Thread safety: one thread.
class TraceTally {
 public:
  void add(const TracedPing& ping);
  /// Hubs from this node to the other one, as the last way had them; answers that came another way
  /// count where they passed the same hubs.
  [[nodiscard]] std::vector<std::uint32_t> hubs() const { return hubs_; }
  [[nodiscard]] std::vector<HopReport> hops(const ClockOffsets& clocks) const;
  [[nodiscard]] const RoundTrips& round_trips() const { return round_trips_; }

 private:
  std::vector<std::uint32_t> hubs_;
  std::map<std::uint32_t, RoundTrips> delays_;
  /// By (hub, the hub that the answer had passed before): by the clocks of both.
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::vector<std::int64_t>> links_;
  RoundTrips round_trips_;
};

[[nodiscard]] std::string json_of(const std::vector<HopReport>& hops, const RoundTrips& trips,
                                  std::uint64_t sent);
[[nodiscard]] std::string text_of(const std::vector<HopReport>& hops);

}  // namespace gimnet::tool
