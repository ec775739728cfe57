#include "tools/demo/plot.hpp"

#include <algorithm>
#include <cmath>

namespace gimnet::demo {
namespace {

constexpr double kMargin = 1.06;
constexpr double kLeastBox_m = 2.0;

double cross(const Point& a, const Point& b, const Point& p) {
  return (b.x_m - a.x_m) * (p.y_m - a.y_m) - (b.y_m - a.y_m) * (p.x_m - a.x_m);
}

}  // namespace

Plot::Plot(Extent extent, const View& view)
    : extent_{std::max(0, extent.columns), std::max(0, extent.rows)},
      view_(view),
      patches_(static_cast<std::size_t>(extent_.columns) * static_cast<std::size_t>(extent_.rows)) {
}

View Plot::fitted(const Box& box, Extent extent) {
  const double dot_columns = std::max(1, extent.columns * kDotColumns);
  const double dot_rows = std::max(1, extent.rows * kDotRows);
  const double width_m = std::max(kLeastBox_m, box.most.x_m - box.least.x_m) * kMargin;
  const double height_m = std::max(kLeastBox_m, box.most.y_m - box.least.y_m) * kMargin;
  return {{(box.least.x_m + box.most.x_m) / 2.0, (box.least.y_m + box.most.y_m) / 2.0},
          std::max(width_m / dot_columns, height_m / dot_rows)};
}

Plot::Dot Plot::dot_of(const Point& point) const {
  return {
      (point.x_m - view_.centre.x_m) / view_.metres_per_dot + extent_.columns * kDotColumns / 2.0,
      (view_.centre.y_m - point.y_m) / view_.metres_per_dot + extent_.rows * kDotRows / 2.0};
}

Box Plot::seen() const {
  const double half_width_m = extent_.columns * kDotColumns / 2.0 * view_.metres_per_dot;
  const double half_height_m = extent_.rows * kDotRows / 2.0 * view_.metres_per_dot;
  return {{view_.centre.x_m - half_width_m, view_.centre.y_m - half_height_m},
          {view_.centre.x_m + half_width_m, view_.centre.y_m + half_height_m}};
}

Plot::Patch* Plot::patch_at(long column, long row) {
  if (column < 0 || row < 0) return nullptr;
  const long x = column / kDotColumns;
  const long y = row / kDotRows;
  if (x >= extent_.columns || y >= extent_.rows) return nullptr;
  return &patches_[static_cast<std::size_t>(y) * static_cast<std::size_t>(extent_.columns) +
                   static_cast<std::size_t>(x)];
}

void Plot::set(long column, long row, Ink ink) {
  Patch* patch = patch_at(column, row);
  if (patch == nullptr) return;
  // Bits of the braille patterns: Unicode, chapter 21.1.
  constexpr std::uint8_t kBits[kDotRows][kDotColumns] = {
      {0x01, 0x08}, {0x02, 0x10}, {0x04, 0x20}, {0x40, 0x80}};
  const std::uint8_t bit = kBits[row % kDotRows][column % kDotColumns];
  patch->dots = static_cast<std::uint8_t>(patch->dots | bit);
  if (ink == Ink::kRobot) patch->robot_dots = static_cast<std::uint8_t>(patch->robot_dots | bit);
  patch->ink = std::max(patch->ink, ink);
}

void Plot::dot(const Point& point, Ink ink) {
  const Dot at = dot_of(point);
  if (std::abs(at.column) > 1e6 || std::abs(at.row) > 1e6) return;
  set(static_cast<long>(std::floor(at.column)), static_cast<long>(std::floor(at.row)), ink);
}

void Plot::fill(const Box& box, Ink ink) {
  const Dot low = dot_of({box.least.x_m, box.most.y_m});
  const Dot high = dot_of({box.most.x_m, box.least.y_m});
  const auto first = [](double value, int size) {
    return static_cast<long>(std::floor(std::clamp(value, -1.0, static_cast<double>(size))));
  };
  // The end is not filled, so that neighbouring boxes do not overlap; but a box is never nothing.
  const auto last = [](double from, double to, int size) {
    const double end = std::max(std::ceil(to) - 1.0, std::floor(from));
    return static_cast<long>(std::clamp(end, -1.0, static_cast<double>(size)));
  };
  const int columns = extent_.columns * kDotColumns;
  const int rows = extent_.rows * kDotRows;
  for (long row = first(low.row, rows); row <= last(low.row, high.row, rows); ++row) {
    for (long column = first(low.column, columns); column <= last(low.column, high.column, columns);
         ++column) {
      set(column, row, ink);
    }
  }
}

void Plot::line(const Point& from, const Point& to, Ink ink) {
  const double dots = distance_m(from, to) / view_.metres_per_dot;
  if (dots > 1e5) return;
  const int steps = static_cast<int>(std::ceil(dots));
  for (int step = 0; step <= steps; ++step) {
    const double part = steps == 0 ? 0.0 : static_cast<double>(step) / steps;
    dot({from.x_m + part * (to.x_m - from.x_m), from.y_m + part * (to.y_m - from.y_m)}, ink);
  }
}

void Plot::triangle(const Point& a, const Point& b, const Point& c, Ink ink) {
  const Box box{{std::min({a.x_m, b.x_m, c.x_m}), std::min({a.y_m, b.y_m, c.y_m})},
                {std::max({a.x_m, b.x_m, c.x_m}), std::max({a.y_m, b.y_m, c.y_m})}};
  const double step_m = view_.metres_per_dot / 2.0;
  const int columns = static_cast<int>((box.most.x_m - box.least.x_m) / step_m);
  const int rows = static_cast<int>((box.most.y_m - box.least.y_m) / step_m);
  for (int row = 0; row <= rows; ++row) {
    for (int column = 0; column <= columns; ++column) {
      const Point p{box.least.x_m + column * step_m, box.least.y_m + row * step_m};
      const bool left = cross(a, b, p) >= 0 && cross(b, c, p) >= 0 && cross(c, a, p) >= 0;
      const bool right = cross(a, b, p) <= 0 && cross(b, c, p) <= 0 && cross(c, a, p) <= 0;
      if (left || right) dot(p, ink);
    }
  }
}

void Plot::ground(const Point& point, Ground ground) {
  const Dot at = dot_of(point);
  if (std::abs(at.column) > 1e6 || std::abs(at.row) > 1e6) return;
  Patch* patch =
      patch_at(static_cast<long>(std::floor(at.column)), static_cast<long>(std::floor(at.row)));
  if (patch != nullptr) patch->ground = std::max(patch->ground, ground);
}

void Plot::draw(Canvas& canvas, Place corner) const {
  std::size_t next = 0;
  for (int row = 0; row < extent_.rows; ++row) {
    for (int column = 0; column < extent_.columns; ++column) {
      const Patch& patch = patches_[next++];
      const std::uint8_t dots = patch.robot_dots != 0 ? patch.robot_dots : patch.dots;
      const char32_t code = dots == 0 ? U' ' : static_cast<char32_t>(0x2800 + dots);
      canvas.put({corner.column + column, corner.row + row}, {code, patch.ink, patch.ground});
    }
  }
}

}  // namespace gimnet::demo
