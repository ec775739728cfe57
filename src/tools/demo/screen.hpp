#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "tools/demo/canvas.hpp"
#include "tools/demo/labs_view.hpp"
#include "tools/demo/monitor.hpp"

namespace gimnet::demo {

/// The user's choice of the view.
struct MapChoice {
  /// 1: everything fits; more: closer, around the robot.
  double zoom = 1.0;
  /// Keep the robot in the middle, at a scale at which it can be made out.
  bool follow = false;
  bool trail = true;
};

/// The view that shows what was chosen, for a plot of that extent. Thread safety: pure functions.
[[nodiscard]] View choose_view(const Monitor& monitor, const MapChoice& choice, Extent extent);

/// Draws the hall, what scans saw of the world, the trail, the latest scan and the robot, in this
/// order.
void draw_map(Plot& plot, const Monitor& monitor, const MapChoice& choice);

/// Draws a bar of a round length with its length in metres, from that place to the right.
void draw_scale(Canvas& canvas, ScreenPlace place, const View& view);

/// The parts of the viewer's screen that the monitor does not know.
struct ScreenState {
  MapChoice map;
  /// The hub's address, for the title.
  std::string hub_url;
  /// Now, in ns since 1970.
  std::int64_t now_ns = 0;
  /// A course drives, not the keyboard.
  bool autopilot = false;
  /// The list of keys lies over the map.
  bool help = false;
  /// The connection to the hub stands.
  bool connected = true;
  /// Two laboratories, in place of the figures of the streams.
  std::optional<LabsView> labs;
};

/// Smallest screen on which something can be shown.
inline constexpr Extent kScreenLeast{24, 6};

/// Draws the whole screen: the map, beside it (or, where it is narrow, below) the figures. Thread
/// safety: pure function.
[[nodiscard]] Canvas draw_screen(const Monitor& monitor, const ScreenState& state, Extent extent);

}  // namespace gimnet::demo
