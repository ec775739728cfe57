#include "tools/demo/canvas.hpp"

#include <algorithm>

#include "base/check.hpp"

namespace gimnet::demo {
namespace {

constexpr int kExtentMax = 1000;
constexpr char32_t kReplacement = U'\uFFFD';

// The character at the front, and its bytes in `size`; kReplacement and 1 for what is no UTF-8 (RFC
// 3629).
char32_t decode_front(std::string_view text, std::size_t& size) {
  const auto byte = [&](std::size_t index) { return static_cast<unsigned char>(text[index]); };
  const unsigned char lead = byte(0);
  size = 1;
  if (lead < 0x80) return lead;
  const std::size_t length = lead >= 0xF0 ? 4 : lead >= 0xE0 ? 3 : 2;
  if (lead < 0xC2 || lead > 0xF4 || text.size() < length) return kReplacement;
  char32_t code = lead & (0x7FU >> length);
  for (std::size_t index = 1; index < length; ++index) {
    if ((byte(index) & 0xC0U) != 0x80U) return kReplacement;
    code = (code << 6U) | (byte(index) & 0x3FU);
  }
  constexpr char32_t kLeast[] = {0, 0, 0x80, 0x800, 0x10000};
  const bool surrogate = code >= 0xD800 && code <= 0xDFFF;
  if (code < kLeast[length] || code > 0x10FFFF || surrogate) return kReplacement;
  size = length;
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
  const auto add = [&text](char32_t byte) {
    text += static_cast<char>(static_cast<unsigned char>(byte));
  };
  if (code < 0x80) {
    add(code);
  } else if (code < 0x800) {
    add(0xC0 | (code >> 6U));
    add(0x80 | (code & 0x3FU));
  } else if (code < 0x10000) {
    add(0xE0 | (code >> 12U));
    add(0x80 | ((code >> 6U) & 0x3FU));
    add(0x80 | (code & 0x3FU));
  } else {
    add(0xF0 | (code >> 18U));
    add(0x80 | ((code >> 12U) & 0x3FU));
    add(0x80 | ((code >> 6U) & 0x3FU));
    add(0x80 | (code & 0x3FU));
  }
}

Canvas::Canvas(Extent extent)
    : extent_{std::clamp(extent.columns, 0, kExtentMax), std::clamp(extent.rows, 0, kExtentMax)},
      glyphs_(static_cast<std::size_t>(extent_.columns) * static_cast<std::size_t>(extent_.rows)) {}

bool Canvas::inside(Place place) const {
  return place.column >= 0 && place.row >= 0 && place.column < extent_.columns &&
         place.row < extent_.rows;
}

std::size_t Canvas::index_of(Place place) const {
  return static_cast<std::size_t>(place.row) * static_cast<std::size_t>(extent_.columns) +
         static_cast<std::size_t>(place.column);
}

const Glyph& Canvas::at(Place place) const {
  GIMNET_CHECK(inside(place));
  return glyphs_[index_of(place)];
}

void Canvas::put(Place place, const Glyph& glyph) {
  if (inside(place)) glyphs_[index_of(place)] = glyph;
}

int Canvas::text(Place place, std::string_view utf8, Ink ink) {
  for (const char32_t code : decoded_utf8(utf8)) {
    const bool control = code < 0x20 || (code >= 0x7F && code < 0xA0);
    if (inside(place)) put(place, {control ? kReplacement : code, ink, at(place).ground});
    ++place.column;
  }
  return place.column;
}

void Canvas::lay_ground(Place place, int columns, Ground ground) {
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

}  // namespace gimnet::demo
