#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "gimnet/gimi.h"
#include "gimnet/gimi/conversions.hpp"
#include "gimnet/gimi/namespace.hpp"
#include "gimnet/gimi/requests.hpp"

// Answering services, and requests that wait for their end. Part of gimnet/gimi.hpp.

namespace gimnet::inline GIMNET_GIMI_NAMESPACE {

/// A request that the program took. It is answered once: by reply(), by fail(), or with an error
/// when it is destroyed. Thread safety: a value that can be moved; one thread at a time.
class Request {
 public:
  explicit Request(const gimi_request& taken) : request_(taken) {}
  Request(Request&& other) noexcept : request_(std::exchange(other.request_, {})) {}
  Request& operator=(Request&& other) noexcept {
    Request old(std::move(other));
    std::swap(request_, old.request_);
    return *this;
  }
  Request(const Request&) = delete;
  Request& operator=(const Request&) = delete;
  ~Request() { gimi_request_release(&request_); }

  /// Valid until: this request is destroyed or moved from.
  [[nodiscard]] std::span<const std::byte> data() const {
    return {static_cast<const std::byte*>(request_.data), request_.size};
  }
  [[nodiscard]] std::string_view text() const {
    return {static_cast<const char*>(request_.data), request_.size};
  }
  [[nodiscard]] Peer from() const { return {request_.from}; }
  /// When it was taken: so long somebody waits for the answer; negative: no limit.
  [[nodiscard]] Timeout left() const { return Timeout{request_.left_ms}; }

  /// Errors: closed (it was answered already, or the service has ended), and those of sending,
  /// after which the request is still open: it can be answered again, also by fail().
  Outcome<void> reply(BytesView data, Timeout timeout = kForever) {
    return detail::outcome_of(
        gimi_reply_to(&request_, data.data(), data.size(), milliseconds_of(timeout)));
  }
  /// `code` and `sentence` are the program's own. Errors: as reply().
  Outcome<void> fail(std::int32_t code, std::string_view sentence) {
    return detail::outcome_of(gimi_fail_request(&request_, code, detail::c_text(sentence).c_str()));
  }

 private:
  gimi_request request_;
};

/// An own service that answers requests. Copies are the same service; with the last one it ends.
class Answers {
 public:
  /// Takes the oldest request; one whose time is over is not given out. Errors: timeout, closed.
  Outcome<Request> receive(Timeout timeout = kForever) const {
    gimi_request request{};
    const gimi_status status =
        gimi_next_request(handle_.value(), milliseconds_of(timeout), &request);
    if (status != GIMI_OK) return failure_of(status);
    return Request(request);
  }

  /// For the C functions, and for a WaitSet.
  [[nodiscard]] gimi_handle c_handle() const { return handle_.value(); }

  /// Made by Node.
  explicit Answers(detail::SharedHandle handle) : handle_(std::move(handle)) {}

 private:
  detail::SharedHandle handle_;
};

namespace detail {

[[nodiscard]] inline gimi_request_options options_of(const RequestOptions& options,
                                                     Timeout timeout) {
  gimi_request_options how{};
  how.struct_size = sizeof how;
  how.timeout_ms = milliseconds_in_options(timeout);
  how.lane = lane_number(options.lane);
  how.repeat = options.repeat ? 1 : 0;
  return how;
}

}  // namespace detail

/// A request that was sent and has not ended. With its last copy it is cancelled: no reply comes.
class PendingReply {
 public:
  /// The end of the request, once; nothing if it has not ended within the time given.
  [[nodiscard]] std::optional<Reply> wait(Timeout timeout = kForever) const {
    gimi_reply ended{};
    const gimi_status status =
        gimi_wait_for_reply(handle_.value(), milliseconds_of(timeout), &ended);
    if (status == GIMI_TIMEOUT && ended.ended == 0) return std::nullopt;
    return Reply(status, ended);
  }

  /// For the C functions, and for a WaitSet.
  [[nodiscard]] gimi_handle c_handle() const { return handle_.value(); }

  /// Made by Node.
  explicit PendingReply(detail::SharedHandle handle) : handle_(std::move(handle)) {}

 private:
  detail::SharedHandle handle_;
};

}  // namespace gimnet::inline GIMNET_GIMI_NAMESPACE
