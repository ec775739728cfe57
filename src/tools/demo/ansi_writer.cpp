#include "tools/demo/ansi_writer.hpp"

#include <fmt/format.h>

#include <string_view>

namespace gimnet::demo {
namespace {

constexpr char32_t kBrailleFirst = U'\u2800';
constexpr char32_t kBrailleLast = U'\u28FF';

char ascii_for_dots(Ink ink) {
  switch (ink) {
    case Ink::kRobot:
      return 'O';
    case Ink::kScan:
      return '*';
    case Ink::kTrail:
      return '.';
    case Ink::kPlan:
      return '+';
    default:
      return '#';
  }
}

struct Replacement {
  char32_t code;
  char ascii;
};

constexpr Replacement kReplacements[] = {
    {U'─', '-'}, {U'│', '|'}, {U'╭', '+'}, {U'╮', '+'}, {U'╰', '+'}, {U'╯', '+'}, {U'·', '-'},
    {U'°', 'd'}, {U'µ', 'u'}, {U'←', '<'}, {U'→', '>'}, {U'↑', '^'}, {U'↓', 'v'}, {U'▁', '_'},
    {U'▂', '_'}, {U'▃', '.'}, {U'▄', '-'}, {U'▅', '-'}, {U'▆', '='}, {U'▇', '#'}, {U'█', '#'},
    {U'✓', '+'}, {U'✗', 'x'}, {U'━', '='}, {U'●', 'o'}, {U'▶', '>'}, {U'‖', '|'}, {U'×', 'x'},
    {U'–', '-'}, {U'…', '~'}, {U'├', '+'}, {U'┤', '+'},
};

// SGR parameters for 256 colours, for 16, and for none.
struct Look {
  std::string_view rich;
  std::string_view plain;
  std::string_view colourless;
};

Look look_of(Ink ink) {
  switch (ink) {
    case Ink::kPlain:
      return {"38;5;252", "", ""};
    case Ink::kDim:
      return {"38;5;244", "90", "2"};
    case Ink::kFrame:
      return {"38;5;240", "90", "2"};
    case Ink::kTitle:
      return {"1;38;5;117", "1;36", "1"};
    case Ink::kLabel:
      return {"38;5;109", "36", ""};
    case Ink::kGood:
      return {"38;5;114", "32", ""};
    case Ink::kWarn:
      return {"38;5;221", "33", "1"};
    case Ink::kBad:
      return {"1;38;5;203", "1;31", "1;7"};
    case Ink::kPlan:
      return {"38;5;238", "90", "2"};
    case Ink::kWall:
      return {"38;5;251", "37", ""};
    case Ink::kTrail:
      return {"38;5;69", "34", "2"};
    case Ink::kScan:
      return {"38;5;121", "92", ""};
    case Ink::kRobot:
      return {"1;38;5;215", "1;93", "1"};
  }
  return {};
}

std::string_view rich_ground(Ground ground) {
  switch (ground) {
    case Ground::kNone:
      return "";
    case Ground::kSeen:
      return "48;5;234";
    case Ground::kBeam:
      return "48;5;236";
    case Ground::kBar:
      return "48;5;236";
  }
  return "";
}

}  // namespace

char ascii_for(const Glyph& glyph) {
  if (glyph.code >= 0x20 && glyph.code < 0x7F) return static_cast<char>(glyph.code);
  if (glyph.code == kBrailleFirst) return ' ';
  if (glyph.code > kBrailleFirst && glyph.code <= kBrailleLast) return ascii_for_dots(glyph.ink);
  for (const Replacement& replacement : kReplacements) {
    if (replacement.code == glyph.code) return replacement.ascii;
  }
  return '?';
}

void AnsiWriter::append_glyph(std::string& out, const Glyph& glyph) const {
  if (!style_.utf8) {
    out += ascii_for(glyph);
  } else {
    append_utf8(out, glyph.code);
  }
}

std::string AnsiWriter::attributes(const Glyph& glyph) const {
  const Look look = look_of(glyph.ink);
  switch (style_.colours) {
    case ColourDepth::kNone:
      return std::string(look.colourless);
    case ColourDepth::k16:
      return std::string(look.plain);
    case ColourDepth::k256:
      break;
  }
  const std::string_view ground = rich_ground(glyph.ground);
  return fmt::format("{}{}{}", look.rich, ground.empty() ? "" : ";", ground);
}

std::string AnsiWriter::update(const Canvas& canvas) {
  const Extent extent = canvas.extent();
  const bool whole = !shown_ || !(shown_->extent() == extent);
  std::string out = whole ? "\x1b[0m\x1b[2J" : "";
  std::string current = "none yet";
  for (int row = 0; row < extent.rows; ++row) {
    bool placed = false;
    for (int column = 0; column < extent.columns; ++column) {
      const Glyph& glyph = canvas.at({column, row});
      if (!whole && shown_->at({column, row}) == glyph) {
        placed = false;
        continue;
      }
      if (!placed) out += fmt::format("\x1b[{};{}H", row + 1, column + 1);
      placed = true;
      const std::string wanted = attributes(glyph);
      if (wanted != current) out += wanted.empty() ? "\x1b[0m" : fmt::format("\x1b[0;{}m", wanted);
      current = wanted;
      append_glyph(out, glyph);
    }
  }
  if (!out.empty()) out += "\x1b[0m";
  shown_ = canvas;
  return out;
}

std::string AnsiWriter::lines(const Canvas& canvas) const {
  const Extent extent = canvas.extent();
  std::string out;
  for (int row = 0; row < extent.rows; ++row) {
    int end = extent.columns;
    const auto blank = [&](int column) {
      const char32_t code = canvas.at({column, row}).code;
      return code == U' ' || code == kBrailleFirst;
    };
    while (end > 0 && blank(end - 1)) --end;
    std::string current;
    for (int column = 0; column < end; ++column) {
      Glyph glyph = canvas.at({column, row});
      glyph.ground = Ground::kNone;
      const std::string wanted = style_.colours == ColourDepth::kNone ? "" : attributes(glyph);
      if (wanted != current) out += wanted.empty() ? "\x1b[0m" : fmt::format("\x1b[0;{}m", wanted);
      current = wanted;
      append_glyph(out, glyph);
    }
    out += current.empty() ? "\n" : "\x1b[0m\n";
  }
  return out;
}

}  // namespace gimnet::demo
