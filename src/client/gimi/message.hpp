#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>

#include "gimnet/gimi/message.hpp"
#include "gimnet/nif.h"
#include "proto/gimi/message_header.hpp"

namespace gimnet {

/// How the library makes Messages of what NIF received.
struct MessageAccess {
  /// Takes over the storage of `in`, which is released with the message.
  [[nodiscard]] static Message make(const nif_incoming& in, const proto::gimi::MessageView& view,
                                    std::shared_ptr<const std::string> service,
                                    std::uint32_t reconnects);
  /// As make(), of bytes without a GIMI header.
  [[nodiscard]] static Message make_plain(const nif_incoming& in, std::span<const std::byte> data,
                                          std::shared_ptr<const std::string> service,
                                          std::uint32_t reconnects);
  static void begin_stream(Message& message) { message.begins_stream_ = true; }
  /// The group and epoch in which it counts; epoch 0: in none.
  [[nodiscard]] static std::uint32_t group_of(const Message& message) { return message.group_; }
  [[nodiscard]] static std::uint32_t epoch_of(const Message& message) { return message.epoch_; }
  /// Gives the storage back to who holds `in`.
  static void disown(Message& message) { message.storage_ = nullptr; }
};

}  // namespace gimnet
