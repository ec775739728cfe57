#pragma once

#include <cstddef>
#include <cstring>
#include <exception>
#include <functional>
#include <memory>
#include <new>
#include <string>
#include <string_view>
#include <utility>

#include "client/gimi/core.hpp"
#include "client/gimi/failure.hpp"
#include "client/gimi/object_table.hpp"
#include "client/nif/error.hpp"
#include "client/nif/sized_struct.hpp"
#include "gimnet/gimi.h"

// The common parts of the functions of gimnet/gimi.h: what their handles stand for, and guards.

namespace gimnet::gimi {

using SharedCore = std::shared_ptr<Core>;

struct NodeObject final : Object {
  static constexpr HandleKind kKind = HandleKind::node;
  explicit NodeObject(SharedCore the_core) : core(std::move(the_core)) {}
  void end() override { core->close(); }
  void abandon() override { core->close(); }
  bool visit_source(const SourceVisitor& visitor) override {
    core->inbox().visit_any(visitor);
    return true;
  }
  const SharedCore core;
};

struct PublisherObject final : Object {
  static constexpr HandleKind kKind = HandleKind::publisher;
  PublisherObject(SharedCore the_core, PublishedService& the_service)
      : core(std::move(the_core)), service(the_service) {}
  ~PublisherObject() override { core->services().withdraw(service); }
  void end() override { service.end({Status::closed, "the service was withdrawn"}); }
  bool visit_source(const SourceVisitor& visitor) override {
    service.visit(visitor);
    return true;
  }
  const SharedCore core;
  PublishedService& service;
};

/// A handle to receive from, beside a node.
struct Source : Object {
  Source(SharedCore the_core, MessageQueue& the_queue)
      : core(std::move(the_core)), queue(the_queue) {}
  void end() override { core->inbox().leave(queue, closed); }
  bool visit_source(const SourceVisitor& visitor) override {
    if (core->inbox().visit(queue, visitor)) core->attend();
    return true;
  }
  const SharedCore core;
  MessageQueue& queue;
  std::atomic<bool> closed{false};  ///< the handle was, whatever becomes of the queue
};

struct SubscriptionObject final : Source {
  static constexpr HandleKind kKind = HandleKind::subscription;
  SubscriptionObject(SharedCore the_core, ServiceTable::Reading the_reading)
      : Source(std::move(the_core), the_reading.subscriber->queue),
        reading(std::move(the_reading)) {}
  ~SubscriptionObject() override { core->services().unsubscribe(reading); }
  [[nodiscard]] SubscribedService& service() const { return *reading.service; }
  const ServiceTable::Reading reading;
};

struct QueueObject final : Source {
  static constexpr HandleKind kKind = HandleKind::queue;
  using Source::Source;
};

struct AcceptedObject final : Source {
  static constexpr HandleKind kKind = HandleKind::accepted;
  AcceptedObject(SharedCore the_core, AcceptedTable::Service the_service)
      : Source(std::move(the_core), the_service->queue), service(std::move(the_service)) {}
  ~AcceptedObject() override {
    // In that order: a message that still comes is not acknowledged.
    core->accepted().remove(service);
    core->services().withdraw_accepted(service->name());
  }
  const AcceptedTable::Service service;
};

struct SenderObject final : Object {
  static constexpr HandleKind kKind = HandleKind::sender;
  SenderObject(SharedCore the_core, StreamTable::Stream the_stream, AtAway while_away)
      : core(std::move(the_core)), stream(std::move(the_stream)), at_away(while_away) {}
  const SharedCore core;  ///< outlives the stream
  const StreamTable::Stream stream;
  const AtAway at_away;  ///< of this Sender alone: others share the stream
};

struct WatchObject final : Object {
  static constexpr HandleKind kKind = HandleKind::watch;
  WatchObject(SharedCore the_core, WatchQueues::Begun the_watch)
      : core(std::move(the_core)), watch(std::move(the_watch)) {}
  ~WatchObject() override { core->watches().unwatch(watch.number); }
  void end() override { watch.queue->end({Status::closed, "the watch was closed"}); }
  bool visit_source(const SourceVisitor& visitor) override {
    watch.queue->visit(visitor);
    return true;
  }
  const SharedCore core;
  const WatchQueues::Begun watch;
};

struct ConnectionObject final : Object {
  static constexpr HandleKind kKind = HandleKind::connection;
  ConnectionObject(SharedCore the_core, ConnectionEvents::Queue the_queue)
      : core(std::move(the_core)), queue(std::move(the_queue)) {}
  ~ConnectionObject() override { core->connection().remove(queue); }
  void end() override { queue->end({Status::closed, "the handle of these events was closed"}); }
  bool visit_source(const SourceVisitor& visitor) override {
    queue->visit(visitor);
    return true;
  }
  const SharedCore core;
  const ConnectionEvents::Queue queue;
};

/// Runs `body` so that no exception crosses into C.
template <class Body>
gimi_status guarded(const Body& body) noexcept {
  try {
    return body();
  } catch (const std::bad_alloc&) {
    return fail(GIMI_SYSTEM, "out of memory");
  } catch (const std::exception& error) {
    return fail(GIMI_SYSTEM, error.what());
  }
}

/// Runs `body` with the object that the handle stands for, unless there is none of that kind.
template <class ObjectOf, class Body>
gimi_status with(gimi_handle handle, const Body& body) noexcept {
  const ObjectRef ref = find_object(handle);
  if (ref.object() == nullptr || ref.kind() != ObjectOf::kKind) return no_object(ref);
  return guarded([&] { return body(static_cast<ObjectOf&>(*ref.object())); });
}

template <class Body>
gimi_status with_core(gimi_handle node, const Body& body) noexcept {
  return with<NodeObject>(node, [&](NodeObject& object) { return body(*object.core); });
}

/// Is it the kind of a Source?
[[nodiscard]] inline bool is_source(HandleKind kind) {
  return kind == HandleKind::subscription || kind == HandleKind::queue ||
         kind == HandleKind::accepted;
}

/// The same for a subscription, a queue or an accepted service.
template <class Body>
gimi_status with_source(gimi_handle handle, const Body& body) noexcept {
  const ObjectRef ref = find_object(handle);
  if (ref.object() == nullptr || !is_source(ref.kind())) return no_object(ref);
  return guarded([&] { return body(static_cast<Source&>(*ref.object())); });
}

template <class Value>
gimi_status answer(const Outcome<Value>& outcome) {
  return outcome ? GIMI_OK : fail(outcome.failure());
}

inline gimi_status is_null(const char* what) {
  return fail(GIMI_BAD_ARGUMENT, std::string(what) + " is NULL");
}

inline Timeout timeout_of(std::int32_t timeout_ms) { return Timeout{timeout_ms}; }
/// Of a member of options.
inline Timeout timeout_in_options(std::int32_t timeout_ms) {
  return Timeout{timeout_ms == 0 ? 5000 : timeout_ms};
}
inline std::string text_of(const char* text) { return text == nullptr ? "" : text; }
inline BytesView bytes_of(const void* data, std::size_t size) {
  return std::string_view(static_cast<const char*>(data), size);
}
inline BytesView bytes_of(const gimi_bytes* bytes) {
  return bytes == nullptr ? BytesView() : bytes_of(bytes->data, bytes->size);
}
inline MessageKey key_of(gimi_key key) { return {key.type, key.instance}; }

/// False: no such lane. 0 is the normal one.
inline bool read_lane(gimi_lane number, Lane& lane) {
  lane = number == GIMI_LANE_DEFAULT ? Lane::normal : static_cast<Lane>(number - 1);
  return number >= GIMI_LANE_DEFAULT && number <= GIMI_LANE_BACKGROUND;
}

inline gimi_status bad_lane(gimi_lane lane) {
  return fail(GIMI_BAD_ARGUMENT, "there is no lane " + std::to_string(lane));
}

/// False: a queue cannot do that when it is full.
inline bool read_at_full(gimi_at_full_queue number, AtFullQueue& at_full) {
  at_full = static_cast<AtFullQueue>(number);
  return number >= GIMI_OVERWRITE_OLDEST && number <= GIMI_STOP_READING;
}

inline gimi_status bad_at_full() {
  return fail(GIMI_BAD_ARGUMENT, "at_full is none of GIMI_OVERWRITE_OLDEST, GIMI_STOP_READING");
}

/// Of a queue for more than GIMI_QUEUE_MESSAGES_MAX messages.
inline std::string too_long(std::size_t messages) {
  return "a queue of " + std::to_string(messages) + " messages; 16,777,216 are the most";
}
inline gimi_status bad_length(std::size_t messages) {
  return fail(GIMI_BAD_ARGUMENT, "cannot make " + too_long(messages));
}

/// Copies as much as fits, cut between characters. REQUIRES: size is not 0.
inline void copy_text(std::string_view text, char* buffer, std::size_t size) {
  const std::string_view kept = nif::cut_text(text, size - 1);
  std::memcpy(buffer, kept.data(), kept.size());
  buffer[kept.size()] = '\0';
}

/// Options of the program, as this version of the library has them; null: all defaults.
template <class Options, class Body>
gimi_status with_options(const Options* given, const char* doing, const char* name,
                         const Body& body) {
  Options whole{};
  if (given != nullptr) {
    if (const auto fault = nif::read_struct(given, whole, doing, name))
      return fail(GIMI_BAD_ARGUMENT, fault->sentence);
  } else {
    given = &whole;
  }
  return body(*given);
}

/// The service of that full name, as the own hub lists it. Errors: as gimi_sender_to_service().
[[nodiscard]] Outcome<ServiceRecord> listed_service(Core& core, const std::string& name,
                                                    Timeout timeout);
/// A stream to who accepts that service. `on_place`, which may be null, is called with where that
/// is, before anybody can say that it moved. Errors: as gimi_sender_to_service().
using OnPlace = std::function<void(const StreamTable::Stream& stream, const ServicePlace& place)>;
[[nodiscard]] Outcome<StreamTable::Stream> stream_to_service(Core& core,
                                                             const ServiceRecord& service,
                                                             const SendOptions& options,
                                                             Timeout timeout,
                                                             const OnPlace& on_place = {});

/// Gives an object to the program by a handle.
template <class ObjectOf, class... Arguments>
gimi_status give(gimi_handle* handle, Arguments&&... arguments) {
  *handle = add_object(ObjectOf::kKind,
                       std::make_unique<ObjectOf>(std::forward<Arguments>(arguments)...));
  if (*handle != 0) return GIMI_OK;
  static_assert(kHandlesMax == 1u << 20);  // as gimi.h says, too
  return fail(GIMI_LIMIT, "this process has 1,048,576 open handles");
}

}  // namespace gimnet::gimi
