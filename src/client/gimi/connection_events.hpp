#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <vector>

#include "base/mutex.hpp"
#include "client/gimi/ending.hpp"
#include "client/gimi/wait_set.hpp"
#include "gimnet/gimi/node_state.hpp"

namespace gimnet::gimi {

/// Writes a line about a node to standard error if GIMNET_LOG=info asks for that. `node`: its name,
/// for people. Thread safety: any thread.
void log_info(const std::string& node, const std::string& words);

/// The events of a connection that one reader has not taken. Thread safety: any
/// thread. Limit: kEventsMax; the oldest goes, and the next one counts it as skipped.
class ConnectionQueue {
 public:
  static constexpr std::size_t kEventsMax = 64;

  [[nodiscard]] Outcome<ConnectionEvent> receive(Timeout timeout) GIMNET_EXCLUDES(mutex_);
  /// A WaitSet waits for an event here.
  void visit(const SourceVisitor& visitor) GIMNET_EXCLUDES(mutex_);
  void put(ConnectionEvent event) GIMNET_EXCLUDES(mutex_);
  void end(const Ending& ending) GIMNET_EXCLUDES(mutex_);

 private:
  Mutex mutex_;
  Condition changed_;
  WaitSource source_ GIMNET_GUARDED_BY(mutex_);
  std::deque<ConnectionEvent> events_ GIMNET_GUARDED_BY(mutex_);  ///< Limit: kEventsMax
  Ending end_ GIMNET_GUARDED_BY(mutex_);
};

/// Tells what becomes of the connection of one node: to all who read it, and on standard error if
/// GIMNET_LOG=info asks for that. Thread safety: any thread. Limit: readers are handles.
class ConnectionEvents {
 public:
  using Queue = std::shared_ptr<ConnectionQueue>;
  /// A reader, which first gets the event that was told last.
  [[nodiscard]] Queue begin() GIMNET_EXCLUDES(mutex_);
  /// Nothing comes into that queue any more.
  void remove(const Queue& queue) GIMNET_EXCLUDES(mutex_);
  /// `node`: its name, for people.
  void tell(ConnectionChange change, const std::string& node, std::string why)
      GIMNET_EXCLUDES(mutex_);
  void end(const Ending& ending) GIMNET_EXCLUDES(mutex_);

 private:
  Mutex mutex_;
  ConnectionEvent last_ GIMNET_GUARDED_BY(mutex_);
  std::vector<Queue> queues_ GIMNET_GUARDED_BY(mutex_);
  Ending end_ GIMNET_GUARDED_BY(mutex_);
};

}  // namespace gimnet::gimi
