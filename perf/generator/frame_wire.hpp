#pragma once

#include <cstdint>
#include <span>

#include "generator/wire.hpp"
#include "proto/frame/frame_header.hpp"

namespace gimnet::perf {

/// Messages as frames of docs/protocol.md, section 2: what the hub carries, and, byte for byte the
/// same, what goes through the null relay, so that both move the same bytes. By itself it is the
/// null relay's wire: no handshake, ids given by the order of connecting.
///
/// A payload over 4 KiB travels in fragments of 32 KiB: the fewest equal pieces of a 64 KiB message
/// that are legal, since a frame's length, at most 65,536, counts the fragment header too. Such a
/// message is below the first window (1 MiB), so that no TAKEN is needed.
class FrameWire : public Wire {
 public:
  void open(Client& client) override { admit(client); }
  void provide(Client& client) override { client.is_in_group = true; }
  void subscribe(Client& client) override { client.is_in_group = true; }
  void append_message(const Client& from, const Target& target, std::uint8_t lane,
                      std::span<const std::byte> payload, MessageBlock& block) override;
  [[nodiscard]] std::size_t take(Client& client, std::span<const std::byte> bytes) override;
  void keep_alive(Client&) override {}

 protected:
  [[nodiscard]] virtual std::uint32_t node_id(const Client& client) const;
  [[nodiscard]] virtual std::uint32_t group_id() const;
  /// A frame that is not a message for the application.
  virtual void take_other(Client& client, const proto::FrameHeader& header,
                          std::span<const std::byte> body);
  /// Appends a frame.
  static void append_frame(const proto::FrameHeader& header, std::span<const std::byte> body,
                           std::vector<std::byte>& to);

 private:
  void take_data(Client& client, const proto::FrameHeader& header, std::span<const std::byte> body);
  [[nodiscard]] proto::FrameHeader make_header(const Client& from, const Target& target,
                                               std::uint8_t lane) const;
};

}  // namespace gimnet::perf
