#pragma once

#include <optional>
#include <utility>

#include "gimnet/gimi.h"
#include "gimnet/gimi/conversions.hpp"
#include "gimnet/gimi/namespace.hpp"
#include "gimnet/gimi/node_state.hpp"
#include "gimnet/gimi/outcome.hpp"
#include "gimnet/gimi/records.hpp"

// Watches of names and of the own connection. Part of gimnet/gimi.hpp.

namespace gimnet::inline GIMNET_GIMI_NAMESPACE {

/// The present and the changes under a pattern of names. Events not taken wait at the hub, which
/// tells a watch that is too far behind all from the start again. Copies are the same watch;
/// with the last one it ends, as a Publisher does.
class Watch {
 public:
  /// Takes the next event. Waits if there is none. Errors: timeout, closed.
  Outcome<WatchEvent> receive(Timeout timeout = kForever) const {
    gimi_watch_event event{};
    const gimi_status status =
        gimi_watch_receive(handle_.value(), milliseconds_of(timeout), &event);
    if (status != GIMI_OK) return failure_of(status);
    return detail::event_of(event);
  }
  /// Takes the next event; nothing if there is none.
  [[nodiscard]] std::optional<WatchEvent> try_receive() const {
    gimi_watch_event event{};
    if (gimi_watch_receive(handle_.value(), 0, &event) != GIMI_OK) return std::nullopt;
    return detail::event_of(event);
  }

  /// For the C functions, and for a WaitSet.
  [[nodiscard]] gimi_handle c_handle() const { return handle_.value(); }

  /// Made by Node.
  explicit Watch(detail::SharedHandle handle) : handle_(std::move(handle)) {}

 private:
  detail::SharedHandle handle_;
};

/// The events of the connection of a node, with causes. The first event is the one that was the
/// last when this was made: it says what is. 64 wait. Copies are the same.
class ConnectionWatch {
 public:
  /// Takes the next event. Waits if there is none. Errors: timeout; when all are taken and none
  /// will come, closed, or why no connection will come.
  Outcome<ConnectionEvent> receive(Timeout timeout = kForever) const {
    gimi_connection_event event{};
    event.struct_size = sizeof event;
    const gimi_status status =
        gimi_connection_receive(handle_.value(), milliseconds_of(timeout), &event);
    if (status != GIMI_OK) return failure_of(status);
    return ConnectionEvent{static_cast<ConnectionChange>(event.change), event.skipped,
                           event.when_ns, event.why};
  }
  /// For the C functions, and for a WaitSet.
  [[nodiscard]] gimi_handle c_handle() const { return handle_.value(); }

  /// Made by Node.
  explicit ConnectionWatch(detail::SharedHandle handle) : handle_(std::move(handle)) {}

 private:
  detail::SharedHandle handle_;
};

}  // namespace gimnet::inline GIMNET_GIMI_NAMESPACE
