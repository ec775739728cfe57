#pragma once

#include <memory>
#include <vector>

#include "hub/control/conductor.hpp"
#include "hub/control/link_dialler.hpp"
#include "hub/control/listener.hpp"
#include "hub/limits.hpp"
#include "hub/observe/request_counters.hpp"
#include "hub/shard/commands.hpp"

namespace gimnet::hub {

/// The conductor's thread: waits for strangers, for what shards hand over, for deadlines and for
/// signals, and drives a Conductor with them. SIGHUP has the configuration read again; SIGTERM or
/// SIGINT drains the hub; a second one ends it at once. Thread safety: constructed, run and
/// destroyed by one thread. Lifetime: what it is wired to outlives it.
class ConductorLoop {
 public:
  struct Wiring {
    Conductor& conductor;
    ControlInbox& inbox;
    const Limits& limits;
    RefusalCounters& refusals;
    LinkDialler& dialler;
  };
  ConductorLoop(const Wiring& wiring, std::vector<std::unique_ptr<Listener>> listeners);
  ~ConductorLoop();
  ConductorLoop(const ConductorLoop&) = delete;
  ConductorLoop& operator=(const ConductorLoop&) = delete;

  /// Returns when the hub has drained and all who were told GOODBYE have left or had their time, or
  /// at a second signal.
  void run();

 private:
  struct Impl;
  const std::unique_ptr<Impl> impl_;
};

}  // namespace gimnet::hub
