#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "generator/wire.hpp"

namespace gimnet::perf {

/// A raw MQTT client: OASIS MQTT 3.1.1, QoS 0, clean session, a keep-alive longer than any run.
class MqttWire final : public Wire {
 public:
  void open(Client& client) override;
  void provide(Client& client) override { client.is_in_group = true; }
  void subscribe(Client& client) override;
  void append_message(const Client& from, const Target& target, std::uint8_t lane,
                      std::span<const std::byte> payload, MessageBlock& block) override;
  [[nodiscard]] std::size_t take(Client& client, std::span<const std::byte> bytes) override;
  void keep_alive(Client&) override {}

 private:
  void take_packet(Client& client, std::uint8_t head, std::span<const std::byte> body);
};

}  // namespace gimnet::perf
