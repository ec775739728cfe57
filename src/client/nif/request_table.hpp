#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <unordered_map>

#include "base/mutex.hpp"
#include "client/nif/error.hpp"
#include "client/nif/outbound.hpp"
#include "proto/control/control_message.hpp"

namespace gimnet::nif {

/// Matches the hub's answers with the requests that wait for them. At most proto::kOpenRequestsMax
/// are unanswered, all of them counted, since the hub closes who asks more; further callers wait. A
/// caller that waits no longer leaves its number taken until the answer or the end of the
/// connection. Thread safety: ask() from any thread but the library's; ask_later() from any; the
/// rest from the library's.
class RequestTable {
 public:
  explicit RequestTable(Outbound& outbound) : outbound_(outbound) {}

  /// Sends a request and waits for its answer, the whole payload. A connection that breaks
  /// meanwhile is waited for and asked again. NIF_TIMEOUT, NIF_NOT_CONNECTED, NIF_CLOSED,
  /// NIF_REPLACED. `payload` is a request with any number.
  [[nodiscard]] nif_status ask(proto::Kind kind, const proto::Payload& payload,
                               proto::Payload& answer, Deadline deadline, HubId hub = kOwnHub)
      GIMNET_EXCLUDES(mutex_);

  /// Gets the answer on the library's thread; not called when the connection breaks first. Not
  /// empty.
  using Handler = std::function<void(const proto::Payload& answer)>;
  /// False: no number is free, or not connected.
  [[nodiscard]] bool ask_later(proto::Kind kind, const proto::Payload& payload, Handler handler)
      GIMNET_EXCLUDES(mutex_);

  /// False: nobody asked for it.
  bool on_answer(proto::Kind kind, const proto::ControlView& answer) GIMNET_EXCLUDES(mutex_);
  /// The connection broke: no answer will come.
  void fail_all() GIMNET_EXCLUDES(mutex_);
  /// The handle closes: everybody who waits leaves.
  void close() GIMNET_EXCLUDES(mutex_);

 private:
  enum class State : std::uint8_t { waiting, answered, broken, abandoned };
  struct Open {
    proto::Kind kind = proto::Kind::ns;
    std::uint16_t operation = 0;
    State state = State::waiting;
    proto::Payload answer;
    Handler handler;
  };

  [[nodiscard]] std::size_t unanswered() const GIMNET_REQUIRES(mutex_);
  [[nodiscard]] std::optional<std::uint16_t> reserve(proto::Kind kind, std::uint16_t operation,
                                                     Handler handler) GIMNET_REQUIRES(mutex_);
  [[nodiscard]] nif_status ask_once(proto::Kind kind, const proto::Payload& payload,
                                    proto::Payload& answer, Deadline deadline, HubId hub,
                                    bool& again) GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] nif_status wait_for_number(proto::Kind kind, std::uint16_t operation,
                                           Deadline deadline, std::uint16_t& number)
      GIMNET_REQUIRES(mutex_);
  [[nodiscard]] nif_status wait_for_answer(std::uint16_t number, proto::Payload& answer,
                                           Deadline deadline, bool& again) GIMNET_REQUIRES(mutex_);

  Outbound& outbound_;

  Mutex mutex_;
  Condition changed_;
  std::unordered_map<std::uint16_t, Open> open_ GIMNET_GUARDED_BY(mutex_);
  std::uint16_t last_number_ GIMNET_GUARDED_BY(mutex_) = 0;
  bool closed_ GIMNET_GUARDED_BY(mutex_) = false;
};

}  // namespace gimnet::nif
