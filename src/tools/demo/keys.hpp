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

/// Turns the bytes of a terminal into keys: letters in either case, arrows, Ctrl-C and Ctrl-L. A sequence that was cut
/// waits for its rest; unknown ones are skipped whole. Thread safety: one thread.
class KeyParser {
 public:
  [[nodiscard]] std::vector<Key> take(std::string_view bytes);

 private:
  std::string pending_;
};

}  // namespace gimnet::demo
