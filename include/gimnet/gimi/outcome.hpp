#pragma once

#include <chrono>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <variant>

namespace gimnet {

/// The longest wait of a call. 0 does not wait; kForever (any negative time) waits without a limit.
using Timeout = std::chrono::milliseconds;
inline constexpr Timeout kForever{-1};
inline constexpr Timeout kNoWait{0};

/// Why a call did not do what it was asked.
enum class Status : std::uint8_t {
  timeout,        ///< The time given was not enough. Try again.
  closed,         ///< The node was closed.
  bad_argument,   ///< A parameter is outside its range: a mistake of the program.
  no_hub,         ///< Nothing answers at the hub's address.
  no_host,        ///< No address is known for the host in the hub's URL.
  not_connected,  ///< The connection is broken at the moment.
  bad_version,    ///< The hub speaks another major version of the protocol.
  name_taken,     ///< Another live node holds the name.
  bad_name,       ///< The name breaks the rules (docs/protocol.md, section 8).
  refused,    ///< The hub is full, draining, or ended the session: kicked, or replaced by another
              ///< connection.
  not_found,  ///< No node or service of that name.
  taken,      ///< This node has such a service already.
  denied,     ///< This node may not do that.
  limit,      ///< A limit of the hub or of the library was reached.
  too_large,  ///< The message is larger than allowed.
  not_delivered,  ///< The message is known not to have arrived.
  window_full,    ///< AtFullWindow::skip: nothing was sent.
  protocol,       ///< The peer sent bytes that docs/protocol.md forbids.
  system,         ///< The operating system refused, or memory is out.
  forked,         ///< The node belongs to the parent process: after fork(), join anew in the child.
  not_retained,   ///< The message was published, but is not kept for those who subscribe later.
};

/// Why a message did not arrive.
enum class LossReason : std::uint8_t {
  none = 0,  ///< None was lost.
  // As the hub reported it: docs/protocol.md, section 5. Later hubs may have more, below 64.
  no_such_node = 1,
  no_route = 2,
  away = 3,
  queue_full = 4,
  replaced = 5,
  too_old = 6,
  hop_limit = 7,
  too_large = 8,
  not_allowed = 9,
  wrong_way = 10,
  link_lost = 11,
  shard_full = 12,
  no_such_group = 13,
  renumbered = 14,
  over_budget = 15,
  timed_out = 16,
  cut_message = 17,
  no_subscriber = 18,
  malformed = 19,
  wrong_source = 20,
  link_unsure = 22,
  // As this node knows by itself.
  not_received = 64,     ///< Its receiver answered a later question, but did not get it.
  refused = 65,          ///< Its receiver does not take it: it is too large.
  connection_lost = 66,  ///< The own connection broke, or ended.
  service_gone = 67,  ///< The service was withdrawn or is somewhere else, and cannot tell any more.
};

/// A short English text, for example "name taken". Static.
[[nodiscard]] std::string_view status_text(Status status);

/// Why there is no value: for programs a status, for people what happened, to what, and what to do.
struct Failure {
  Status status = Status::closed;
  std::string sentence;
};

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

/// A value, or a Failure. Calls never throw by themselves; `node.find("b").or_throw()` does.
/// Thread safety: as the value's. Errors: value() without one throws GimnetError.
template <class T>
class [[nodiscard]] Outcome {
 public:
  // Implicit, so that a function says `return value;` or `return failure;`.
  Outcome(T value) : state_(std::in_place_index<0>, std::move(value)) {}
  Outcome(Failure failure) : state_(std::in_place_index<1>, std::move(failure)) {}

  [[nodiscard]] bool ok() const { return state_.index() == 0; }
  [[nodiscard]] explicit operator bool() const { return ok(); }

  [[nodiscard]] T& value() & {
    check();
    return *std::get_if<0>(&state_);
  }
  [[nodiscard]] const T& value() const& {
    check();
    return *std::get_if<0>(&state_);
  }
  [[nodiscard]] T or_throw() && {
    check();
    return std::move(*std::get_if<0>(&state_));
  }
  [[nodiscard]] T& operator*() & { return value(); }
  [[nodiscard]] const T& operator*() const& { return value(); }
  [[nodiscard]] T* operator->() { return &value(); }
  [[nodiscard]] const T* operator->() const { return &value(); }

  /// REQUIRES: !ok(). With a value: a Failure without words.
  [[nodiscard]] Failure failure() const { return ok() ? Failure{} : *std::get_if<1>(&state_); }
  [[nodiscard]] bool is(Status status) const {
    return !ok() && std::get_if<1>(&state_)->status == status;
  }

 private:
  void check() const {
    if (const auto* failed = std::get_if<1>(&state_)) throw GimnetError(*failed);
  }

  std::variant<T, Failure> state_;
};

/// Done, or a Failure.
template <>
class [[nodiscard]] Outcome<void> {
 public:
  Outcome() = default;
  Outcome(Failure failure) : ok_(false), failure_(std::move(failure)) {}

  [[nodiscard]] bool ok() const { return ok_; }
  [[nodiscard]] explicit operator bool() const { return ok_; }
  void or_throw() const {
    if (!ok_) throw GimnetError(failure_);
  }
  [[nodiscard]] const Failure& failure() const { return failure_; }
  [[nodiscard]] bool is(Status status) const { return !ok_ && failure_.status == status; }

 private:
  bool ok_ = true;
  Failure failure_;
};

}  // namespace gimnet
