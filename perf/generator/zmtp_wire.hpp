#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "generator/wire.hpp"

namespace gimnet::perf {

/// Raw SUB and PUB sockets at a ZeroMQ proxy: ZMTP 3.0 (rfc.zeromq.org/spec/23), NULL security. A
/// message is one frame that begins with its topic. A client subscribes at the proxy's one address
/// and publishes, by its publishing side, at the other.
///
/// Nothing acknowledges a subscription, but the proxy forwards each new topic to every publisher:
/// client 0's publishing side, open from the beginning, hears of each client's own topic, and of a
/// second one that follows its subscription to the group, which is forwarded once only.
class ZmtpWire final : public Wire {
 public:
  void open(Client& client) override;
  void open_side(Client& side) override;
  void provide(Client& client) override { client.is_in_group = true; }
  void subscribe(Client& client) override;
  void append_message(const Client& from, const Target& target, std::uint8_t lane,
                      std::span<const std::byte> payload, MessageBlock& block) override;
  [[nodiscard]] std::size_t take(Client& client, std::span<const std::byte> bytes) override;
  void keep_alive(Client&) override {}

 private:
  struct Session {
    Client* client = nullptr;
    bool is_greeted = false;       ///< the proxy's greeting was read, by the client
    bool is_side_greeted = false;  ///< by its publishing side
  };

  Session& session_of(const Client& client);
  void take_command(Client& client, std::span<const std::byte> body);
  void take_subscription(std::span<const std::byte> body);

  std::vector<Session> sessions_;  ///< by index of the client
};

}  // namespace gimnet::perf
