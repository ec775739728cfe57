#include <algorithm>
#include <cstdint>
#include <optional>
#include <vector>

#include "client/gimi/api.hpp"
#include "client/gimi/message.hpp"

// The C API: receiving.

using namespace gimnet;
using namespace gimnet::gimi;

namespace {

/// The memory of a gimi_batch.
struct BatchStorage {
  BatchStorage() = default;
  BatchStorage(const BatchStorage&) = delete;
  BatchStorage& operator=(const BatchStorage&) = delete;
  ~BatchStorage() {
    for (gimi_message& message : messages) gimi_message_release(&message);
  }
  std::vector<gimi_message> messages;
  std::vector<std::byte> bytes;
};

/// Nothing is to wait in a batch behind that message.
bool ends_batch(const gimi_message& message) {
  return message.counted[1] != 0 || (message.flags & GIMI_OF_LATEST) != 0;
}

bool is_packed(const gimi_message& message) { return message.size <= GIMI_PACKED_BYTES_MAX; }

std::size_t padded(std::size_t size) { return (size + 7) / 8 * 8; }

/// Copies the data of the small messages behind each other, and gives their memory back.
void pack(BatchStorage& storage) {
  std::size_t size = 0;
  for (const gimi_message& message : storage.messages)
    if (is_packed(message)) size += padded(message.size);
  storage.bytes.resize(size);
  std::byte* place = storage.bytes.data();
  for (gimi_message& message : storage.messages) {
    if (!is_packed(message)) continue;
    gimi_message small = message;
    if (small.size != 0) std::memcpy(place, small.data, small.size);
    message.data = place;
    message.storage = nullptr;
    small.name_storage = nullptr;  // the batch keeps that
    gimi_message_release(&small);
    place += padded(message.size);
  }
}

gimi_status receive(Source& source, std::int32_t timeout_ms, gimi_message& message) {
  auto received =
      source.core->inbox().receive(source.queue, timeout_of(timeout_ms), &source.closed);
  if (!received) return fail(received.failure());
  message = received->give_up();
  return GIMI_OK;
}

}  // namespace

extern "C" {

gimi_status gimi_queue(gimi_handle node, gimi_key key, const gimi_queue_options* options,
                       gimi_handle* queue) {
  if (queue == nullptr) return is_null("gimi_queue(): queue");
  *queue = 0;
  return with<NodeObject>(node, [&](NodeObject& found) {
    if (options == nullptr) {
      return give<QueueObject>(queue, found.core, found.core->inbox().queue(key_of(key), nullptr));
    }
    return with_options(options, "make a queue", "gimi_queue_options", [&](const auto& given) {
      QueueOptions how{given.messages};
      if (!read_at_full(given.at_full, how.at_full)) return bad_at_full();
      if (given.messages > GIMI_QUEUE_MESSAGES_MAX) return bad_length(given.messages);
      return give<QueueObject>(queue, found.core, found.core->inbox().queue(key_of(key), &how));
    });
  });
}

gimi_status gimi_receive(gimi_handle source, int32_t timeout_ms, gimi_message* message) {
  if (message == nullptr) return is_null("gimi_receive(): message");
  *message = {};
  const ObjectRef ref = find_object(source);
  if (ref.object() == nullptr) return no_object(ref);
  return guarded([&]() -> gimi_status {
    switch (ref.kind()) {
      case HandleKind::subscription:
      case HandleKind::queue:
      case HandleKind::accepted:
        return receive(static_cast<Source&>(*ref.object()), timeout_ms, *message);
      case HandleKind::node: {
        Core& core = *static_cast<NodeObject*>(ref.object())->core;
        auto received = core.inbox().receive_any(timeout_of(timeout_ms));
        if (!received) return fail(received.failure());
        *message = received->give_up();
        return GIMI_OK;
      }
      default:
        return no_object(ref);
    }
  });
}

gimi_status gimi_receive_newest(gimi_handle source, gimi_message* message) {
  if (message == nullptr) return is_null("gimi_receive_newest(): message");
  *message = {};
  return with_source(source, [&](Source& found) -> gimi_status {
    auto newest = found.core->inbox().take_newest(found.queue);
    if (!newest) return fail(GIMI_TIMEOUT, "nothing waits there");
    *message = newest->give_up();
    return GIMI_OK;
  });
}

gimi_status gimi_receive_packed(gimi_handle source, uint32_t messages_max, int32_t timeout_ms,
                                gimi_batch* batch) {
  if (batch == nullptr) return is_null("gimi_receive_packed(): batch");
  *batch = {};
  if (messages_max == 0) return fail(GIMI_BAD_ARGUMENT, "messages_max is 0");
  return with_source(source, [&](Source& found) -> gimi_status {
    auto storage = std::make_unique<BatchStorage>();
    const std::uint32_t most = std::min<std::uint32_t>(messages_max, GIMI_BATCH_MESSAGES_MAX);
    storage->messages.reserve(most);
    gimi_message message{};
    const gimi_status status = receive(found, timeout_ms, message);
    if (status != GIMI_OK) return status;
    storage->messages.push_back(message);
    while (storage->messages.size() < most && !ends_batch(storage->messages.back())) {
      auto next = found.core->inbox().try_receive(found.queue);
      if (!next) break;
      storage->messages.push_back(next->give_up());
    }
    pack(*storage);
    *batch = {static_cast<std::uint32_t>(storage->messages.size()),
              sizeof(gimi_message),
              storage->messages.data(),
              storage->bytes.data(),
              storage->bytes.size(),
              nullptr};
    batch->storage = storage.release();
    return GIMI_OK;
  });
}

void gimi_batch_release(gimi_batch* batch) {
  if (batch == nullptr) return;
  delete static_cast<BatchStorage*>(batch->storage);
  *batch = {};
}

gimi_status gimi_resize(gimi_handle source, size_t messages) {
  return with_source(source, [&](Source& found) -> gimi_status {
    if (messages > GIMI_QUEUE_MESSAGES_MAX) return bad_length(messages);
    found.core->inbox().resize(found.queue, messages);
    return GIMI_OK;
  });
}

gimi_status gimi_counts(gimi_handle source, gimi_queue_counts* counts) {
  const ObjectRef ref = find_object(source);
  return with_source(source, [&](Source& found) -> gimi_status {
    if (!nif::has_size(counts)) return is_null("gimi_counts(): counts, or its struct_size,");
    const Inbox::Counts now = found.core->inbox().counts(found.queue);
    std::uint64_t missed = 0;
    if (ref.kind() == HandleKind::subscription) {
      const ServiceTable::Reading& reading = static_cast<SubscriptionObject&>(found).reading;
      missed = reading.service->missed(*reading.subscriber) + now.overwritten + now.left_out;
    }
    nif::write_struct(gimi_queue_counts{sizeof(gimi_queue_counts), now.size, now.received,
                                        now.overwritten, missed},
                      *counts);
    return GIMI_OK;
  });
}

}  // extern "C"
