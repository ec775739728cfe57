#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "tools/demo/geometry.hpp"

namespace gimnet::demo {

/// The meaning of a character, from which its colour follows. In a plot a later one lies over an
/// earlier one.
enum class Ink : std::uint8_t {
  kPlain,
  kDim,
  kFrame,
  kTitle,
  kLabel,
  kGood,
  kWarn,
  kBad,
  kPlan,   ///< walls that are known but were not seen
  kWall,   ///< what scans have seen
  kTrail,  ///< where the robot was
  kScan,   ///< what the scanner sees
  kRobot,
};

/// The background of a character.
enum class Ground : std::uint8_t { kNone, kSeen, kBeam, kBar };

/// Character columns and rows.
struct Extent {
  int columns = 0;
  int rows = 0;
  bool operator==(const Extent&) const = default;
};

/// A place on the screen, from the left top corner.
struct ScreenPlace {
  int column = 0;
  int row = 0;
};

/// A part of the screen.
struct Area {
  ScreenPlace corner;
  Extent extent;
};

/// One character of the screen.
struct Glyph {
  char32_t code = U' ';
  Ink ink = Ink::kPlain;
  Ground ground = Ground::kNone;
  bool operator==(const Glyph&) const = default;
};

/// A screen full of characters, to be drawn on and then shown. Nothing is drawn outside. All
/// characters are one column wide. Thread safety: one thread.
class Canvas {
 public:
  /// Limits: 1,000 columns and rows; a larger extent is cut.
  explicit Canvas(Extent extent);

  [[nodiscard]] Extent extent() const { return extent_; }
  /// REQUIRES: inside.
  [[nodiscard]] const Glyph& at(ScreenPlace place) const;

  void put(ScreenPlace place, const Glyph& glyph);
  /// Writes UTF-8 from there to the right; bytes that are no UTF-8 become U+FFFD. Gives the column
  /// after it.
  int text(ScreenPlace place, std::string_view utf8, Ink ink);
  /// Lays a ground under a part of a row.
  void lay_ground(ScreenPlace place, int columns, Ground ground);
  /// A frame with rounded corners along the edge of the area.
  void frame(const Area& area);

 private:
  [[nodiscard]] bool inside(ScreenPlace place) const;
  [[nodiscard]] std::size_t index_of(ScreenPlace place) const;

  Extent extent_;
  std::vector<Glyph> glyphs_;
};

/// The characters of a UTF-8 text; bytes that are no UTF-8 become U+FFFD, each.
[[nodiscard]] std::u32string decoded_utf8(std::string_view text);

/// Appends the UTF-8 of one character. REQUIRES: a Unicode scalar value.
void append_utf8(std::string& text, char32_t code);

/// The part of the world that a plot shows: y goes up, a dot is a square.
struct View {
  Point centre;
  double metres_per_dot = 0.1;
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

  /// Copies the picture onto a canvas.
  void draw(Canvas& canvas, ScreenPlace corner) const;

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
  /// Null: outside.
  [[nodiscard]] Patch* patch_at(const Dot& dot);
  void set(const Dot& dot, Ink ink);

  Extent extent_;
  View view_;
  std::vector<Patch> patches_;
};

}  // namespace gimnet::demo
