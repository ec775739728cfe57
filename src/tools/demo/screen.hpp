#pragma once

#include <cstdint>
#include <string>

#include "tools/demo/canvas.hpp"
#include "tools/demo/map_view.hpp"
#include "tools/demo/monitor.hpp"

namespace gimnet::demo {

/// What the viewer's screen shows beside what was heard.
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
};

/// Smallest screen on which something can be shown.
inline constexpr Extent kScreenLeast{24, 6};

/// Draws the whole screen: the map, beside it (or, where it is narrow, below) the figures. Thread
/// safety: pure function.
[[nodiscard]] Canvas draw_screen(const Monitor& monitor, const ScreenState& state, Extent extent);

}  // namespace gimnet::demo
