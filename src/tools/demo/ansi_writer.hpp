#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "tools/demo/canvas.hpp"

namespace gimnet::demo {

/// How many colours a terminal has.
enum class ColourDepth : std::uint8_t { kNone, k16, k256 };

/// What a terminal can show.
struct TerminalStyle {
  bool utf8 = true;
  ColourDepth colours = ColourDepth::k256;
};

/// Turns canvases into the bytes that show them: plain escape sequences (ECMA-48), only what
/// changed since the canvas before. Without UTF-8 every character gets the nearest of ASCII. Thread
/// safety: one thread.
class AnsiWriter {
 public:
  explicit AnsiWriter(TerminalStyle style) : style_(style) {}

  /// What brings a terminal that shows the last canvas to show this one; everything after redraw()
  /// or a new extent.
  [[nodiscard]] std::string update(const Canvas& canvas);
  /// The next update() draws everything: the terminal shows something else.
  void redraw() { shown_.reset(); }

  /// The canvas as lines, without cursor movements, trailing blanks and grounds: for files and
  /// plain terminals.
  [[nodiscard]] std::string lines(const Canvas& canvas) const;

 private:
  void append_glyph(std::string& out, const Glyph& glyph) const;
  [[nodiscard]] std::string attributes(const Glyph& glyph) const;

  TerminalStyle style_;
  std::optional<Canvas> shown_;
};

/// The nearest ASCII character; a dotted one (braille) becomes what its ink draws.
[[nodiscard]] char ascii_for(const Glyph& glyph);

}  // namespace gimnet::demo
