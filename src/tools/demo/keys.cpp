#include "tools/demo/keys.hpp"

#include <cstddef>
#include <optional>

namespace gimnet::demo {
namespace {

constexpr char kEscape = '\x1b';
constexpr std::size_t kSequenceMax = 32;

std::optional<Key> key_of(char byte) {
  switch (byte) {
    case 'w':
    case 'W':
      return Key::kForward;
    case 's':
    case 'S':
      return Key::kBack;
    case 'a':
    case 'A':
      return Key::kLeft;
    case 'd':
    case 'D':
      return Key::kRight;
    case ' ':
      return Key::kStop;
    case ']':
    case '>':
    case '.':
      return Key::kFaster;
    case '[':
    case '<':
    case ',':
      return Key::kSlower;
    case '+':
    case '=':
      return Key::kZoomIn;
    case '-':
    case '_':
      return Key::kZoomOut;
    case '0':
      return Key::kFit;
    case 'f':
    case 'F':
      return Key::kFollow;
    case 't':
    case 'T':
      return Key::kTrail;
    case 'p':
    case 'P':
      return Key::kAutopilot;
    case 'h':
    case 'H':
    case '?':
      return Key::kHelp;
    case '\x0c':
      return Key::kRedraw;
    case 'q':
    case 'Q':
    case '\x03':
    case '\x04':
      return Key::kQuit;
    default:
      return std::nullopt;
  }
}

std::optional<Key> arrow_of(char byte) {
  switch (byte) {
    case 'A':
      return Key::kForward;
    case 'B':
      return Key::kBack;
    case 'C':
      return Key::kRight;
    case 'D':
      return Key::kLeft;
    default:
      return std::nullopt;
  }
}

// Length of the escape sequence that `text` begins with; 0 if its end is still to come (ECMA-48, 5.4).
std::size_t sequence_size(std::string_view text) {
  if (text.size() < 2) return 0;
  if (text[1] == 'O') return text.size() < 3 ? 0 : 3;
  if (text[1] != '[') return 2;
  for (std::size_t index = 2; index < text.size(); ++index) {
    if (text[index] >= '@' && text[index] <= '~') return index + 1;
  }
  return text.size() > kSequenceMax ? text.size() : 0;
}

}  // namespace

std::vector<Key> KeyParser::take(std::string_view bytes) {
  pending_.append(bytes);
  std::vector<Key> keys;
  std::string_view rest = pending_;
  while (!rest.empty()) {
    if (rest.front() != kEscape) {
      if (const std::optional<Key> key = key_of(rest.front())) keys.push_back(*key);
      rest.remove_prefix(1);
      continue;
    }
    const std::size_t size = sequence_size(rest);
    if (size == 0) break;
    const std::optional<Key> key = size >= 3 ? arrow_of(rest[size - 1]) : std::nullopt;
    if (key) keys.push_back(*key);
    rest.remove_prefix(size);
  }
  pending_ = std::string(rest);
  return keys;
}

}  // namespace gimnet::demo
