#pragma once

#include <cstddef>
#include <span>
#include <string_view>

#include "generator/wire.hpp"

namespace gimnet::perf {

/// A raw client of nats-server: the text protocol of docs.nats.io, "Client Protocol", with neither
/// verbose answers nor pedantic checks. A PING after each SUB shows by its PONG that the
/// subscription stands.
class NatsWire final : public Wire {
 public:
  void open(Client& client) override;
  void provide(Client& client) override { client.is_in_group = true; }
  void subscribe(Client& client) override;
  void append_message(const Client& from, const Target& target, std::uint8_t lane,
                      std::span<const std::byte> payload, MessageBlock& block) override;
  [[nodiscard]] std::size_t take(Client& client, std::span<const std::byte> bytes) override;
  void keep_alive(Client&) override {}  // the server pings every two minutes

 private:
  void take_line(Client& client, std::string_view line);
};

}  // namespace gimnet::perf
