#pragma once

#include <termios.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "tools/demo/canvas.hpp"

namespace gimnet::demo {

/// The number of colours of a terminal.
enum class ColourDepth : std::uint8_t { kNone, k16, k256 };

/// The abilities of a terminal.
struct TerminalStyle {
  bool utf8 = true;
  ColourDepth colours = ColourDepth::k256;
};

/// Turns canvases into the bytes that show them: plain escape sequences (ECMA-48), only for the
/// characters that changed since the canvas before. Without UTF-8 every character gets the nearest
/// of ASCII. Thread safety: one thread.
class AnsiWriter {
 public:
  explicit AnsiWriter(TerminalStyle style) : style_(style) {}

  /// The bytes that bring a terminal from the last canvas to this one; everything after redraw() or
  /// a new extent.
  [[nodiscard]] std::string update(const Canvas& canvas);
  /// The next update() draws everything: the terminal shows something else.
  void redraw() { shown_.reset(); }

  /// The canvas as lines of bare characters, without trailing blanks: for files and plain
  /// terminals.
  [[nodiscard]] std::string lines(const Canvas& canvas) const;

 private:
  void append_glyph(std::string& out, const Glyph& glyph) const;
  [[nodiscard]] std::string attributes(const Glyph& glyph) const;

  TerminalStyle style_;
  std::optional<Canvas> shown_;
};

/// The nearest ASCII character; a dotted one (braille) becomes what its ink draws.
[[nodiscard]] char ascii_for(const Glyph& glyph);

/// The terminal of this process, taken over: keys come at once and unseen, the screen is a second
/// one, the cursor is hidden. All of that is undone when the object goes. Thread safety: one
/// thread.
class Terminal {
 public:
  /// The descriptors of keyboard and screen.
  struct Ends {
    int keyboard = 0;
    int screen = 1;
  };

  /// Takes a terminal over; nothing if the ends are no terminal, or one that can do nothing
  /// (TERM=dumb).
  static std::unique_ptr<Terminal> open(const Ends& ends);

  ~Terminal();
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;

  /// Columns and rows at this moment; 80 by 24 where the terminal does not say.
  [[nodiscard]] Extent extent() const;

  /// The bytes typed since; does not wait. False: the keyboard is gone.
  [[nodiscard]] bool read(std::string& bytes);

  /// Writes all of it. The rest is lost where the terminal is gone.
  void write(std::string_view bytes);

 private:
  Terminal(const Ends& ends, const termios& before) : ends_(ends), before_(before) {}

  Ends ends_;
  termios before_;
};

/// The environment's words on a terminal: colours from NO_COLOR, TERM and COLORTERM; UTF-8 from
/// LC_ALL, LC_CTYPE and LANG, nothing if these do not name an encoding.
[[nodiscard]] ColourDepth colours_of_environment();
[[nodiscard]] std::optional<bool> utf8_of_environment();

}  // namespace gimnet::demo
