#include "client/gimi/message.hpp"

#include <algorithm>
#include <utility>

#include "base/clock.hpp"
#include "client/gimi/failure.hpp"

namespace gimnet::gimi {

Message make_message(const nif_incoming& in, const proto::gimi::MessageView& view,
                     ServiceName* service, std::uint32_t reconnects) {
  const auto key = proto::gimi::StreamKey::of(in.key);
  gimi_message message{};
  message.data = view.data.data();
  message.size = view.data.size();
  message.service = "";
  if (service != nullptr) {
    service->add_reference();
    message.service = service->text.c_str();
    message.name_storage = static_cast<nif::Storage*>(service);
  }
  if (view.timestamp_ns) {
    message.sent_ns = *view.timestamp_ns;
    message.flags = GIMI_STAMPED;
  }
  message.arrival_ns = in.arrival_ns;
  message.key = {key.type, key.instance};
  message.from = in.from;
  message.sequence = view.header.sequence;
  message.reconnects = reconnects;
  message.lane = lane_number(static_cast<Lane>(in.lane));
  if (in.policy == NIF_LATEST) message.flags |= GIMI_OF_LATEST;
  message.counted[0] = in.to;
  message.counted[1] = in.epoch;
  message.storage = in.storage;
  return Message(message);
}

Message make_plain_message(const nif_incoming& in, std::span<const std::byte> data,
                           ServiceName* service, std::uint32_t reconnects) {
  proto::gimi::MessageView view;
  view.data = data;
  gimi_message message = make_message(in, view, service, reconnects).give_up();
  message.key = {};
  message.flags |= GIMI_PLAIN;
  return Message(message);
}

Message born_at(Message message, std::int64_t steady_ns, std::int64_t error_ns) {
  gimi_message aged = message.give_up();
  aged.flags |= GIMI_AGED;
  aged.born_ns = steady_ns;
  aged.born_error_ns = error_ns;
  return Message(aged);
}

Message begin_stream(Message message) {
  gimi_message begins = message.give_up();
  begins.flags |= GIMI_BEGINS_STREAM;
  return Message(begins);
}

Message share(const Message& message) {
  const gimi_message& shared = message.c_message();
  for (void* storage : {shared.storage, shared.name_storage}) {
    if (storage != nullptr) static_cast<nif::Storage*>(storage)->add_reference();
  }
  return Message(shared);
}

Message without_count(Message message) {
  gimi_message uncounted = message.give_up();
  uncounted.counted[1] = 0;
  return Message(uncounted);
}

void disown(Message message) {
  gimi_message held = message.give_up();
  held.storage = nullptr;
  gimi_message_release(&held);
}

}  // namespace gimnet::gimi

extern "C" {

gimi_status gimi_message_age(const gimi_message* message, int64_t* age_ns, int64_t* error_ns) {
  using gimnet::gimi::fail;
  if (age_ns != nullptr) *age_ns = 0;
  if (error_ns != nullptr) *error_ns = 0;
  if (message == nullptr) return fail(GIMI_BAD_ARGUMENT, "gimi_message_age(): message is NULL");
  if ((message->flags & GIMI_AGED) == 0) {
    return fail(GIMI_NOT_FOUND,
                "the age of the message is not known: it was sent without age_ms_max, or the hub "
                "has not answered a PING yet");
  }
  // The sender may be wrong by more than its message is old. Unsigned: it may say anything.
  const auto age = static_cast<std::int64_t>(static_cast<std::uint64_t>(gimnet::steady_now_ns()) -
                                             static_cast<std::uint64_t>(message->born_ns));
  if (age_ns != nullptr) *age_ns = std::max<std::int64_t>(age, 0);
  if (error_ns != nullptr) *error_ns = message->born_error_ns;
  return GIMI_OK;
}

void gimi_message_release(gimi_message* message) {
  if (message == nullptr) return;
  for (void* storage : {message->storage, message->name_storage}) {
    if (storage != nullptr) static_cast<gimnet::nif::Storage*>(storage)->release();
  }
  *message = {};
}

}  // extern "C"
