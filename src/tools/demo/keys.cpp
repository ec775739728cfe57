#include "tools/demo/keys.hpp"

#include <cstddef>
#include <optional>
#include <span>

namespace gimnet::demo {
namespace {

constexpr char kEscape = '\x1b';

struct Meaning {
  std::string_view bytes;  // each of which means it
  Keystroke key;
};

constexpr Meaning kMeanings[] = {
    {"wW", Keystroke::kForward},     {"sS", Keystroke::kBack},   {"aA", Keystroke::kLeft},
    {"dD", Keystroke::kRight},       {" ", Keystroke::kStop},    {"]>.", Keystroke::kFaster},
    {"[<,", Keystroke::kSlower},     {"+=", Keystroke::kZoomIn}, {"-_", Keystroke::kZoomOut},
    {"0", Keystroke::kFit},          {"fF", Keystroke::kFollow}, {"tT", Keystroke::kTrail},
    {"pP", Keystroke::kAutopilot},   {"hH?", Keystroke::kHelp},  {"\x0c", Keystroke::kRedraw},
    {"qQ\x03\x04", Keystroke::kQuit}};
constexpr Meaning kArrows[] = {{"A", Keystroke::kForward},
                               {"B", Keystroke::kBack},
                               {"C", Keystroke::kRight},
                               {"D", Keystroke::kLeft}};

std::optional<Keystroke> key_in(std::span<const Meaning> meanings, char byte) {
  for (const Meaning& meaning : meanings) {
    if (meaning.bytes.find(byte) != std::string_view::npos) return meaning.key;
  }
  return std::nullopt;
}

// Bytes of the sequence at the front of a text that begins with Esc: CSI or SS3 (ECMA-48, 5.4 and
// 8.3.143). A control character is in none of them: it is a key of its own, as is what stands
// behind an Esc that begins neither.
std::size_t sequence_size(std::string_view text) {
  if (text.size() < 2 || (text[1] != '[' && text[1] != 'O')) return 1;
  for (std::size_t index = 2; index < text.size(); ++index) {
    const char byte = text[index];
    if (byte < ' ' || byte > '~') return index;
    // F1 to F5 of the Linux console: ESC [ [ A.
    const bool second_bracket = text[1] == '[' && index == 2 && byte == '[';
    if (text[1] == 'O' || (byte >= '@' && !second_bracket)) return index + 1;
  }
  return text.size();
}

std::optional<Keystroke> key_of_sequence(std::string_view sequence) {
  if (sequence.size() < 3 || sequence[2] == '[') return std::nullopt;
  return key_in(kArrows, sequence.back());
}

}  // namespace

std::vector<Keystroke> keys_in(std::string_view bytes) {
  std::vector<Keystroke> keys;
  while (!bytes.empty()) {
    const bool escape = bytes.front() == kEscape;
    const std::size_t size = escape ? sequence_size(bytes) : 1;
    const std::optional<Keystroke> key =
        escape ? key_of_sequence(bytes.substr(0, size)) : key_in(kMeanings, bytes.front());
    if (key) keys.push_back(*key);
    bytes.remove_prefix(size);
  }
  return keys;
}

void Teleop::press(Keystroke key, std::int64_t now_ns) {
  switch (key) {
    case Keystroke::kForward:
    case Keystroke::kBack:
      linear_ = key == Keystroke::kForward ? kLinear_mps : -kLinear_mps / 2.0;
      linear_until_ns_ = now_ns + kHoldLinear_ns;
      break;
    case Keystroke::kLeft:
    case Keystroke::kRight:
      angular_ = key == Keystroke::kLeft ? kAngular_radps : -kAngular_radps;
      angular_until_ns_ = now_ns + kHoldAngular_ns;
      break;
    case Keystroke::kStop:
      linear_until_ns_ = angular_until_ns_ = now_ns;
      break;
    default:
      break;
  }
}

Twist Teleop::twist(std::int64_t now_ns) const {
  return {now_ns < linear_until_ns_ ? linear_ : 0.0, now_ns < angular_until_ns_ ? angular_ : 0.0};
}

}  // namespace gimnet::demo
