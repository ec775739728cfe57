#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/result.hpp"
#include "client/nif/endpoint.hpp"
#include "client/nif/error.hpp"
#include "client/nif/platform.hpp"
#include "client/nif/session.hpp"
#include "proto/control/link.hpp"

namespace gimnet::nif {

/// An admitted connection.
struct Admitted {
  Socket socket;
  std::string address;  ///< of the hub, as a URL
  Session session;
  std::vector<std::byte> rest;  ///< bytes of the hub that came behind WELCOME
};

/// The token to show at an address; empty: none.
using TokenFor = std::function<std::vector<std::byte>(const std::string& address)>;

/// What nif_connect() and the library's thread do to get one: dials each address in turn and shakes
/// hands, until one hub admits the node, one refuses it, or the time is up. Where several fail, the
/// last hub-less failure is told. `token_for` is asked where `hello` has no token; it may be empty.
/// Errors: those of dial() and of the hub's GOODBYE; NIF_CLOSED when `cancel` was raised.
[[nodiscard]] Result<Admitted, Failure> admit(std::span<const Endpoint> endpoints,
                                              const SocketOptions& options,
                                              const proto::Hello& hello, Deadline deadline,
                                              const WakeSignal& cancel,
                                              const TokenFor& token_for = {});

/// How long to wait before dialing again: full jitter, a random time below 50 ms, 100 ms, 200 ms
/// ... 1 s.
class Backoff {
 public:
  /// `random`: any 64 random bits.
  [[nodiscard]] std::int64_t next_ns(std::uint64_t random);
  void reset() { limit_ns_ = kFirstNs; }

 private:
  static constexpr std::int64_t kFirstNs = 50'000'000;
  static constexpr std::int64_t kLastNs = 1'000'000'000;
  std::int64_t limit_ns_ = kFirstNs;
};

}  // namespace gimnet::nif
