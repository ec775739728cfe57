#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace gimnet::demo {

/// What the demo understands of a keyboard.
enum class Key : std::uint8_t {
  kForward,
  kBack,
  kLeft,
  kRight,
  kStop,
  kFaster,
  kSlower,
  kZoomIn,
  kZoomOut,
  kFit,
  kFollow,
  kTrail,
  kAutopilot,
  kHelp,
  kRedraw,
  kQuit,
};

/// Turns the bytes of a terminal into keys: letters in either case, arrows, Ctrl-C and Ctrl-L. A
/// sequence that was cut waits for its rest; unknown ones are skipped whole. Esc alone means
/// nothing, and swallows nothing but what makes a sequence of it within `kSequencePatience_ns`.
/// Thread safety: one thread.
class KeyParser {
 public:
  /// A terminal writes a sequence at once, and a network delivers it in pieces at worst; nobody
  /// types that fast.
  static constexpr std::int64_t kSequencePatience_ns = 100'000'000;

  /// What came since the last call, also nothing: that is how it learns that no more of a sequence
  /// comes. Times are of any clock that does not go back.
  [[nodiscard]] std::vector<Key> take(std::string_view bytes, std::int64_t now_ns);

 private:
  std::string pending_;
  std::int64_t pending_since_ns_ = 0;
};

}  // namespace gimnet::demo
