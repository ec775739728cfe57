#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "gimnet/gimi/message.hpp"
#include "gimnet/gimi/namespace.hpp"
#include "gimnet/gimi/outcome.hpp"
#include "gimnet/gimi_requests.h"

// Requests and what becomes of them. Value types.

namespace gimnet::inline GIMNET_GIMI_NAMESPACE {

/// Whether the other program may have done the work of a request.
enum class Ran : std::int32_t { no = GIMI_RAN_NO, maybe = GIMI_RAN_MAYBE, yes = GIMI_RAN_YES };

struct RequestOptions {
  Lane lane = Lane::normal;
  /// The work may be done twice: a request whose fate nobody knows after a break is asked again,
  /// and the next program that has the service is asked if the first one has gone.
  bool repeat = false;
};

/// The end of a request: a reply, or why there is none. Thread safety: a value that can be moved;
/// one thread at a time.
class Reply {
 public:
  /// Takes over what the library gave out; `status` is its answer.
  Reply(gimi_status status, const gimi_reply& ended)
      : status_(static_cast<Status>(status)),
        sentence_(status == GIMI_OK ? "" : gimi_error_text()),
        ended_(ended) {}
  Reply(Reply&& other) noexcept
      : status_(other.status_),
        sentence_(std::move(other.sentence_)),
        ended_(std::exchange(other.ended_, {})) {}
  Reply& operator=(Reply&& other) noexcept {
    status_ = other.status_;
    sentence_ = std::move(other.sentence_);
    std::swap(ended_, other.ended_);
    return *this;
  }
  Reply(const Reply&) = delete;
  Reply& operator=(const Reply&) = delete;
  ~Reply() { gimi_reply_release(&ended_); }

  [[nodiscard]] explicit operator bool() const { return status_ == Status::ok; }
  [[nodiscard]] Status status() const { return status_; }
  [[nodiscard]] bool is(Status status) const { return status_ == status; }
  /// Why there is no reply.
  [[nodiscard]] Failure failure() const { return {status_, sentence_}; }
  [[nodiscard]] Ran ran() const { return static_cast<Ran>(ended_.ran); }
  /// Of Status::failed, as the other program chose it.
  [[nodiscard]] std::int32_t code() const { return ended_.code; }
  [[nodiscard]] Peer from() const { return {ended_.from}; }
  /// Of Status::ok. Valid until: this reply is destroyed or moved from.
  [[nodiscard]] std::span<const std::byte> data() const {
    return {static_cast<const std::byte*>(ended_.data), ended_.size};
  }
  [[nodiscard]] std::string_view text() const {
    return {static_cast<const char*>(ended_.data), ended_.size};
  }

 private:
  Status status_;
  std::string sentence_;
  gimi_reply ended_;
};

}  // namespace gimnet::inline GIMNET_GIMI_NAMESPACE
