#pragma once

#include <cstdint>
#include <memory>
#include <utility>

#include "client/gimi/failure.hpp"
#include "client/gimi/wait_set.hpp"
#include "gimnet/gimi_types.h"

// From the handles of the C API to what they stand for. A handle is a number (kind, slot,
// generation), so that one that was closed, or never was, is found out instead of followed. A
// slot's generations come round after 2^32 handles.

namespace gimnet::gimi {

enum class HandleKind : std::uint8_t {
  node = 1,
  publisher = 2,
  subscription = 3,
  queue = 4,
  sender = 5,
  watch = 6,
  pending = 7,
  answers = 8,
  wait_set = 9,
  connection = 10,
  accepted = 11,
};

/// The object that a handle stands for. It lives until its handle is closed and the last call left
/// it; then that call's thread, or the one that closes, destroys it.
class Object {
 public:
  virtual ~Object() = default;
  /// Calls `visitor` with what a WaitSet waits for. False: nothing is received from such a handle,
  /// or nothing will be any more.
  virtual bool visit_source(const SourceVisitor& visitor) {
    static_cast<void>(visitor);
    return false;
  }
  /// The handle is closed, in that thread: calls that wait to receive leave.
  virtual void end() {}
  /// In a child after fork(), instead of end() and the destructor: any lock may be held for ever.
  virtual void abandon() {}
};

inline constexpr std::uint32_t kHandlesMax = 1u << 20;

/// Keeps the object of a handle while a call is inside it. Thread safety: one thread.
class ObjectRef {
 public:
  ObjectRef() = default;
  ObjectRef(ObjectRef&& other) noexcept
      : object_(std::exchange(other.object_, nullptr)), slot_(other.slot_), kind_(other.kind_) {}
  ObjectRef& operator=(ObjectRef&&) = delete;
  ~ObjectRef() {
    if (object_ != nullptr) leave();
  }

  /// Null: there is none, and status() says why.
  [[nodiscard]] Object* object() const { return object_; }
  [[nodiscard]] HandleKind kind() const { return kind_; }
  /// GIMI_CLOSED or GIMI_FORKED.
  [[nodiscard]] gimi_status status() const { return status_; }

 private:
  friend ObjectRef find_object(gimi_handle handle);
  void leave() const;

  Object* object_ = nullptr;
  std::uint32_t slot_ = 0;
  HandleKind kind_{};
  gimi_status status_ = GIMI_CLOSED;
};

/// The object of a handle of any kind.
[[nodiscard]] ObjectRef find_object(gimi_handle handle);
/// Why `ref` has no object of the kind that a call takes; stores the sentence.
gimi_status no_object(const ObjectRef& ref);
/// A new handle, which owns the object from then on; 0: kHandlesMax are open, or no memory.
[[nodiscard]] gimi_handle add_object(HandleKind kind, std::unique_ptr<Object> object);
/// GIMI_OK, or GIMI_CLOSED if there is no such handle.
[[nodiscard]] gimi_status close_object(gimi_handle handle);

}  // namespace gimnet::gimi
