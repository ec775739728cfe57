#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <string>

#include "base/mutex.hpp"
#include "client/gimi/ending.hpp"
#include "client/gimi/uplink.hpp"
#include "client/gimi/wait_set.hpp"
#include "gimnet/gimi/handles.hpp"

namespace gimnet::gimi {

/// Events of one watch that the program has not taken. Bounded by what the hub sends unasked: a
/// frame is acknowledged when its last event was taken. Thread safety: any thread.
class WatchQueue {
 public:
  explicit WatchQueue(Uplink& uplink) : uplink_(uplink) {}

  [[nodiscard]] Outcome<WatchEvent> receive(Timeout timeout) GIMNET_EXCLUDES(mutex_);

  /// A WaitSet waits for an event here.
  void visit(const SourceVisitor& visitor) GIMNET_EXCLUDES(mutex_);
  void put(WatchEvent event, std::uint32_t watch, bool last) GIMNET_EXCLUDES(mutex_);
  void end(const Ending& ending) GIMNET_EXCLUDES(mutex_);

 private:
  struct Entry {
    WatchEvent event;
    std::uint32_t watch = 0;
    bool last = false;
  };
  /// Tells the hub, where that is due.
  [[nodiscard]] WatchEvent taken(Entry entry) const;

  Uplink& uplink_;
  Mutex mutex_;
  Condition changed_;
  WaitSource source_ GIMNET_GUARDED_BY(mutex_);
  std::deque<Entry> entries_ GIMNET_GUARDED_BY(mutex_);  ///< Limit: what the hub sends unasked
  Ending end_ GIMNET_GUARDED_BY(mutex_);
};

/// The watches of a node, by NIF's numbers. Thread safety: any thread; on_watched() from the
/// library's only.
class WatchQueues {
 public:
  explicit WatchQueues(Uplink& uplink) : uplink_(uplink) {}

  struct Begun {
    std::uint32_t number = 0;
    std::shared_ptr<WatchQueue> queue;
  };
  [[nodiscard]] Outcome<Begun> watch(const std::string& pattern, const WatchOptions& options,
                                     Timeout timeout) GIMNET_EXCLUDES(mutex_);
  void unwatch(std::uint32_t number) GIMNET_EXCLUDES(mutex_);

  /// False: not yet, a watch() has not returned.
  [[nodiscard]] bool on_watched(const nif_incoming& in) GIMNET_EXCLUDES(mutex_);
  void end(const Ending& ending) GIMNET_EXCLUDES(mutex_);

 private:
  Uplink& uplink_;
  Mutex mutex_;
  std::map<std::uint32_t, std::shared_ptr<WatchQueue>> queues_ GIMNET_GUARDED_BY(mutex_);
  std::uint32_t asking_ GIMNET_GUARDED_BY(mutex_) = 0;  ///< calls of watch() that wait for the hub
  Ending end_ GIMNET_GUARDED_BY(mutex_);
};

}  // namespace gimnet::gimi
