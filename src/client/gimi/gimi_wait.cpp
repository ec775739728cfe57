#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>
#include <memory>
#include <span>

#include "client/gimi/api.hpp"
#include "client/gimi/wait_set.hpp"

// The C API: waiting for many things.

using namespace gimnet;
using namespace gimnet::gimi;

namespace {

struct WaitSetObject final : Object {
  static constexpr HandleKind kKind = HandleKind::wait_set;
  void end() override { set->end(); }
  const std::shared_ptr<WaitSet> set = std::make_shared<WaitSet>();
};

/// One call gives no more.
constexpr std::size_t kReadyMax = 64;

/// Calls `body` with the object of `set` and that of `member`.
template <class Body>
gimi_status with_member(gimi_handle set, gimi_handle member, const Body& body) {
  return with<WaitSetObject>(set, [&](WaitSetObject& found) -> gimi_status {
    const ObjectRef ref = find_object(member);
    if (ref.object() == nullptr) return no_object(ref);
    return body(found.set, ref);
  });
}

gimi_status nothing_comes(HandleKind kind) {
  return kind == HandleKind::pending
             ? fail(GIMI_CLOSED, "the request has given its end")
             : fail(GIMI_BAD_ARGUMENT, "cannot wait for that handle: nothing is received from it");
}

}  // namespace

extern "C" {

gimi_status gimi_wait_set_create(gimi_handle* set) {
  if (set == nullptr) return is_null("gimi_wait_set_create(): set");
  *set = 0;
  return guarded([&] { return give<WaitSetObject>(set); });
}

gimi_status gimi_wait_set_add(gimi_handle set, gimi_handle member, uint64_t user) {
  return with_member(set, member, [&](const auto& joined, const ObjectRef& ref) -> gimi_status {
    Object* const object = ref.object();
    bool is_free = false;
    const bool comes = object->visit_source([&](WaitSource& source, bool ready) {
      is_free = source.join(joined, {object, member, user}, ready);
    });
    if (!comes) return nothing_comes(ref.kind());
    if (!is_free) {
      return fail(GIMI_TAKEN,
                  "what that handle receives from is in a wait set already: remove it there first");
    }
    // A thread that closes it meanwhile may have looked too early to find it in the set.
    const ObjectRef again = find_object(member);
    if (again.object() != nullptr) return GIMI_OK;
    static_cast<void>(
        object->visit_source([object](WaitSource& source, bool) { source.leave(object); }));
    return no_object(again);
  });
}

gimi_status gimi_wait_set_remove(gimi_handle set, gimi_handle member) {
  return with_member(set, member, [&](const auto& left, const ObjectRef& ref) -> gimi_status {
    const Object* const object = ref.object();
    bool was_member = false;
    static_cast<void>(ref.object()->visit_source([&](WaitSource& source, bool) {
      was_member = source.is_member(left.get(), object);
      if (was_member) source.leave();
    }));
    return was_member ? GIMI_OK : fail(GIMI_NOT_FOUND, "that handle is not in this wait set");
  });
}

gimi_status gimi_wait_set_wait(gimi_handle set, gimi_ready* ready, uint32_t ready_max,
                               size_t ready_size, int32_t timeout_ms, size_t* count) {
  if (count != nullptr) *count = 0;
  if (ready == nullptr || count == nullptr) return is_null("gimi_wait_set_wait(): ready or count");
  constexpr std::size_t kSizeMin = offsetof(gimi_ready, reserved);
  if (ready_max == 0 || ready_size < kSizeMin || ready_size > 4096)
    return fail(GIMI_BAD_ARGUMENT, "ready_max is 0, or ready_size is not sizeof(gimi_ready)");
  return with<WaitSetObject>(set, [&](WaitSetObject& found) -> gimi_status {
    std::array<gimi_ready, kReadyMax> members{};
    const auto room = std::span(members).first(std::min<std::size_t>(ready_max, kReadyMax));
    const auto given = found.set->wait(room, timeout_of(timeout_ms));
    if (!given) return fail(given.failure());
    auto* place = reinterpret_cast<std::byte*>(ready);
    for (const gimi_ready& member : room.first(*given)) {
      std::memset(place, 0, ready_size);
      std::memcpy(place, &member, std::min(ready_size, sizeof member));
      place += ready_size;
    }
    *count = *given;
    return GIMI_OK;
  });
}

gimi_status gimi_wait_set_wake(gimi_handle set) {
  return with<WaitSetObject>(set, [](WaitSetObject& found) -> gimi_status {
    found.set->wake();
    return GIMI_OK;
  });
}

gimi_status gimi_wait_set_descriptor(gimi_handle set, int32_t* descriptor) {
  if (descriptor == nullptr) return is_null("gimi_wait_set_descriptor(): descriptor");
  *descriptor = -1;
  return with<WaitSetObject>(set, [&](WaitSetObject& found) -> gimi_status {
    const auto made = found.set->descriptor();
    if (!made) return fail(made.failure());
    *descriptor = *made;
    return GIMI_OK;
  });
}

int32_t gimi_in_callback(int32_t inside) { return set_in_callback(inside != 0) ? 1 : 0; }

}  // extern "C"
