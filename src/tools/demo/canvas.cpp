#include "tools/demo/canvas.hpp"

#include <algorithm>
#include <cmath>

#include "base/check.hpp"
#include "proto/bitestream/utf8.hpp"

namespace gimnet::demo {
namespace {

constexpr int kExtentMax = 1000;
constexpr char32_t kReplacement = U'\uFFFD';

// The character at the front, and its bytes in `size`; kReplacement and 1 for a byte that begins
// none.
char32_t decode_front(std::string_view text, std::size_t& size) {
  const auto* bytes = reinterpret_cast<const unsigned char*>(text.data());
  const unsigned char lead = bytes[0];
  size = lead < 0x80 ? 1 : lead >= 0xF0 ? 4 : lead >= 0xE0 ? 3 : 2;
  if (size == 1) return lead;
  if (size > text.size() || !proto::bitestream::valid_utf8(bytes, size)) {
    size = 1;
    return kReplacement;
  }
  char32_t code = lead & (0x7FU >> size);
  for (std::size_t index = 1; index < size; ++index) code = (code << 6U) | (bytes[index] & 0x3FU);
  return code;
}

}  // namespace

std::u32string decoded_utf8(std::string_view text) {
  std::u32string decoded;
  while (!text.empty()) {
    std::size_t size = 1;
    decoded += decode_front(text, size);
    text.remove_prefix(size);
  }
  return decoded;
}

void append_utf8(std::string& text, char32_t code) {
  const int following = code < 0x80 ? 0 : code < 0x800 ? 1 : code < 0x10000 ? 2 : 3;
  constexpr char32_t kLeads[] = {0, 0xC0, 0xE0, 0xF0};
  text += static_cast<char>(kLeads[following] | code >> (6 * following));
  for (int left = following - 1; left >= 0; --left)
    text += static_cast<char>(0x80 | (code >> (6 * left) & 0x3F));
}

Canvas::Canvas(Extent extent)
    : extent_{std::clamp(extent.columns, 0, kExtentMax), std::clamp(extent.rows, 0, kExtentMax)},
      glyphs_(static_cast<std::size_t>(extent_.columns) * static_cast<std::size_t>(extent_.rows)) {}

bool Canvas::inside(ScreenPlace place) const {
  return place.column >= 0 && place.row >= 0 && place.column < extent_.columns &&
         place.row < extent_.rows;
}

std::size_t Canvas::index_of(ScreenPlace place) const {
  return static_cast<std::size_t>(place.row) * static_cast<std::size_t>(extent_.columns) +
         static_cast<std::size_t>(place.column);
}

const Glyph& Canvas::at(ScreenPlace place) const {
  GIMNET_CHECK(inside(place));
  return glyphs_[index_of(place)];
}

void Canvas::put(ScreenPlace place, const Glyph& glyph) {
  if (inside(place)) glyphs_[index_of(place)] = glyph;
}

int Canvas::text(ScreenPlace place, std::string_view utf8, Ink ink) {
  for (const char32_t code : decoded_utf8(utf8)) {
    const bool control = code < 0x20 || (code >= 0x7F && code < 0xA0);
    if (inside(place)) put(place, {control ? kReplacement : code, ink, at(place).ground});
    ++place.column;
  }
  return place.column;
}

void Canvas::lay_ground(ScreenPlace place, int columns, Ground ground) {
  for (int index = 0; index < columns; ++index, ++place.column) {
    if (!inside(place)) continue;
    Glyph glyph = at(place);
    glyph.ground = ground;
    put(place, glyph);
  }
}

void Canvas::frame(const Area& area) {
  const auto [corner, extent] = area;
  const int right = corner.column + extent.columns - 1;
  const int bottom = corner.row + extent.rows - 1;
  for (int column = corner.column; column <= right; ++column) {
    put({column, corner.row}, {U'─', Ink::kFrame});
    put({column, bottom}, {U'─', Ink::kFrame});
  }
  for (int row = corner.row; row <= bottom; ++row) {
    put({corner.column, row}, {U'│', Ink::kFrame});
    put({right, row}, {U'│', Ink::kFrame});
  }
  put(corner, {U'╭', Ink::kFrame});
  put({right, corner.row}, {U'╮', Ink::kFrame});
  put({corner.column, bottom}, {U'╰', Ink::kFrame});
  put({right, bottom}, {U'╯', Ink::kFrame});
}

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

Plot::Patch* Plot::patch_at(const Dot& dot) {
  const bool inside = dot.column >= 0.0 && dot.row >= 0.0 &&
                      dot.column < extent_.columns * kDotColumns &&
                      dot.row < extent_.rows * kDotRows;
  if (!inside) return nullptr;
  return &patches_[static_cast<std::size_t>(dot.row) / kDotRows *
                       static_cast<std::size_t>(extent_.columns) +
                   static_cast<std::size_t>(dot.column) / kDotColumns];
}

void Plot::set(const Dot& dot, Ink ink) {
  Patch* patch = patch_at(dot);
  if (patch == nullptr) return;
  // Bits of the braille patterns: Unicode, chapter 21.1.
  constexpr std::uint8_t kBits[kDotRows][kDotColumns] = {
      {0x01, 0x08}, {0x02, 0x10}, {0x04, 0x20}, {0x40, 0x80}};
  const std::uint8_t bit =
      kBits[static_cast<int>(dot.row) % kDotRows][static_cast<int>(dot.column) % kDotColumns];
  patch->dots = static_cast<std::uint8_t>(patch->dots | bit);
  if (ink == Ink::kRobot) patch->robot_dots = static_cast<std::uint8_t>(patch->robot_dots | bit);
  patch->ink = std::max(patch->ink, ink);
}

void Plot::dot(const Point& point, Ink ink) { set(dot_of(point), ink); }

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
      set({.column = static_cast<double>(column), .row = static_cast<double>(row)}, ink);
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
  const Box box = Box{a, a}.widened(b).widened(c);
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
  if (Patch* patch = patch_at(dot_of(point))) patch->ground = std::max(patch->ground, ground);
}

void Plot::draw(Canvas& canvas, ScreenPlace corner) const {
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
