#pragma once

#include <algorithm>
#include <cstdint>

#include "client/nif/error.hpp"
#include "client/nif/session_terms.hpp"

namespace gimnet::nif {

/// When a connection has to say something to stay alive, and when its hub was silent for too long.
/// Time is an argument. Thread safety: the library's thread.
class KeepAliveTimer {
 public:
  /// Keep-alive intervals after which the hub's clock is measured again, however busy the node is.
  static constexpr std::int64_t kMeasureIntervals = 5;

  /// A connection begins.
  void begin(const SessionTerms& session, std::int64_t now_ns) {
    interval_ns_ = session.keep_alive_ns;
    silent_after_ns_ = session.silent_after_ns;
    heard_ns_ = tick_ns_ = now_ns;
    ping_ns_ = 0;
  }
  /// Whether this node listens from now on. Nothing was heard while it did not: the hub gets its
  /// whole time again.
  void set_reading(bool reading, std::int64_t now_ns) {
    if (reading && !reading_) heard_ns_ = now_ns;
    reading_ = reading;
  }
  [[nodiscard]] bool is_reading() const { return reading_; }
  void heard(std::int64_t now_ns) { heard_ns_ = now_ns; }
  [[nodiscard]] bool silent_for_too_long(std::int64_t now_ns) const {
    return reading_ && now_ns - heard_ns_ >= silent_after_ns_;
  }

  /// When to look again, if nothing happens. `write_ns`: of the last write, whatever it was.
  [[nodiscard]] Deadline next(std::int64_t write_ns) const {
    Deadline next = std::min(tick_ns_, write_ns) + interval_ns_;
    next = std::max(next, tick_ns_ + interval_ns_ / 4);
    return reading_ ? std::min(next, heard_ns_ + silent_after_ns_) : next;
  }
  /// Nothing can be due within a quarter of the interval.
  [[nodiscard]] bool is_early(std::int64_t now_ns) const {
    return now_ns - tick_ns_ < interval_ns_ / 4;
  }
  /// However much there is to read, the rest has to be done now.
  [[nodiscard]] bool is_late(std::int64_t now_ns) const {
    return now_ns - tick_ns_ >= interval_ns_;
  }

  /// A PING is due: nothing was written for a whole interval, or the clock is to be measured.
  [[nodiscard]] bool ping_due(std::int64_t write_ns, std::int64_t now_ns) const {
    return now_ns - write_ns >= interval_ns_ ||
           now_ns - ping_ns_ >= kMeasureIntervals * interval_ns_;
  }
  void ticked(std::int64_t now_ns) { tick_ns_ = now_ns; }
  void pinged(std::int64_t now_ns) { ping_ns_ = now_ns; }

 private:
  std::int64_t interval_ns_ = 0;
  std::int64_t silent_after_ns_ = 0;
  std::int64_t heard_ns_ = 0;
  std::int64_t tick_ns_ = 0;
  std::int64_t ping_ns_ = 0;  ///< 0: none on this connection
  bool reading_ = true;
};

}  // namespace gimnet::nif
