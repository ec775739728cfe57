#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/mutex.hpp"
#include "client/gimi/ending.hpp"
#include "client/gimi/uplink.hpp"
#include "gimnet/gimi/message.hpp"
#include "gimnet/gimi/outcome.hpp"
#include "gimnet/gimi/records.hpp"

namespace gimnet::gimi {

/// PINGs of the program that wait for their PONG. Thread safety: any thread.
class PingTable {
 public:
  /// In each PING, and in the PONG that answers it.
  [[nodiscard]] std::uint32_t epoch() const { return epoch_; }
  void expect(std::uint32_t number, Peer peer) GIMNET_EXCLUDES(mutex_);
  /// The round trip, or why there is none by `deadline`, which `timeout` led to. The number is
  /// forgotten.
  [[nodiscard]] Outcome<TracedPing> wait(std::uint32_t number, std::int64_t deadline,
                                         Timeout timeout) GIMNET_EXCLUDES(mutex_);
  /// The PING was not sent.
  void forget(std::uint32_t number) GIMNET_EXCLUDES(mutex_);

  void on_pong(std::uint32_t number, Peer from, std::vector<TraceHop> way = {})
      GIMNET_EXCLUDES(mutex_);
  /// A hub dropped it, and said why.
  void on_lost(std::uint32_t number, Failure why) GIMNET_EXCLUDES(mutex_);
  /// No answer comes any more.
  void end(const Ending& ending) GIMNET_EXCLUDES(mutex_);

 private:
  struct Waiting {
    Peer peer;
    std::int64_t sent_ns = 0;
    std::optional<Outcome<TracedPing>> answer;
  };
  const std::uint32_t epoch_ = Uplink::draw_epoch();

  Mutex mutex_;
  Condition answered_;
  std::map<std::uint32_t, Waiting> waiting_ GIMNET_GUARDED_BY(mutex_);
  Ending end_ GIMNET_GUARDED_BY(mutex_);
};

}  // namespace gimnet::gimi
