#pragma once

#include <termios.h>

#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "tools/demo/ansi_writer.hpp"
#include "tools/demo/canvas.hpp"

namespace gimnet::demo {

/// The terminal of this process, taken over: keys come at once and unseen, the screen is a second
/// one, the cursor is hidden. All of that is undone when the object goes, and also when the process
/// crashes. Thread safety: one thread. Limits: one object at a time.
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

  /// What was typed since; does not wait. False: the keyboard is gone.
  [[nodiscard]] bool read(std::string& bytes);

  /// Writes all of it. What a terminal that is gone does not take is lost.
  void write(std::string_view bytes);

  /// Asks the terminal itself whether it reads UTF-8: shows a character of three bytes and asks
  /// where the cursor is now. Waits for the answer at most 300 ms; nothing if none comes.
  [[nodiscard]] std::optional<bool> understands_utf8();

 private:
  Terminal(const Ends& ends, const termios& before) : ends_(ends), before_(before) {}

  Ends ends_;
  termios before_;
};

/// What the environment says of a terminal: colours from NO_COLOR, TERM and COLORTERM; UTF-8 from
/// LC_ALL, LC_CTYPE and LANG, nothing where these do not name an encoding.
[[nodiscard]] ColourDepth colours_of_environment();
[[nodiscard]] std::optional<bool> utf8_of_environment();

}  // namespace gimnet::demo
