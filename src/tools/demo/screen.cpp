#include "tools/demo/screen.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <string_view>
#include <vector>

#include "tools/demo/canvas.hpp"
#include "tools/demo/figures.hpp"

namespace gimnet::demo {
namespace {

constexpr double kFollowMetresPerDot = 0.06;
constexpr double kRobotRadius_m = 0.25;
// The robot is drawn larger than it is where the scale would make it a speck.
constexpr double kRobotDots = 3.6;
// The latest 32 m: the whole way of an hour would hide the map.
constexpr std::size_t kTrailPointsShown = 800;

void draw_plan(Plot& plot, const WorldMap& map) {
  const auto rows = static_cast<long>(map.rows());
  const auto columns = static_cast<long>(map.columns());
  const auto floor_at = [&](long column, long row) {
    return column >= 0 && row >= 0 && column < columns && row < rows && !map.wall(column, row);
  };
  for (long row = 0; row < rows; ++row) {
    for (long column = 0; column < columns; ++column) {
      const bool outline = floor_at(column - 1, row) || floor_at(column + 1, row) ||
                           floor_at(column, row - 1) || floor_at(column, row + 1);
      if (!map.wall(column, row) || !outline) continue;
      const Point least{static_cast<double>(column) * WorldMap::kCell_m,
                        static_cast<double>(row) * WorldMap::kCell_m};
      plot.fill({least, {least.x_m + WorldMap::kCell_m, least.y_m + WorldMap::kCell_m}},
                Ink::kPlan);
    }
  }
}

void draw_seen(Plot& plot, const OccupancyMap& seen) {
  constexpr double kHalf_m = OccupancyMap::kCell_m / 2.0;
  seen.for_each([&plot](const OccupancyMap::Cell& cell) {
    const Point& at = cell.centre;
    if (!cell.occupied) {
      plot.ground(at, Ground::kSeen);
      return;
    }
    plot.fill({{at.x_m - kHalf_m, at.y_m - kHalf_m}, {at.x_m + kHalf_m, at.y_m + kHalf_m}},
              Ink::kWall);
  });
}

void draw_scan(Plot& plot, const Scan& scan) {
  const double step_m = plot.view().metres_per_dot;
  for (std::size_t beam = 0; beam < scan.ranges_m.size(); ++beam) {
    const bool hit = scan.hit(beam);
    const double reach_m = hit ? static_cast<double>(scan.ranges_m[beam])
                               : std::min(OccupancyMap::kFreeWithoutHit_m, scan.range_max_m);
    const int steps = static_cast<int>(reach_m / step_m);
    for (int step = 0; step <= steps; ++step)
      plot.ground(point_along(scan.ray(beam), step * step_m), Ground::kBeam);
    if (hit) plot.dot(scan.end_of(beam), Ink::kScan);
  }
}

void draw_robot(Plot& plot, const Pose& pose) {
  const double radius_m = std::max(kRobotRadius_m, kRobotDots * plot.view().metres_per_dot);
  const auto corner = [&](double bearing_rad, double scale) {
    return point_along({position(pose), pose.heading_rad + bearing_rad}, radius_m * scale);
  };
  // An arrowhead with a notch behind, as plotters of ships draw it.
  const Point nose = corner(0.0, 1.25);
  const Point notch = corner(std::numbers::pi, 0.35);
  plot.triangle(nose, corner(2.45, 1.1), notch, Ink::kRobot);
  plot.triangle(nose, corner(-2.45, 1.1), notch, Ink::kRobot);
}

}  // namespace

View choose_view(const Monitor& monitor, const MapChoice& choice, Extent extent) {
  const Point robot = position(monitor.pose().value_or(Pose{}));
  Box shown{{robot.x_m - 5.0, robot.y_m - 5.0}, {robot.x_m + 5.0, robot.y_m + 5.0}};
  if (monitor.plan()) {
    shown = {{0.0, 0.0}, {monitor.plan()->width_m(), monitor.plan()->height_m()}};
  } else if (!monitor.seen().empty()) {
    shown = monitor.seen().bounds().widened(robot);
  }
  View view = Plot::fitted(shown, extent);
  if (choice.follow) view.metres_per_dot = std::min(view.metres_per_dot, kFollowMetresPerDot);
  view.metres_per_dot /= choice.zoom;
  if (choice.follow || choice.zoom > 1.0) view.centre = robot;
  return view;
}

void draw_map(Plot& plot, const Monitor& monitor, const MapChoice& choice) {
  if (monitor.plan()) draw_plan(plot, *monitor.plan());
  draw_seen(plot, monitor.seen());
  const std::vector<Point>& trail = monitor.trail();
  const std::size_t shown = choice.trail ? std::min(trail.size(), kTrailPointsShown) : 0;
  for (std::size_t index = trail.size() - shown; index + 1 < trail.size(); ++index) {
    plot.line(trail[index], trail[index + 1], Ink::kTrail);
  }
  if (monitor.scan()) draw_scan(plot, *monitor.scan());
  if (monitor.pose()) draw_robot(plot, *monitor.pose());
}

void draw_scale(Canvas& canvas, ScreenPlace place, const View& view) {
  constexpr double kLengths_m[] = {0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0};
  constexpr int kLeastColumns = 4;
  const double column_m = view.metres_per_dot * Plot::kDotColumns;
  for (const double length_m : kLengths_m) {
    const int columns = static_cast<int>(std::lround(length_m / column_m));
    if (columns < kLeastColumns) continue;
    std::string bar = "├";
    for (int index = 2; index < columns; ++index) bar += "─";
    canvas.text(place, fmt::format("{}┤ {:g} m", bar, length_m), Ink::kDim);
    return;
  }
}

namespace {

constexpr int kPanelColumns = 27;
constexpr int kPanelFromColumns = 64;
constexpr int kPanelFromRows = 12;
constexpr int kStripRows = 3;
constexpr int kStripFromRows = 9;

// A line of keys, the important ones first; as many as fit.
struct KeyHint {
  std::string_view keys;
  std::string_view what;
};
constexpr KeyHint kDriveHints[] = {{"W A S D", "drive"}, {"space", "stop"}, {"Q", "quit"},
                                   {"?", "help"},        {"P", "auto"},     {"F", "follow"},
                                   {"+ -", "zoom"},      {"T", "trail"}};
constexpr KeyHint kPlayHints[] = {{"space", "hold"}, {"[ ]", "speed"}, {"Q", "quit"}, {"?", "help"},
                                  {"F", "follow"},   {"+ -", "zoom"},  {"T", "trail"}};

template <std::size_t size>
void draw_hints(Canvas& canvas, const KeyHint (&hints)[size]) {
  const Extent extent = canvas.extent();
  const int row = extent.rows - 1;
  canvas.lay_ground({0, row}, extent.columns, Ground::kBar);
  int column = 1;
  for (const KeyHint& hint : hints) {
    const int width = static_cast<int>(hint.keys.size() + hint.what.size()) + 1;
    if (column + width >= extent.columns) break;
    column = canvas.text({column, row}, hint.keys, Ink::kTitle) + 1;
    column = canvas.text({column, row}, hint.what, Ink::kDim) + 2;
  }
}

void draw_title(Canvas& canvas, const Monitor& monitor, const ScreenState& state) {
  const int columns = canvas.extent().columns;
  canvas.lay_ground({0, 0}, columns, Ground::kBar);
  int column = canvas.text({1, 0}, "GIMnet", Ink::kTitle) + 2;
  const std::string source = monitor.info() ? monitor.info()->source : "waiting for the robot";
  column = canvas.text({column, 0}, source, Ink::kPlain) + 2;
  const double open_s = static_cast<double>(state.now_ns - monitor.start_ns()) * 1e-9;
  const std::string clock = clock_text(open_s);
  const int clock_column = columns - 1 - static_cast<int>(clock.size());
  const std::string hub = state.connected ? state.hub_url : "not connected, dialling again";
  if (column + static_cast<int>(hub.size()) + 2 < clock_column) {
    canvas.text({column, 0}, hub, state.connected ? Ink::kDim : Ink::kBad);
  }
  if (clock_column > column) canvas.text({clock_column, 0}, clock, Ink::kPlain);
}

void draw_help(Canvas& canvas, const Area& area, bool log) {
  std::vector<std::string_view> lines = {
      "F        follow the robot, or show all",
      "+ -      closer, farther",
      "0        as at the beginning",
      "T        trail on, off",
      "Ctrl-L   draw the screen again",
      "Q Ctrl-C quit, with a summary",
      "?        close this",
  };
  const std::vector<std::string_view> own =
      log ? std::vector<std::string_view>{"space    hold the log, go on", "[ ]      slower, faster"}
          : std::vector<std::string_view>{"W A S D  drive, as do the arrows; hold to go on",
                                          "space    stop", "P        let the course drive, or you"};
  lines.insert(lines.begin(), own.begin(), own.end());
  const int columns = std::min(area.extent.columns, 51);
  const int rows = std::min(area.extent.rows, static_cast<int>(lines.size()) + 2);
  const ScreenPlace corner{area.corner.column + (area.extent.columns - columns) / 2,
                           area.corner.row + (area.extent.rows - rows) / 2};
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column)
      canvas.put({corner.column + column, corner.row + row}, Glyph{});
  }
  canvas.frame({corner, {columns, rows}});
  canvas.text({corner.column + 2, corner.row}, " keys ", Ink::kTitle);
  for (int index = 0; index + 2 < rows; ++index) {
    const std::string_view line = lines[static_cast<std::size_t>(index)];
    canvas.text({corner.column + 2, corner.row + 1 + index},
                line.substr(0, static_cast<std::size_t>(columns - 3)), Ink::kPlain);
  }
}

// The progress of a log, over the lower edge of the map.
void draw_progress(Canvas& canvas, const Area& area, const RobotInfo& info) {
  const std::string_view sign = info.ended ? "●" : info.paused ? "‖" : "▶";
  const std::string text = fmt::format(" {} {} / {} ×{:g} ", sign, clock_text(info.played_s),
                                       clock_text(info.duration_s), info.speed);
  const int row = area.corner.row + area.extent.rows - 1;
  int column = canvas.text({area.corner.column + 1, row}, text, Ink::kTitle);
  const int bar = area.corner.column + area.extent.columns - 2 - column;
  const double part =
      info.duration_s > 0.0 ? std::clamp(info.played_s / info.duration_s, 0.0, 1.0) : 1.0;
  for (int index = 0; index < bar; ++index) {
    canvas.put({column + index, row},
               {index < part * bar ? U'━' : U'─', index < part * bar ? Ink::kTitle : Ink::kFrame});
  }
}

void draw_picture(Canvas& canvas, const Monitor& monitor, const ScreenState& state,
                  const Area& area) {
  canvas.frame(area);
  const Area inner{{area.corner.column + 1, area.corner.row + 1},
                   {area.extent.columns - 2, area.extent.rows - 2}};
  const View view = choose_view(monitor, state.map, inner.extent);
  Plot plot(inner.extent, view);
  draw_map(plot, monitor, state.map);
  plot.draw(canvas, inner.corner);
  if (!monitor.odometry()) {
    canvas.text({inner.corner.column + 1, inner.corner.row}, "no odometry yet", Ink::kDim);
  }
  const bool log = monitor.info() && monitor.info()->is_log();
  if (log) draw_progress(canvas, area, *monitor.info());
  const int scale_row = area.corner.row + area.extent.rows - (log ? 2 : 1);
  draw_scale(canvas, {area.corner.column + 2, scale_row}, view);
  if (log && !monitor.info()->note.empty() && state.now_ns - monitor.start_ns() < 8'000'000'000) {
    const std::string& note = monitor.info()->note;
    canvas.text({inner.corner.column + 1, inner.corner.row},
                note.substr(0, static_cast<std::size_t>(std::max(0, inner.extent.columns - 2))),
                Ink::kWarn);
  }
  if (state.help) draw_help(canvas, area, log);
}

}  // namespace

Canvas draw_screen(const Monitor& monitor, const ScreenState& state, Extent extent) {
  Canvas canvas(extent);
  extent = canvas.extent();
  if (extent.columns < kScreenLeast.columns || extent.rows < kScreenLeast.rows) {
    canvas.text({0, 0}, "GIMnet demo", Ink::kTitle);
    canvas.text({0, 1}, fmt::format("needs {} x {}", kScreenLeast.columns, kScreenLeast.rows),
                Ink::kPlain);
    return canvas;
  }
  draw_title(canvas, monitor, state);
  const bool panel = extent.columns >= kPanelFromColumns && extent.rows >= kPanelFromRows;
  const bool strip = !panel && extent.rows >= kStripFromRows;
  const int picture_columns = extent.columns - (panel ? kPanelColumns : 0);
  const int picture_rows = extent.rows - 2 - (strip ? kStripRows : 0);
  draw_picture(canvas, monitor, state, {{0, 1}, {picture_columns, picture_rows}});
  if (panel)
    draw_panel(canvas, monitor, state, {{picture_columns, 1}, {kPanelColumns, picture_rows}});
  if (strip)
    draw_strip(canvas, monitor, state, {{0, 1 + picture_rows}, {extent.columns, kStripRows}});
  if (monitor.info() && monitor.info()->is_log()) {
    draw_hints(canvas, kPlayHints);
  } else {
    draw_hints(canvas, kDriveHints);
  }
  return canvas;
}

}  // namespace gimnet::demo
