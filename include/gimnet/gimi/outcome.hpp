#pragma once

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <new>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

#include "gimnet/gimi/namespace.hpp"
#include "gimnet/gimi_types.h"

namespace gimnet::inline GIMNET_GIMI_NAMESPACE {

/// The longest wait of a call. 0 does not wait; kForever (any negative time) waits without a limit.
using Timeout = std::chrono::milliseconds;
inline constexpr Timeout kForever{-1};
inline constexpr Timeout kNoWait{0};

/// A timeout as the C functions take it.
[[nodiscard]] inline std::int32_t milliseconds_of(Timeout timeout) {
  if (timeout < Timeout{0}) return GIMI_FOREVER;
  return timeout.count() < INT32_MAX ? static_cast<std::int32_t>(timeout.count()) : INT32_MAX;
}
/// The same in options, where 0 means the default.
[[nodiscard]] inline std::int32_t milliseconds_in_options(Timeout timeout) {
  return timeout == Timeout{0} ? 1 : milliseconds_of(timeout);
}

/// Why a call did not do what it was asked. gimnet/gimi_types.h explains them.
enum class Status : std::int32_t {
  ok = GIMI_OK,
  timeout = GIMI_TIMEOUT,
  closed = GIMI_CLOSED,
  bad_argument = GIMI_BAD_ARGUMENT,
  no_hub = GIMI_NO_HUB,
  no_host = GIMI_NO_HOST,
  not_connected = GIMI_NOT_CONNECTED,
  bad_version = GIMI_BAD_VERSION,
  name_taken = GIMI_NAME_TAKEN,
  bad_name = GIMI_BAD_NAME,
  refused = GIMI_REFUSED,
  not_found = GIMI_NOT_FOUND,
  taken = GIMI_TAKEN,
  denied = GIMI_DENIED,
  limit = GIMI_LIMIT,
  too_large = GIMI_TOO_LARGE,
  not_delivered = GIMI_NOT_DELIVERED,
  window_full = GIMI_WINDOW_FULL,
  protocol = GIMI_PROTOCOL,
  system = GIMI_SYSTEM,
  forked = GIMI_FORKED,
  not_retained = GIMI_NOT_RETAINED,
  busy = GIMI_BUSY,
  failed = GIMI_FAILED,
  gone = GIMI_GONE,
  silence = GIMI_SILENCE,
};

/// Why a message did not arrive. gimnet/gimi_types.h explains them.
enum class LossReason : std::int32_t {
  none = GIMI_LOSS_NONE,
  no_such_node = GIMI_LOSS_NO_SUCH_NODE,
  no_route = GIMI_LOSS_NO_ROUTE,
  away = GIMI_LOSS_AWAY,
  queue_full = GIMI_LOSS_QUEUE_FULL,
  replaced = GIMI_LOSS_REPLACED,
  too_old = GIMI_LOSS_TOO_OLD,
  hop_limit = GIMI_LOSS_HOP_LIMIT,
  too_large = GIMI_LOSS_TOO_LARGE,
  not_allowed = GIMI_LOSS_NOT_ALLOWED,
  wrong_way = GIMI_LOSS_WRONG_WAY,
  link_lost = GIMI_LOSS_LINK_LOST,
  shard_full = GIMI_LOSS_SHARD_FULL,
  no_such_group = GIMI_LOSS_NO_SUCH_GROUP,
  renumbered = GIMI_LOSS_RENUMBERED,
  over_budget = GIMI_LOSS_OVER_BUDGET,
  timed_out = GIMI_LOSS_TIMED_OUT,
  cut_message = GIMI_LOSS_CUT_MESSAGE,
  no_subscriber = GIMI_LOSS_NO_SUBSCRIBER,
  malformed = GIMI_LOSS_MALFORMED,
  wrong_source = GIMI_LOSS_WRONG_SOURCE,
  link_unsure = GIMI_LOSS_LINK_UNSURE,
  not_received = GIMI_LOSS_NOT_RECEIVED,
  refused = GIMI_LOSS_REFUSED,
  connection_lost = GIMI_LOSS_CONNECTION_LOST,
  service_gone = GIMI_LOSS_SERVICE_GONE,
};

/// A short English text, for example "name taken". Static.
[[nodiscard]] inline std::string_view status_text(Status status) {
  return gimi_status_text(static_cast<gimi_status>(status));
}

/// Why there is no value: for programs a status, for people what happened, to what, and what to do.
struct Failure {
  Status status = Status::closed;
  std::string sentence;
};

#if defined(__cpp_exceptions)
/// The exception of the throwing forms of the API.
class GimnetError : public std::runtime_error {
 public:
  explicit GimnetError(Failure failure)
      : std::runtime_error(failure.sentence), failure_(std::move(failure)) {}
  [[nodiscard]] const Failure& failure() const { return failure_; }
  [[nodiscard]] Status status() const { return failure_.status; }

 private:
  Failure failure_;
};
[[noreturn]] inline void fail_without_value(const Failure& failure) { throw GimnetError(failure); }
#else
[[noreturn]] inline void fail_without_value(const Failure& failure) {
  std::fputs(failure.sentence.c_str(), stderr);
  std::abort();
}
#endif

/// The last failure of a C function in this thread.
[[nodiscard]] inline Failure failure_of(gimi_status status) {
  return {static_cast<Status>(status), gimi_error_text()};
}

/// A value, or a Failure. Calls never throw by themselves; `node.find("b").or_throw()` does.
/// Thread safety: as the value's. Errors: value() without one throws GimnetError, and
/// ends a program without exceptions, for which or_throw() is not declared.
template <class T>
class [[nodiscard]] Outcome {
 public:
  // Implicit, so that a function says `return value;` or `return failure;`.
  Outcome(T value) : ok_(true) { ::new (static_cast<void*>(&value_)) T(std::move(value)); }
  Outcome(Failure failure) : failure_(std::move(failure)) {}
  Outcome(const Outcome& other)
    requires std::is_copy_constructible_v<T>
      : ok_(other.ok_), failure_(other.failure_) {
    if (ok_) ::new (static_cast<void*>(&value_)) T(other.value_);
  }
  Outcome(Outcome&& other) noexcept : ok_(other.ok_), failure_(std::move(other.failure_)) {
    if (ok_) ::new (static_cast<void*>(&value_)) T(std::move(other.value_));
  }
  Outcome& operator=(Outcome other) noexcept {
    if (ok_) value_.~T();
    ok_ = other.ok_;
    failure_ = std::move(other.failure_);
    if (ok_) ::new (static_cast<void*>(&value_)) T(std::move(other.value_));
    return *this;
  }
  ~Outcome() {
    if (ok_) value_.~T();
  }

  [[nodiscard]] bool ok() const { return ok_; }
  [[nodiscard]] explicit operator bool() const { return ok_; }

  [[nodiscard]] T& value() & {
    check();
    return value_;
  }
  [[nodiscard]] const T& value() const& {
    check();
    return value_;
  }
#if defined(__cpp_exceptions)
  [[nodiscard]] T or_throw() && {
    check();
    return std::move(value_);
  }
#endif
  [[nodiscard]] T& operator*() & { return value(); }
  [[nodiscard]] const T& operator*() const& { return value(); }
  [[nodiscard]] T* operator->() { return &value(); }
  [[nodiscard]] const T* operator->() const { return &value(); }

  /// REQUIRES: !ok(). With a value: a Failure without words.
  [[nodiscard]] Failure failure() const { return failure_; }
  [[nodiscard]] bool is(Status status) const { return !ok_ && failure_.status == status; }

 private:
  void check() const {
    if (!ok_) fail_without_value(failure_);
  }

  bool ok_ = false;
  Failure failure_;  ///< without a value
  union {
    T value_;
  };
};

/// Done, or a Failure.
template <>
class [[nodiscard]] Outcome<void> {
 public:
  Outcome() = default;
  Outcome(Failure failure) : ok_(false), failure_(std::move(failure)) {}

  [[nodiscard]] bool ok() const { return ok_; }
  [[nodiscard]] explicit operator bool() const { return ok_; }
#if defined(__cpp_exceptions)
  void or_throw() const {
    if (!ok_) fail_without_value(failure_);
  }
#endif
  [[nodiscard]] const Failure& failure() const { return failure_; }
  [[nodiscard]] bool is(Status status) const { return !ok_ && failure_.status == status; }

 private:
  bool ok_ = true;
  Failure failure_;
};

}  // namespace gimnet::inline GIMNET_GIMI_NAMESPACE
