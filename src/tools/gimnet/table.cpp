#include "tools/gimnet/table.hpp"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <utility>

namespace gimnet::tool {

std::string decimal(double value, int places) {
  std::array<char, 400> text{};  // 309 digits of the largest double, and more
  std::snprintf(text.data(), text.size(), "%.*f", places, value);
  return text.data();
}

std::string decimal(double value) {
  std::array<char, 48> text{};
  std::snprintf(text.data(), text.size(), "%g", value);
  return text.data();
}

std::string byte_count(double bytes) {
  constexpr std::array<const char*, 4> kUnits{" kB", " MB", " GB", " TB"};
  if (bytes < 1000.0) return decimal(bytes, 0) + " B";
  std::size_t unit = 0;
  for (bytes /= 1000.0; bytes >= 999.95 && unit + 1 < kUnits.size(); ++unit) bytes /= 1000.0;
  return decimal(bytes, 1) + kUnits[unit];
}

namespace {

std::string_view variable(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? std::string_view{} : value;
}

std::string_view escape_of(Tone tone) {
  switch (tone) {
    case Tone::heading:
      return "\x1b[1m";
    case Tone::warning:
      return "\x1b[33m";
    case Tone::bad:
      return "\x1b[31m";
    case Tone::plain:
      break;
  }
  return {};
}

}  // namespace

Paint Paint::of(Colour colour, int descriptor) {
  if (colour != Colour::automatic) return Paint(colour == Colour::always);
  return Paint(::isatty(descriptor) == 1 && variable("NO_COLOR").empty() &&
               variable("TERM") != "dumb");
}

std::string Paint::operator()(std::string_view text, Tone tone) const {
  const std::string_view escape = on_ ? escape_of(tone) : std::string_view{};
  if (escape.empty()) return std::string(text);
  return std::string(escape) + std::string(text) + "\x1b[0m";
}

std::size_t control_size(std::string_view text) {
  const auto byte = [text](std::size_t i) {
    return i < text.size() ? static_cast<unsigned char>(text[i]) : 0U;
  };
  const unsigned first = byte(0);
  const unsigned second = byte(1);
  const unsigned third = byte(2);
  if (first < 0x20 || first == 0x7F) return 1;
  if (first == 0xC2 && second >= 0x80 && second <= 0x9F) return 2;
  if (first == 0xD8 && second == 0x9C) return 2;  // U+061C
  if (first != 0xE2) return 0;
  const bool marks =
      second == 0x80 && ((third >= 0x8E && third <= 0x8F) || (third >= 0xA8 && third <= 0xAE));
  const bool isolates = second == 0x81 && third >= 0xA6 && third <= 0xA9;
  return marks || isolates ? 3 : 0;
}

std::string printable(std::string_view text) {
  std::string shown;
  while (!text.empty()) {
    const std::size_t control = control_size(text);
    shown += control != 0 ? '.' : text.front();
    text.remove_prefix(std::max<std::size_t>(control, 1));
  }
  return shown;
}

void Table::add(std::vector<std::string> cells, Tone tone) {
  widths_.resize(std::max(widths_.size(), cells.size()));
  for (std::size_t i = 0; i < cells.size(); ++i) {
    cells[i] = printable(cells[i]);
    widths_[i] = std::max(widths_[i], cells[i].size());
  }
  rows_.push_back({std::move(cells), tone});
}

std::string Table::text(Paint paint) const {
  std::string text;
  for (const Row& row : rows_) {
    std::string line;
    for (std::size_t i = 0; i < row.cells.size(); ++i) {
      line += row.cells[i];
      const bool last = i + 1 == row.cells.size();
      line.append(last ? 0 : widths_[i] - row.cells[i].size() + 2, ' ');
    }
    text += paint(line, row.tone) + '\n';
  }
  return text;
}

}  // namespace gimnet::tool
