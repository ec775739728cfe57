#pragma once

#include <memory>
#include <string>

#include "gimnet/gimi/message.hpp"
#include "gimnet/nif.h"
#include "proto/gimi/message_header.hpp"

namespace gimnet {

/// How the library makes Messages of what NIF received.
struct MessageAccess {
  /// Takes over the storage of `in`, which is released with the message.
  [[nodiscard]] static Message make(const nif_incoming& in, const proto::gimi::MessageView& view,
                                    std::shared_ptr<const std::string> service);
  /// Gives the storage back to who holds `in`.
  static void disown(Message& message) { message.storage_ = nullptr; }
};

}  // namespace gimnet
