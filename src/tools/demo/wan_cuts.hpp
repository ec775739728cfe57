#pragma once

#include <cstdint>
#include <deque>
#include <optional>

#include "base/mutex.hpp"
#include "tools/demo/labs_view.hpp"

namespace gimnet::demo {

/// When the WAN is cut, and which losses that explains. Times are ns since 1970. Thread safety: any
/// thread. Limit: the last kCutsKept cuts explain losses.
class WanCuts {
 public:
  static constexpr std::int64_t kFirst_ns = 5'000'000'000;
  static constexpr std::int64_t kEvery_ns = 10'000'000'000;
  static constexpr std::int64_t kCut_ns = 1'200'000'000;
  /// After a cut the hubs dial, and tell each other their routes and groups.
  static constexpr std::int64_t kAfter_ns = 1'500'000'000;
  /// Sent so long before a cut, a message may still be on the WAN: three round trips of 80 ms.
  static constexpr std::int64_t kUnderWay_ns = 250'000'000;
  static constexpr std::size_t kCutsKept = 64;

  enum class Change : std::uint8_t { none, cut, back };

  /// The run begins. `seconds`: it ends so much later, before which no cut begins that would not be
  /// over by then, but for the first.
  void plan(std::int64_t now_ns, std::optional<double> seconds) GIMNET_EXCLUDES(mutex_);
  /// Begins or ends a cut that is due.
  [[nodiscard]] Change step(std::int64_t now_ns) GIMNET_EXCLUDES(mutex_);
  /// No cut begins any more.
  void stop() GIMNET_EXCLUDES(mutex_);

  /// Is the loss of a message sent at that time as it should be?
  [[nodiscard]] bool explain(std::int64_t sent_ns) const GIMNET_EXCLUDES(mutex_);
  /// There is no cut, and the last one is over for kAfter_ns.
  [[nodiscard]] bool quiet(std::int64_t now_ns) const GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] std::uint64_t count() const GIMNET_EXCLUDES(mutex_);
  /// Fills what is said of the WAN. `round_trip_ns`: of its link; nothing: not measured.
  void show(LabsView& view, std::int64_t now_ns, std::optional<std::int64_t> round_trip_ns) const
      GIMNET_EXCLUDES(mutex_);

 private:
  struct Cut {
    std::int64_t begin_ns;
    std::int64_t end_ns;  ///< kOpen: it goes on
  };
  static constexpr std::int64_t kOpen = INT64_MAX;
  static constexpr std::int64_t kNever = INT64_MAX;

  mutable Mutex mutex_;
  std::deque<Cut> cuts_ GIMNET_GUARDED_BY(mutex_);  ///< Limit: kCutsKept
  std::int64_t next_ns_ GIMNET_GUARDED_BY(mutex_) = kNever;
  std::int64_t last_ns_ GIMNET_GUARDED_BY(mutex_) = kNever;  ///< none begins after it
  std::uint64_t count_ GIMNET_GUARDED_BY(mutex_) = 0;
};

}  // namespace gimnet::demo
