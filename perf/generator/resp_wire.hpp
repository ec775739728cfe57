#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string_view>

#include "generator/wire.hpp"

namespace gimnet::perf {

/// A raw client of redis-server: RESP 3, so that one connection can subscribe and publish. Replies
/// are switched off once the client has joined (CLIENT REPLY OFF): the server need not answer each
/// PUBLISH; what is pushed still comes.
class RespWire final : public Wire {
 public:
  void open(Client& client) override;
  void provide(Client& client) override { client.is_in_group = true; }
  void subscribe(Client& client) override;
  void append_message(const Client& from, const Target& target, std::uint8_t lane,
                      std::span<const std::byte> payload, MessageBlock& block) override;
  [[nodiscard]] std::size_t take(Client& client, std::span<const std::byte> bytes) override;
  void keep_alive(Client&) override {}  // the server closes nobody who is silent

 private:
  /// Reads one pushed message at the beginning of `text`; its bytes, 0 when some are missing.
  [[nodiscard]] std::size_t take_message(Client& client, std::string_view text);
  void take_other(Client& client, std::string_view value);
};

}  // namespace gimnet::perf
