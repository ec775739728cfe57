#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "client/nif/storage.hpp"
#include "gimnet/gimi/message.hpp"
#include "gimnet/nif.h"
#include "proto/gimi/message_header.hpp"

namespace gimnet::gimi {

/// The full name of a service, which its messages keep. Thread safety: any thread; it does not
/// change.
class ServiceName final : public nif::Storage {
 public:
  explicit ServiceName(std::string name) : text(std::move(name)) {}
  const std::string text;
};
struct ReleaseServiceName {
  void operator()(ServiceName* name) const { name->release(); }
};
using OwnedServiceName = std::unique_ptr<ServiceName, ReleaseServiceName>;

/// A message of what NIF received: takes over the storage of `in`. `service` may be null.
[[nodiscard]] Message make_message(const nif_incoming& in, const proto::gimi::MessageView& view,
                                   ServiceName* service, std::uint32_t reconnects);
/// The same of bytes without a GIMI header.
[[nodiscard]] Message make_plain_message(const nif_incoming& in, std::span<const std::byte> data,
                                         ServiceName* service, std::uint32_t reconnects);
/// The message, which was sent at that moment of the steady clock, give or take the error.
[[nodiscard]] Message born_at(Message message, std::int64_t steady_ns, std::int64_t error_ns);
/// The message, whose sender began the stream anew.
[[nodiscard]] Message begin_stream(Message message);
/// The same message once more: both keep its bytes.
[[nodiscard]] Message share(const Message& message);
/// The message, which counts in no window any more.
[[nodiscard]] Message without_count(Message message);
/// Gives the storage back to who holds NIF's message.
void disown(Message message);

/// The group and epoch in which a message counts; epoch 0: in none.
[[nodiscard]] inline std::uint32_t group_of(const Message& message) {
  return message.c_message().counted[0];
}
[[nodiscard]] inline std::uint32_t epoch_of(const Message& message) {
  return message.c_message().counted[1];
}

}  // namespace gimnet::gimi
