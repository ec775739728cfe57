#include "tools/demo/terminal.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstdlib>
#include <iterator>
#include <string_view>

namespace gimnet::demo {
namespace {

constexpr char32_t kBrailleFirst = U'\u2800';
constexpr char32_t kBrailleLast = U'\u28FF';

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

// SGR parameters for 256 colours, for 16, and for none; the ASCII character of a dotted one.
struct Look {
  std::string_view rich;
  std::string_view plain;
  std::string_view colourless;
  char dots = '#';
};

// In the order of Ink.
constexpr Look kLooks[] = {
    {"38;5;252", "", ""},              // kPlain
    {"38;5;244", "90", "2"},           // kDim
    {"38;5;240", "90", "2"},           // kFrame
    {"1;38;5;117", "1;36", "1"},       // kTitle
    {"38;5;109", "36", ""},            // kLabel
    {"38;5;114", "32", ""},            // kGood
    {"38;5;221", "33", "1"},           // kWarn
    {"1;38;5;203", "1;31", "1;7"},     // kBad
    {"38;5;238", "90", "2", '+'},      // kPlan
    {"38;5;251", "37", ""},            // kWall
    {"38;5;69", "34", "2", '.'},       // kTrail
    {"38;5;121", "92", "", '*'},       // kScan
    {"1;38;5;215", "1;93", "1", 'O'},  // kRobot
};
static_assert(std::size(kLooks) == static_cast<std::size_t>(Ink::kRobot) + 1);

// In the order of Ground.
constexpr std::string_view kRichGrounds[] = {"", "48;5;234", "48;5;236", "48;5;236"};

const Look& look_of(Ink ink) { return kLooks[static_cast<std::size_t>(ink)]; }

}  // namespace

char ascii_for(const Glyph& glyph) {
  if (glyph.code >= 0x20 && glyph.code < 0x7F) return static_cast<char>(glyph.code);
  if (glyph.code == kBrailleFirst) return ' ';
  if (glyph.code > kBrailleFirst && glyph.code <= kBrailleLast) return look_of(glyph.ink).dots;
  for (const Replacement& replacement : kReplacements) {
    if (replacement.code == glyph.code) return replacement.ascii;
  }
  return '?';
}

std::string AnsiWriter::attributes(const Glyph& glyph) const {
  const Look& look = look_of(glyph.ink);
  if (style_.colours == ColourDepth::kNone) return std::string(look.colourless);
  if (style_.colours == ColourDepth::k16) return std::string(look.plain);
  const std::string_view ground = kRichGrounds[static_cast<std::size_t>(glyph.ground)];
  return fmt::format("{}{}{}", look.rich, ground.empty() ? "" : ";", ground);
}

void AnsiWriter::append_glyph(std::string& out, const Glyph& glyph) const {
  if (!style_.utf8) {
    out += ascii_for(glyph);
  } else {
    append_utf8(out, glyph.code);
  }
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
  std::string out;
  for (int row = 0; row < canvas.extent().rows; ++row) {
    std::size_t end = out.size();
    for (int column = 0; column < canvas.extent().columns; ++column) {
      const Glyph& glyph = canvas.at({column, row});
      append_glyph(out, glyph);
      if (glyph.code != U' ' && glyph.code != kBrailleFirst) end = out.size();
    }
    out.resize(end);
    out += '\n';
  }
  return out;
}

namespace {

constexpr std::string_view kEnter = "\x1b[?1049h\x1b[?25l\x1b[?7l\x1b[2J";
constexpr std::string_view kLeave = "\x1b[0m\x1b[?7h\x1b[?25h\x1b[?1049l";

std::string environment(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "" : value;
}

}  // namespace

std::unique_ptr<Terminal> Terminal::open(const Ends& ends) {
  const std::string term = environment("TERM");
  if (term.empty() || term == "dumb") return nullptr;
  if (::isatty(ends.keyboard) != 1 || ::isatty(ends.screen) != 1) return nullptr;
  termios before{};
  if (::tcgetattr(ends.keyboard, &before) != 0) return nullptr;
  termios raw = before;
  // Signals off as well: Ctrl-C is a key, so that it is not lost between two programs of the
  // foreground.
  raw.c_lflag &= ~static_cast<tcflag_t>(ICANON | ECHO | ISIG | IEXTEN);
  raw.c_iflag &= ~static_cast<tcflag_t>(IXON | ICRNL | INLCR);
  raw.c_cc[VMIN] = 0;
  raw.c_cc[VTIME] = 0;
  (void)::tcsetattr(ends.keyboard, TCSANOW, &raw);
  std::unique_ptr<Terminal> terminal(new Terminal(ends, before));
  terminal->write(kEnter);
  return terminal;
}

Terminal::~Terminal() {
  write(kLeave);
  (void)::tcsetattr(ends_.keyboard, TCSAFLUSH, &before_);
}

Extent Terminal::extent() const {
  winsize size{};
  if (::ioctl(ends_.screen, TIOCGWINSZ, &size) != 0 || size.ws_col == 0 || size.ws_row == 0)
    return {80, 24};
  return {size.ws_col, size.ws_row};
}

bool Terminal::read(std::string& bytes) {
  bytes.clear();
  pollfd waiting{ends_.keyboard, POLLIN, 0};
  if (::poll(&waiting, 1, 0) <= 0) return true;
  char buffer[256];
  const ssize_t got = ::read(ends_.keyboard, buffer, sizeof buffer);
  if (got > 0) bytes.assign(buffer, static_cast<std::size_t>(got));
  return got > 0 || (got < 0 && (errno == EINTR || errno == EAGAIN));
}

void Terminal::write(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t put = ::write(ends_.screen, bytes.data(), bytes.size());
    if (put > 0) {
      bytes.remove_prefix(static_cast<std::size_t>(put));
    } else if (put < 0 && errno == EAGAIN) {
      pollfd waiting{ends_.screen, POLLOUT, 0};
      if (::poll(&waiting, 1, 1000) <= 0) return;
    } else if (put == 0 || errno != EINTR) {
      return;
    }
  }
}

ColourDepth colours_of_environment() {
  const std::string term = environment("TERM");
  if (!environment("NO_COLOR").empty() || term.empty() || term == "dumb" ||
      term.starts_with("vt")) {
    return ColourDepth::kNone;
  }
  const bool rich = term.find("256color") != std::string::npos ||
                    term.find("direct") != std::string::npos ||
                    term.find("kitty") != std::string::npos || !environment("COLORTERM").empty();
  return rich ? ColourDepth::k256 : ColourDepth::k16;
}

std::optional<bool> utf8_of_environment() {
  // The Linux console reads UTF-8, but its font has no braille.
  if (environment("TERM") == "linux") return false;
  for (const char* name : {"LC_ALL", "LC_CTYPE", "LANG"}) {
    std::string value = environment(name);
    if (value.empty()) continue;
    std::transform(value.begin(), value.end(), value.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    if (value.find("utf-8") != std::string::npos || value.find("utf8") != std::string::npos)
      return true;
    if (value.find('.') != std::string::npos) return false;
    return std::nullopt;
  }
  return std::nullopt;
}

}  // namespace gimnet::demo
