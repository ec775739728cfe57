#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>

#include "base/mutex.hpp"
#include "client/nif/error.hpp"
#include "proto/frame/flow.hpp"

namespace gimnet::nif {

/// Round trips to the hub and the difference of the two clocks, by PING and PONG.
/// Thread safety: any thread; times are the caller's.
class HubClock {
 public:
  struct Measurement {
    std::int64_t round_trip_ns = 0;
    std::int64_t offset_ns = 0;         ///< hub's clock minus ours
    std::int64_t steady_offset_ns = 0;  ///< hub's clock minus our steady one
  };

  /// A PING that is about to be sent.
  [[nodiscard]] proto::flow::Ping ping(std::int64_t steady_ns, std::int64_t wall_ns)
      GIMNET_EXCLUDES(mutex_);
  /// A PONG. What was not asked, or was answered already, is ignored. If it contradicts the
  /// measurements before it, since a clock was set, they are forgotten.
  void on_pong(const proto::flow::Pong& pong, std::int64_t steady_ns) GIMNET_EXCLUDES(mutex_);
  /// A WELCOME said that it is `hub_ns` at the hub: what counts until a PONG says better.
  void begin(std::int64_t hub_ns, std::int64_t steady_ns) GIMNET_EXCLUDES(mutex_);
  /// The hub's time at that moment, in ns since 1970. While the connection is broken it goes on as
  /// the last hub had it. Nothing: no hub has told its time yet.
  [[nodiscard]] std::optional<std::int64_t> hub_time(std::int64_t steady_ns)
      GIMNET_EXCLUDES(mutex_);
  struct OwnTime {
    std::int64_t steady_ns = 0;
    std::int64_t error_ns = 0;  ///< half of the shortest round trip
  };
  /// The moment of this process's steady clock at which it was `hub_ns` at the hub. Nothing: no
  /// PONG came yet.
  [[nodiscard]] std::optional<OwnTime> own_time(std::int64_t hub_ns) GIMNET_EXCLUDES(mutex_);
  /// The connection broke: what is under way will not be answered, and the next hub may have
  /// another clock.
  void clear() GIMNET_EXCLUDES(mutex_);
  /// Waits for the answer to that PING. Nothing: time is up, or the connection broke.
  [[nodiscard]] std::optional<Measurement> wait_for(std::uint32_t sequence, Deadline deadline)
      GIMNET_EXCLUDES(mutex_);
  /// The last round trip, with the offset of the shortest of the last few: the one that waited
  /// least in queues.
  [[nodiscard]] std::optional<Measurement> best() GIMNET_EXCLUDES(mutex_);

 private:
  [[nodiscard]] const Measurement& shortest() const GIMNET_REQUIRES(mutex_);

  static constexpr std::size_t kKept = 8;
  static constexpr std::size_t kUnderWayMax = 64;
  struct UnderWay {
    std::int64_t steady_ns = 0;
    std::int64_t wall_ns = 0;
    std::optional<Measurement> answer;
  };

  Mutex mutex_;
  Condition changed_;
  std::uint32_t sequence_ GIMNET_GUARDED_BY(mutex_) = 0;
  std::map<std::uint32_t, UnderWay> under_way_ GIMNET_GUARDED_BY(mutex_);
  std::array<Measurement, kKept> kept_ GIMNET_GUARDED_BY(mutex_);
  std::uint64_t measured_ GIMNET_GUARDED_BY(mutex_) = 0;
  std::optional<std::int64_t> steady_offset_ns_ GIMNET_GUARDED_BY(mutex_);  ///< in use
};

}  // namespace gimnet::nif
