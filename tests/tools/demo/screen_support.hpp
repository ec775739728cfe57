#pragma once

#include <string>

#include "tools/demo/monitor.hpp"
#include "tools/demo/screen.hpp"
#include "tools/demo/terminal.hpp"

namespace gimnet::demo {

/// The text of a screen, as lines.
inline std::string lines_of(const Canvas& canvas) {
  return AnsiWriter({true, ColourDepth::kNone}).lines(canvas);
}

/// A monitor that has heard a little of everything.
inline Monitor busy_monitor() {
  Monitor monitor(0);
  RobotInfo info;
  info.source = "simulation";
  info.map = WorldMap::hall().text();
  monitor.take(info, 0);
  for (std::uint64_t number = 1; number <= 41; ++number) {
    Odometry odometry;
    const auto now_ns = static_cast<std::int64_t>(number) * 25'000'000;
    odometry.stamp = {number, now_ns - 120'000};
    odometry.pose = {4.25, 5.5, 0.0};
    odometry.twist.linear_mps = 0.75;
    monitor.take(odometry, now_ns);
  }
  HubCounters counters;
  counters.add("accepted", 12'345);
  counters.add("delivered", 12'345);
  monitor.take(counters);
  return monitor;
}

}  // namespace gimnet::demo
