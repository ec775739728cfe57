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

// What a text that begins with Esc begins with. Its end may be still to come: size 0.
struct Sequence {
  std::size_t size = 0;
  bool whole = false;
};

// CSI and SS3 (ECMA-48, 5.4 and 8.3.143). A control character is in none of them: it is a key of
// its own, as is what stands behind an Esc that begins neither.
Sequence sequence_at_front(std::string_view text) {
  if (text.size() < 2) return {};
  if (text[1] != '[' && text[1] != 'O') return {1, false};
  for (std::size_t index = 2; index < text.size(); ++index) {
    const char byte = text[index];
    if (byte < ' ' || byte > '~') return {index, false};
    // F1 to F5 of the Linux console: ESC [ [ A.
    const bool second_bracket = text[1] == '[' && index == 2 && byte == '[';
    if (text[1] == 'O' || (byte >= '@' && !second_bracket)) return {index + 1, true};
    if (index + 1 == kSequenceMax) return {index + 1, false};
  }
  return {};
}

std::optional<Key> key_of_sequence(std::string_view sequence) {
  return sequence[2] == '[' ? std::nullopt : arrow_of(sequence.back());
}

}  // namespace

std::vector<Key> KeyParser::take(std::string_view bytes, std::int64_t now_ns) {
  if (!bytes.empty()) {
    pending_since_ns_ = now_ns;
  } else if (now_ns - pending_since_ns_ >= kSequencePatience_ns) {
    pending_.clear();
  }
  pending_.append(bytes);
  std::vector<Key> keys;
  std::string_view rest = pending_;
  while (!rest.empty()) {
    if (rest.front() != kEscape) {
      if (const std::optional<Key> key = key_of(rest.front())) keys.push_back(*key);
      rest.remove_prefix(1);
      continue;
    }
    const Sequence sequence = sequence_at_front(rest);
    if (sequence.size == 0) break;
    if (sequence.whole) {
      if (const std::optional<Key> key = key_of_sequence(rest.substr(0, sequence.size)))
        keys.push_back(*key);
    }
    rest.remove_prefix(sequence.size);
  }
  pending_ = std::string(rest);
  return keys;
}

}  // namespace gimnet::demo
