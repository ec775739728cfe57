#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "tools/demo/canvas.hpp"
#include "tools/demo/monitor.hpp"
#include "tools/demo/screen.hpp"

namespace gimnet::demo {

// Figures as people read them. Thread safety: pure functions.

/// A duration: "85 µs", "1.24 ms", "2.10 s"; "–" for none.
[[nodiscard]] std::string duration_text(std::optional<std::int64_t> duration_ns);
/// A count with its thousands set apart: "12,345".
[[nodiscard]] std::string count_text(std::uint64_t count);
/// Seconds as "m:ss" or "h:mm:ss".
[[nodiscard]] std::string clock_text(double seconds);

/// Draws the column of figures beside the map: robot, streams, latency, hub; as much of it as fits.
void draw_panel(Canvas& canvas, const Monitor& monitor, const ScreenState& state, const Area& area);

/// Draws the most important figures in three rows, for narrow screens.
void draw_strip(Canvas& canvas, const Monitor& monitor, const ScreenState& state, const Area& area);

}  // namespace gimnet::demo
