#pragma once

#include <cstddef>
#include <utility>

#include "gimnet/gimi.h"
#include "gimnet/gimi/namespace.hpp"

// The handle behind a Publisher and so on. Part of gimnet/gimi.hpp.

namespace gimnet::inline GIMNET_GIMI_NAMESPACE::detail {

/// A handle of the library that its copies share; with the last copy it is closed. By itself it is
/// none. It stands in place of a std::shared_ptr, and counts by functions of GCC and clang, since
/// <memory> has 13,000 lines and <atomic> 5,500. Thread safety: any number of threads, each with a
/// copy of its own.
class SharedHandle {
 public:
  SharedHandle() = default;
  /// Takes over what the library gave out.
  explicit SharedHandle(gimi_handle value) : counted_(new Counted{value, 1}) {}
  SharedHandle(const SharedHandle& other) noexcept : counted_(other.counted_) {
    // relaxed: `other` is a copy itself, so that none is the last one meanwhile
    if (counted_ != nullptr) __atomic_add_fetch(&counted_->copies, 1, __ATOMIC_RELAXED);
  }
  SharedHandle(SharedHandle&& other) noexcept : counted_(std::exchange(other.counted_, nullptr)) {}
  SharedHandle& operator=(SharedHandle other) noexcept {
    std::swap(counted_, other.counted_);
    return *this;
  }
  ~SharedHandle() {
    // Partner: the same call of the other copies. The last one comes after all that they did.
    if (counted_ == nullptr || __atomic_sub_fetch(&counted_->copies, 1, __ATOMIC_ACQ_REL) != 0)
      return;
    static_cast<void>(gimi_close(counted_->value));
    delete counted_;
  }

  [[nodiscard]] explicit operator bool() const { return counted_ != nullptr; }
  /// 0: none.
  [[nodiscard]] gimi_handle value() const { return counted_ != nullptr ? counted_->value : 0; }

 private:
  struct Counted {
    const gimi_handle value;
    std::size_t copies;
  };

  Counted* counted_ = nullptr;
};

}  // namespace gimnet::inline GIMNET_GIMI_NAMESPACE::detail
