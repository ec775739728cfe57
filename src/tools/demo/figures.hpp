#pragma once

#include "tools/demo/canvas.hpp"
#include "tools/demo/monitor.hpp"
#include "tools/demo/screen.hpp"

namespace gimnet::demo {

/// Draws the column of figures beside the map: robot, streams, latency, hub; as much of it as fits.
/// Thread safety: pure functions.
void draw_panel(Canvas& canvas, const Monitor& monitor, const ScreenState& state, const Area& area);

/// Draws the most important figures in three rows, for narrow screens.
void draw_strip(Canvas& canvas, const Monitor& monitor, const ScreenState& state, const Area& area);

}  // namespace gimnet::demo
