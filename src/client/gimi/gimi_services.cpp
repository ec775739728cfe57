#include <algorithm>
#include <memory>
#include <string>

#include "base/byte_buffer.hpp"
#include "client/gimi/api.hpp"

// The C API: services that give data.

using namespace gimnet;
using namespace gimnet::gimi;

namespace {

/// Empty, or what is wrong with the wishes of a subscriber. The hub would not see it: of several
/// subscriptions for one name it is told the widest.
std::string fault_of(const gimi_subscribe_options& given) {
  constexpr double kRateMin = 0.001;
  constexpr double kRateMax = 1000.0;
  constexpr std::uint32_t kWindowMax = 1024;
  constexpr std::uint32_t kDepthMax = 64;
  // Not a number is outside of every range.
  if (given.rate_hz != 0.0 && !(given.rate_hz >= kRateMin && given.rate_hz <= kRateMax))
    return "rate_hz is " + std::to_string(given.rate_hz) + ", not 0.001 to 1,000 or 0: no bound";
  if (given.window > kWindowMax) return "window is over 1,024";
  if (given.depth > kDepthMax) return "depth is over 64";
  if (given.queue > GIMI_QUEUE_MESSAGES_MAX) return too_long(given.queue);
  if (given.silence_ms < 0) return "silence_ms is negative; 0 is without an answer";
  if (given.newest_only != 0 && given.queue > 1) {
    return "newest_only keeps one message, so that a queue of " + std::to_string(given.queue) +
           " has no use; leave one of them out";
  }
  return {};
}

}  // namespace

extern "C" {

gimi_status gimi_advertise(gimi_handle node, const char* name, const gimi_publish_options* options,
                           gimi_handle* publisher) {
  if (publisher != nullptr) *publisher = 0;
  if (name == nullptr || publisher == nullptr)
    return is_null("gimi_advertise(): name or publisher");
  return with<NodeObject>(node, [&](NodeObject& found) {
    return with_options(options, "advertise", "gimi_publish_options", [&](const auto& given) {
      PublishOptions how;
      how.key = key_of(given.key);
      if (!read_lane(given.lane, how.lane)) return bad_lane(given.lane);
      if (given.delivery < GIMI_STREAM || given.delivery > GIMI_SYNC)
        return fail(GIMI_BAD_ARGUMENT, "there is no delivery " + std::to_string(given.delivery));
      how.delivery = static_cast<Delivery>(given.delivery);
      if (given.window != 0) how.window = given.window;
      how.retain = given.retain != 0;
      how.timestamp = given.no_timestamp == 0;
      how.metadata = text_of(given.metadata);
      how.age_ms_max = given.age_ms_max;
      const auto service = found.core->services().advertise(found.core->state().name, name, how,
                                                            timeout_in_options(given.timeout_ms));
      if (!service) return fail(service.failure());
      return give<PublisherObject>(publisher, found.core, **service);
    });
  });
}

gimi_status gimi_publish(gimi_handle publisher, const void* data, size_t size, int32_t timeout_ms,
                         int32_t more) {
  if (data == nullptr && size != 0) return is_null("gimi_publish(): data");
  return with<PublisherObject>(publisher, [&](PublisherObject& found) {
    return answer(found.service.publish(bytes_of(data, size), timeout_of(timeout_ms),
                                        more != 0 ? More::yes : More::no));
  });
}

gimi_status gimi_publish_many(gimi_handle publisher, const gimi_bytes* messages, size_t count,
                              int32_t timeout_ms, size_t* published) {
  if (published != nullptr) *published = 0;
  if (messages == nullptr && count != 0) return is_null("gimi_publish_many(): messages");
  return with<PublisherObject>(publisher, [&](PublisherObject& found) -> gimi_status {
    for (std::size_t i = 0; i < count; ++i) {
      const gimi_bytes& message = messages[i];
      if (message.data == nullptr && message.size != 0) return is_null("data of a message");
      const auto sent = found.service.publish(bytes_of(&message), timeout_of(timeout_ms),
                                              i + 1 < count ? More::yes : More::no);
      if (!sent) {
        static_cast<void>(nif_flush(found.core->node()));
        return fail(sent.failure());
      }
      if (published != nullptr) ++*published;
    }
    return GIMI_OK;
  });
}

gimi_status gimi_loan(gimi_handle publisher, size_t size, gimi_loaned* loan) {
  if (loan == nullptr) return is_null("gimi_loan(): loan");
  *loan = {};
  return with<PublisherObject>(publisher, [&](PublisherObject&) -> gimi_status {
    if (size > GIMI_MESSAGE_BYTES_MAX)
      return fail(GIMI_TOO_LARGE, "cannot lend " + std::to_string(size) + " bytes: at most 1 GiB");
    auto memory = std::make_unique<ByteBuffer>();
    if (!memory->reserve(std::max<std::size_t>(size, 1)))
      return fail(GIMI_SYSTEM, "no memory to lend " + std::to_string(size) + " bytes");
    loan->data = memory->data();
    loan->size = size;
    loan->storage = memory.release();
    return GIMI_OK;
  });
}

gimi_status gimi_publish_loan(gimi_handle publisher, gimi_loaned* loan, int32_t timeout_ms,
                              int32_t more) {
  if (loan == nullptr || loan->storage == nullptr) return is_null("gimi_publish_loan(): loan");
  if (loan->size > static_cast<ByteBuffer*>(loan->storage)->capacity())
    return fail(GIMI_BAD_ARGUMENT, "cannot publish the loan: its size is more than was lent");
  const gimi_status status = gimi_publish(publisher, loan->data, loan->size, timeout_ms, more);
  if (status == GIMI_OK || status == GIMI_NOT_RETAINED) gimi_loan_release(loan);
  return status;
}

void gimi_loan_release(gimi_loaned* loan) {
  if (loan == nullptr) return;
  delete static_cast<ByteBuffer*>(loan->storage);
  *loan = {};
}

size_t gimi_subscribers(gimi_handle publisher) {
  size_t count = 0;
  static_cast<void>(with<PublisherObject>(publisher, [&](PublisherObject& found) -> gimi_status {
    count = found.service.subscribers();
    return GIMI_OK;
  }));
  return count;
}

gimi_status gimi_wait_for_subscribers(gimi_handle publisher, size_t count, int32_t timeout_ms) {
  return with<PublisherObject>(publisher, [&](PublisherObject& found) {
    return answer(found.service.wait_for_subscribers(count, timeout_of(timeout_ms)));
  });
}

gimi_status gimi_subscribers_changed(gimi_handle publisher, int32_t timeout_ms, size_t* count) {
  if (count == nullptr) return is_null("gimi_subscribers_changed(): count");
  *count = 0;
  return with<PublisherObject>(publisher, [&](PublisherObject& found) -> gimi_status {
    const auto changed = found.service.subscribers_changed(timeout_of(timeout_ms));
    if (!changed) return fail(changed.failure());
    *count = *changed;
    return GIMI_OK;
  });
}

uint64_t gimi_published(gimi_handle publisher) {
  uint64_t count = 0;
  static_cast<void>(with<PublisherObject>(publisher, [&](PublisherObject& found) -> gimi_status {
    count = found.service.published();
    return GIMI_OK;
  }));
  return count;
}

uint64_t gimi_unsent(gimi_handle publisher) {
  uint64_t count = 0;
  static_cast<void>(with<PublisherObject>(publisher, [&](PublisherObject& found) -> gimi_status {
    count = found.service.unsent();
    return GIMI_OK;
  }));
  return count;
}

gimi_status gimi_retained(gimi_handle publisher) {
  return with<PublisherObject>(
      publisher, [](PublisherObject& found) { return answer(found.service.retained()); });
}

gimi_status gimi_standing(gimi_handle handle) {
  const ObjectRef ref = find_object(handle);
  if (ref.object() != nullptr && ref.kind() == HandleKind::subscription) {
    return guarded([&] {
      return answer(static_cast<SubscriptionObject*>(ref.object())->service().standing());
    });
  }
  if (ref.object() != nullptr && ref.kind() == HandleKind::accepted) {
    return guarded(
        [&] { return answer(static_cast<AcceptedObject*>(ref.object())->service->standing()); });
  }
  return with<PublisherObject>(
      handle, [](PublisherObject& found) { return answer(found.service.standing()); });
}

gimi_status gimi_service_name(gimi_handle handle, char* name, size_t size) {
  if (name == nullptr || size == 0) return is_null("gimi_service_name(): name, or its size,");
  *name = '\0';
  const ObjectRef ref = find_object(handle);
  if (ref.object() == nullptr) return no_object(ref);
  return guarded([&]() -> gimi_status {
    switch (ref.kind()) {
      case HandleKind::publisher:
        copy_text(static_cast<PublisherObject*>(ref.object())->service.full_name(), name, size);
        return GIMI_OK;
      case HandleKind::subscription:
        copy_text(static_cast<SubscriptionObject*>(ref.object())->service().name(), name, size);
        return GIMI_OK;
      case HandleKind::accepted:
        copy_text(static_cast<AcceptedObject*>(ref.object())->service->full_name()->text, name,
                  size);
        return GIMI_OK;
      case HandleKind::sender:
        copy_text(static_cast<SenderObject*>(ref.object())->stream->service(), name, size);
        return GIMI_OK;
      default:
        return no_object(ref);
    }
  });
}

gimi_status gimi_subscribe(gimi_handle node, const char* full_name,
                           const gimi_subscribe_options* options, gimi_handle* subscription) {
  if (subscription != nullptr) *subscription = 0;
  if (full_name == nullptr || subscription == nullptr)
    return is_null("gimi_subscribe(): full_name or subscription");
  return with<NodeObject>(node, [&](NodeObject& found) {
    return with_options(options, "subscribe", "gimi_subscribe_options", [&](const auto& given) {
      SubscribeOptions how;
      how.rate_hz = given.rate_hz;
      how.newest_only = given.newest_only != 0;
      how.queue = given.queue;
      if (!read_at_full(given.at_full, how.at_full)) return bad_at_full();
      how.timeout = timeout_in_options(given.timeout_ms);
      how.window = given.window;
      how.depth = given.depth;
      how.silence = Timeout{given.silence_ms};
      if (const std::string fault = fault_of(given); !fault.empty()) {
        return fail(GIMI_BAD_ARGUMENT,
                    "cannot subscribe to '" + text_of(full_name) + "': " + fault);
      }
      auto reading = found.core->services().subscribe(full_name, how);
      if (!reading) return fail(reading.failure());
      return give<SubscriptionObject>(subscription, found.core, std::move(*reading));
    });
  });
}

gimi_status gimi_provider(gimi_handle subscription, gimi_direction* provider) {
  if (provider == nullptr) return is_null("gimi_provider(): provider");
  *provider = GIMI_NOBODY;
  return with<SubscriptionObject>(subscription, [&](SubscriptionObject& found) -> gimi_status {
    if (found.service().exists()) *provider = GIMI_PROVIDES;
    if (found.service().accepts()) *provider = GIMI_ACCEPTS;
    return GIMI_OK;
  });
}

gimi_status gimi_wait_until_exists(gimi_handle subscription, int32_t timeout_ms) {
  return with<SubscriptionObject>(subscription, [&](SubscriptionObject& found) {
    return answer(found.service().wait_until_exists(timeout_of(timeout_ms)));
  });
}

}  // extern "C"
