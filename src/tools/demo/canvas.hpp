#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace gimnet::demo {

/// What a character means, from which its colour follows. In a plot a later one lies over an
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

/// What lies under a character.
enum class Ground : std::uint8_t { kNone, kSeen, kBeam, kBar };

/// Character columns and rows.
struct Extent {
  int columns = 0;
  int rows = 0;
  bool operator==(const Extent&) const = default;
};

/// A place on the screen, from the left top corner.
struct Place {
  int column = 0;
  int row = 0;
};

/// A part of the screen.
struct Area {
  Place corner;
  Extent extent;
};

/// One character of the screen.
struct Glyph {
  char32_t code = U' ';
  Ink ink = Ink::kPlain;
  Ground ground = Ground::kNone;
  bool operator==(const Glyph&) const = default;
};

/// A screen full of characters, to be drawn on and then shown. What lies outside is not drawn. All
/// characters are one column wide. Thread safety: one thread.
class Canvas {
 public:
  /// Limits: 1,000 columns and rows; a larger extent is cut.
  explicit Canvas(Extent extent);

  [[nodiscard]] Extent extent() const { return extent_; }
  /// REQUIRES: inside.
  [[nodiscard]] const Glyph& at(Place place) const;

  void put(Place place, const Glyph& glyph);
  /// Writes UTF-8 from there to the right; bytes that are no UTF-8 become U+FFFD. Gives the column
  /// after it.
  int text(Place place, std::string_view utf8, Ink ink);
  /// Lays a ground under a part of a row.
  void lay_ground(Place place, int columns, Ground ground);
  /// A frame with rounded corners along the edge of the area.
  void frame(const Area& area);

 private:
  [[nodiscard]] bool inside(Place place) const;
  [[nodiscard]] std::size_t index_of(Place place) const;

  Extent extent_;
  std::vector<Glyph> glyphs_;
};

/// The characters of a UTF-8 text; bytes that are no UTF-8 become U+FFFD, each.
[[nodiscard]] std::u32string decoded_utf8(std::string_view text);

/// Appends the UTF-8 of one character. REQUIRES: a Unicode scalar value.
void append_utf8(std::string& text, char32_t code);

}  // namespace gimnet::demo
