#pragma once

#include "tools/demo/monitor.hpp"
#include "tools/demo/plot.hpp"

namespace gimnet::demo {

/// What the user chose to see.
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
void draw_scale(Canvas& canvas, Place place, const View& view);

}  // namespace gimnet::demo
