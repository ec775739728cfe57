#pragma once

#include <sys/socket.h>

#include <cstdint>
#include <memory>
#include <string>

#include "base/descriptor.hpp"
#include "base/result.hpp"
#include "impair/delayed_channel.hpp"
#include "impair/impairment.hpp"
#include "net/address.hpp"

namespace gimnet::impair {

/// A connection to the fault proxy, the one that it dialled for it, and what is between them.
/// Thread safety: the proxy's thread.
struct RelayedConnection {
  struct End {
    explicit End(int descriptor) : socket(descriptor) {}
    Descriptor socket;
    short ready = 0;  ///< what poll(2) said
  };
  /// One way: what is read at one end and written at the other.
  struct Flow {
    explicit Flow(std::uint64_t seed) : channel(seed) {}
    DelayedChannel channel;
    bool ended = false;       ///< its sender has ended, or was reset
    bool reset = false;       ///< it was reset: so is the reader, once it has what came before
    bool told = false;        ///< the reader was told of the end
    bool is_blocked = false;  ///< the reader's kernel takes nothing now
  };

  RelayedConnection(int accepted, int dialled, std::uint64_t seed)
      : client(accepted), target(dialled), up(seed), down(~seed) {}

  void end_by_reset() {
    const linger at_once{1, 0};
    for (const End* end : {&client, &target}) {
      static_cast<void>(
          ::setsockopt(end->socket.get(), SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once));
    }
    is_over = true;
  }

  End client;
  End target;
  bool is_connecting = true;
  bool is_over = false;
  Flow up;
  Flow down;
};

enum class RelayDirection : std::uint8_t {
  up,    ///< from who connects to the target
  down,  ///< back
  both
};

/// The deeds of a fault proxy since it was opened.
struct Relayed {
  std::uint64_t connections = 0;  ///< open now
  std::uint64_t accepted = 0;
  std::uint64_t refused = 0;  ///< closed at once, or the target did not answer
  std::uint64_t cut = 0;      ///< connections that were cut
  std::uint64_t stalls = 0;
  std::uint64_t up_bytes = 0;  ///< written to the target
  std::uint64_t down_bytes = 0;
};

/// Relays connections from one address to another, on a thread of its own, and does to them what a
/// bad network does. TCP carries the faults: what a network loses comes late here, never wrong or
/// in another order. Thread safety: any thread. Limits: kConnections; what a connection holds is
/// bounded by Impairment::queue_bytes() each way. Each order holds when the call returns.
class FaultProxy {
 public:
  static constexpr std::size_t kConnections = 1024;  ///< further ones wait in the listen queue

  /// Port 0 of `listen` is any free one. Equal seeds draw equal numbers. Errors: a sentence that
  /// names the address. A target that does not answer is no error: each connection to it is closed.
  [[nodiscard]] static Result<std::unique_ptr<FaultProxy>> open(const net::Address& listen,
                                                                const net::Address& target,
                                                                const Impairment& how,
                                                                std::uint64_t seed);
  ~FaultProxy();
  FaultProxy(const FaultProxy&) = delete;
  FaultProxy& operator=(const FaultProxy&) = delete;

  /// Its own address, with the port that it got.
  [[nodiscard]] const std::string& url() const;

  [[nodiscard]] Impairment impairment() const;
  /// From the next byte on; what is under way keeps its times.
  void change(const Impairment& how);
  /// Nothing gets through for `duration_ns`; DelayedChannel::kNever: until go().
  void stall(RelayDirection way, std::int64_t duration_ns);
  void go();
  /// Ends all connections as a reset does; what was under way is lost.
  void cut();
  /// While it refuses, new connections are closed at once.
  void refuse(bool all);

  [[nodiscard]] Relayed relayed() const;

 private:
  class Relay;
  explicit FaultProxy(std::unique_ptr<Relay> relay);
  std::unique_ptr<Relay> relay_;
};

}  // namespace gimnet::impair
