#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "gimnet/gimi/conversions.hpp"
#include "gimnet/gimi/namespace.hpp"
#include "gimnet/gimi/options.hpp"
#include "gimnet/gimi/outcome.hpp"

// Waiting for many things with one thread. Part of gimnet/gimi.hpp.

namespace gimnet::inline GIMNET_GIMI_NAMESPACE {

/// Subscriptions, Queues (of accepted services too), Answers, Watches, PendingReplies, Publishers
/// (whose subscribers change), ConnectionWatches and Nodes, of which wait() tells which have
/// something. It is level-triggered: a member that has something is told again and again until the
/// program took it, so no wake-up is lost. Each is in at most one set; copies are the same set, and
/// with the last copy of a member it is in none. The cost of a call does not depend on the number
/// of members. Thread safety: any thread. Limit: as many members as a process may have handles.
class WaitSet {
 public:
#if defined(__cpp_exceptions)
  /// Throws GimnetError.
  WaitSet() : WaitSet(make().or_throw()) {}
#endif
  /// Errors: limit.
  static Outcome<WaitSet> make() {
    gimi_handle handle = 0;
    const gimi_status status = gimi_wait_set_create(&handle);
    return detail::made<WaitSet>(status, handle);
  }

  /// `user` is what wait() tells of it. The set does not hold it. Errors: taken (it is in a set),
  /// closed.
  template <class Source>
  Outcome<void> add(const Source& source, std::uint64_t user) const {
    return detail::outcome_of(gimi_wait_set_add(c_handle(), source.c_handle(), user));
  }
  /// When it returns, no wait() will tell the member any more. Errors: not_found (it is not in this
  /// set), closed.
  template <class Source>
  Outcome<void> remove(const Source& source) const {
    return detail::outcome_of(gimi_wait_set_remove(c_handle(), source.c_handle()));
  }
  /// Waits until members have something; the `user` of at most 64, those first that were told
  /// longest ago. Ask them without waiting: another thread may have been faster. A member whose
  /// node was closed has its end to tell, for ever. Nothing: wake() was called. Errors: timeout,
  /// closed.
  Outcome<std::vector<std::uint64_t>> wait(Timeout timeout = kForever) const {
    std::array<gimi_ready, 64> ready;
    std::size_t count = 0;
    const gimi_status status =
        gimi_wait_set_wait(c_handle(), ready.data(), ready.size(), sizeof(gimi_ready),
                           milliseconds_of(timeout), &count);
    if (status != GIMI_OK) return failure_of(status);
    std::vector<std::uint64_t> users;
    users.reserve(count);
    for (std::size_t i = 0; i < count; ++i) users.push_back(ready[i].user);
    return users;
  }
  /// One wait() ends at once: one that waits, or else the next.
  void wake() const { static_cast<void>(gimi_wait_set_wake(c_handle())); }
  /// A descriptor for other loops: readable while wait() would not wait. The program reads nothing
  /// from it and does not close it. Errors: system.
  [[nodiscard]] Outcome<int> descriptor() const {
    std::int32_t descriptor = -1;
    const gimi_status status = gimi_wait_set_descriptor(c_handle(), &descriptor);
    if (status != GIMI_OK) return failure_of(status);
    return descriptor;
  }
  [[nodiscard]] gimi_handle c_handle() const { return handle_.value(); }

  /// Made by make().
  explicit WaitSet(detail::SharedHandle handle) : handle_(std::move(handle)) {}

 private:
  detail::SharedHandle handle_;
};

}  // namespace gimnet::inline GIMNET_GIMI_NAMESPACE
