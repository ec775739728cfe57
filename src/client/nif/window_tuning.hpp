#pragma once

#include <cstdint>

#include "proto/frame/window.hpp"

namespace gimnet::nif {

/// The lead of a large message's sender over the bytes that came: as much as its path carries in
/// kLoopNs, so that a slow path is kept busy and nothing piles up in the queues on it.
///
/// A path whose round trip alone is longer than kLoopNs needs more, and looks the same from here as
/// one with a queue: a window's bytes take long to come. So a smaller window is only a trial. If
/// fewer bytes a second come through it, the path is long, its loop is remembered, and the former
/// window is back; after kTrustedRounds it is tried again. If as many come, there was a queue, and
/// now it is shorter.
///
/// Knows no sockets and no clock. Thread safety: one thread.
class WindowTuning {
 public:
  /// Least and most bytes ahead: four fragments, and what 1 Gbit/s carries in 67 ms.
  static constexpr std::uint32_t kWindowMin = 128 * 1024;
  static constexpr std::uint32_t kWindowMax = 8 * 1024 * 1024;
  /// From a TAKEN to the first byte that came because of it, where the path itself is not slower.
  static constexpr std::int64_t kLoopNs = 200'000'000;
  /// For so many windows a long path is believed to be one.
  static constexpr std::uint32_t kTrustedRounds = 16;

  /// In bytes, kWindowMin..kWindowMax, or the protocol's first window.
  [[nodiscard]] std::uint32_t window() const { return window_; }

  /// So many bytes came of the message until then.
  void on_received(std::uint32_t taken, std::int64_t now_ns) {
    if (received_ >= end_) return;
    received_ = taken;
    received_ns_ = now_ns;
  }
  /// A TAKEN goes out, after on_received(). Sets window() for it.
  void on_taken(std::uint32_t taken, std::int64_t now_ns);

 private:
  enum class Phase : std::uint8_t {
    first,     ///< nothing was told yet: what came so far was not waited for
    steady,    ///< each round may change the window
    draining,  ///< what the former window allowed still comes
    proving,   ///< a first round under a smaller window
    doubting,  ///< a second one, because less came in the first
  };
  [[nodiscard]] std::int64_t limit_ns() const;
  void end_round();
  void adapt(double bytes_per_ns);

  std::uint32_t window_ = proto::kWindowDefault;
  std::uint32_t allowed_ = proto::kWindowDefault;
  Phase phase_ = Phase::first;

  // A round begins with a TAKEN and lasts until the last byte came that was allowed by then: at
  // least a whole loop. On a path that is not full they come in bursts, and the next TAKEN may be
  // due in the next one only.
  std::int64_t begin_ns_ = 0;
  std::int64_t received_ns_ = 0;  ///< when received_ was reached
  std::uint32_t begin_ = 0;
  std::uint32_t received_ = 0;  ///< up to end_, and the fragment with it
  std::uint32_t end_ = UINT32_MAX;

  std::uint32_t former_ = 0;      ///< the window before the trial
  double former_rate_ = 0.0;      ///< bytes per ns that came through it
  std::int64_t path_ns_ = 0;      ///< the loop of a long path; 0: not known to be one
  std::uint32_t trust_left_ = 0;  ///< rounds for which path_ns_ is believed
};

}  // namespace gimnet::nif
