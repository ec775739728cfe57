#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace gimnet::demo {

/// The two laboratories as the screen shows them. A value type.
struct LabsView {
  /// A machine's odometry, or a camera's pictures, as its driver or viewer hears it.
  struct Stream {
    std::string name;
    double rate_hz = 0.0;
    std::uint64_t lost = 0;
    std::uint64_t excused = 0;  ///< of these, those that the cuts of the WAN explain
  };
  enum class Wan : std::uint8_t { up, cut, back };

  std::vector<Stream> north;
  std::vector<Stream> south;
  Wan wan = Wan::up;
  std::string wan_text;  ///< "up, 81 ms", "CUT for 1.2 s", "back"
  std::uint64_t cuts = 0;
};

}  // namespace gimnet::demo
