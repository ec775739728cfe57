#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

namespace gimnet::demo {

/// A point of the plane, in metres; x to the right, y up.
struct Point {
  double x_m = 0.0;
  double y_m = 0.0;
};

/// A rectangle.
struct Box {
  Point least;
  Point most;

  /// The smallest rectangle that holds this one and the point.
  [[nodiscard]] Box widened(const Point& point) const {
    return {{std::min(least.x_m, point.x_m), std::min(least.y_m, point.y_m)},
            {std::max(most.x_m, point.x_m), std::max(most.y_m, point.y_m)}};
  }
};

/// A place and the direction in which something faces: radians, counter-clockwise from the x axis.
struct Pose {
  double x_m = 0.0;
  double y_m = 0.0;
  double heading_rad = 0.0;
};

/// Speed ahead in metres a second and turning rate in radians a second, counter-clockwise positive.
struct Twist {
  double linear_mps = 0.0;
  double angular_radps = 0.0;
};

/// The same angle within (-pi, pi]. REQUIRES: `angle_rad` is finite.
[[nodiscard]] inline double normalized_angle(double angle_rad) {
  const double wrapped = std::remainder(angle_rad, 2.0 * std::numbers::pi);
  return wrapped <= -std::numbers::pi ? std::numbers::pi : wrapped;
}

/// A half-line.
struct Ray {
  Point origin;
  double heading_rad = 0.0;
};

/// The point of the ray that far from its origin, in metres.
[[nodiscard]] inline Point point_along(const Ray& ray, double distance_m) {
  return {ray.origin.x_m + distance_m * std::cos(ray.heading_rad),
          ray.origin.y_m + distance_m * std::sin(ray.heading_rad)};
}

/// Metres between two points.
[[nodiscard]] inline double distance_m(const Point& a, const Point& b) {
  return std::hypot(a.x_m - b.x_m, a.y_m - b.y_m);
}

[[nodiscard]] inline Point position(const Pose& pose) { return {pose.x_m, pose.y_m}; }

}  // namespace gimnet::demo
