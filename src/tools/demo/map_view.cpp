#include "tools/demo/map_view.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

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

void draw_scan(Plot& plot, const PlacedScan& scan) {
  const double step_m = plot.view().metres_per_dot;
  for (std::size_t beam = 0; beam < scan.ranges_m.size(); ++beam) {
    const double bearing_rad =
        scan.first_bearing_rad + scan.bearing_step_rad * static_cast<double>(beam);
    const Ray ray{position(scan.pose), scan.pose.heading_rad + bearing_rad};
    const bool hit = scan.hit(beam);
    const double reach_m = hit ? static_cast<double>(scan.ranges_m[beam])
                               : std::min(OccupancyMap::kFreeWithoutHit_m, scan.range_max_m);
    const int steps = static_cast<int>(reach_m / step_m);
    for (int step = 0; step <= steps; ++step)
      plot.ground(point_along(ray, step * step_m), Ground::kBeam);
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

Box widened(const Box& box, const Point& point) {
  return {{std::min(box.least.x_m, point.x_m), std::min(box.least.y_m, point.y_m)},
          {std::max(box.most.x_m, point.x_m), std::max(box.most.y_m, point.y_m)}};
}

}  // namespace

View choose_view(const Monitor& monitor, const MapChoice& choice, Extent extent) {
  const Point robot = position(monitor.pose().value_or(Pose{}));
  View view;
  if (monitor.plan()) {
    view =
        Plot::fitted({{0.0, 0.0}, {monitor.plan()->width_m(), monitor.plan()->height_m()}}, extent);
  } else if (!monitor.seen().empty()) {
    view = Plot::fitted(widened({monitor.seen().least(), monitor.seen().most()}, robot), extent);
  } else {
    view = Plot::fitted({{robot.x_m - 5.0, robot.y_m - 5.0}, {robot.x_m + 5.0, robot.y_m + 5.0}},
                        extent);
  }
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

void draw_scale(Canvas& canvas, Place place, const View& view) {
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

}  // namespace gimnet::demo
