#include "tools/gimnet/paint.hpp"

#include <unistd.h>

#include <cstdlib>

namespace gimnet::tool {
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
  return Paint(::isatty(descriptor) == 1 && variable("NO_COLOR").empty() && variable("TERM") != "dumb");
}

std::string Paint::operator()(std::string_view text, Tone tone) const {
  const std::string_view escape = on_ ? escape_of(tone) : std::string_view{};
  if (escape.empty()) return std::string(text);
  return std::string(escape) + std::string(text) + "\x1b[0m";
}

std::string printable(std::string_view text) {
  std::string shown;
  for (const char letter : text) {
    const auto code = static_cast<unsigned char>(letter);
    shown += code < 0x20 || code == 0x7F ? '.' : letter;
  }
  return shown;
}

}  // namespace gimnet::tool
