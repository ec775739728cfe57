#pragma once

#include <cstdint>
#include <vector>

#include "tools/demo/canvas.hpp"
#include "tools/demo/geometry.hpp"

namespace gimnet::demo {

/// Which part of the world a plot shows: y goes up, a dot is a square.
struct View {
  Point centre;
  double metres_per_dot = 0.1;
};

/// A rectangle of the world.
struct Box {
  Point least;
  Point most;
};

/// A picture in dots, 2 by 4 to a character: Unicode's braille patterns are a display of that
/// resolution. A character has one colour, that of the highest ink in it; the robot's dots push all
/// others out of their character. Thread safety: one thread.
class Plot {
 public:
  static constexpr int kDotColumns = 2;
  static constexpr int kDotRows = 4;

  Plot(Extent extent, const View& view);

  /// A view in which the whole box is seen, with a margin.
  [[nodiscard]] static View fitted(const Box& box, Extent extent);

  /// A dot where the point is.
  void dot(const Point& point, Ink ink);
  /// All dots within the box, at least one.
  void fill(const Box& box, Ink ink);
  /// A line of dots.
  void line(const Point& from, const Point& to, Ink ink);
  /// A filled triangle.
  void triangle(const Point& a, const Point& b, const Point& c, Ink ink);
  /// Lays a ground under the character in which the point is; a higher ground stays.
  void ground(const Point& point, Ground ground);

  [[nodiscard]] const View& view() const { return view_; }
  /// The part of the world that is seen.
  [[nodiscard]] Box seen() const;

  /// Copies the picture onto a canvas.
  void draw(Canvas& canvas, Place corner) const;

 private:
  struct Patch {
    std::uint8_t dots = 0;
    std::uint8_t robot_dots = 0;
    Ink ink = Ink::kPlain;
    Ground ground = Ground::kNone;
  };
  struct Dot {
    double column;
    double row;
  };

  [[nodiscard]] Dot dot_of(const Point& point) const;
  [[nodiscard]] Patch* patch_at(long column, long row);
  void set(long column, long row, Ink ink);

  Extent extent_;
  View view_;
  std::vector<Patch> patches_;
};

}  // namespace gimnet::demo
