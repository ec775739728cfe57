#pragma once

#include <algorithm>
#include <cstdint>

namespace gimnet::hub {

/// Whether a call that may find nothing is worth its price: tried as long as it finds something,
/// and ever more rarely while it does not, at last each kPauseMax + 1 times. Thread safety: none.
class Backoff {
 public:
  static constexpr std::uint8_t kPauseMax = 63;

  /// Asked once each time that the call could be made; if it then is, one of succeeded() and
  /// failed() follows.
  [[nodiscard]] bool is_due() {
    if (left_ == 0) return true;
    --left_;
    return false;
  }
  void succeeded() { pause_ = left_ = 0; }
  void failed() {
    left_ = pause_;
    pause_ = static_cast<std::uint8_t>(std::min(2 * pause_ + 1, int{kPauseMax}));
  }

 private:
  // Who just began has shown nothing yet.
  std::uint8_t pause_ = 7;
  std::uint8_t left_ = 7;  ///< times that it is not worth it
};

}  // namespace gimnet::hub
