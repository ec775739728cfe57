#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>

#include "base/check.hpp"

namespace gimnet::hub {

/// A FIFO in a ring that doubles when it is full, and keeps its memory while it is in use: a queue
/// that fills and runs empty in every turn does not allocate. trim() gives a long one back, so that
/// an idle connection keeps next to nothing. An item keeps its number while it waits, so that it
/// can be found again and replaced in place. Its users bound it by bytes. Thread safety: one shard.
/// T is default-constructible and movable.
template <class T>
class RingQueue {
 public:
  [[nodiscard]] bool empty() const { return first_ == end_; }
  [[nodiscard]] std::size_t size() const { return static_cast<std::size_t>(end_ - first_); }
  /// Memory that it holds.
  [[nodiscard]] std::size_t capacity_bytes() const { return capacity_ * sizeof(T); }
  /// Numbers of the items that wait: [first_number(), end_number()).
  [[nodiscard]] std::uint64_t first_number() const { return first_; }
  [[nodiscard]] std::uint64_t end_number() const { return end_; }

  /// REQUIRES: first_number() <= number < end_number().
  [[nodiscard]] T& at(std::uint64_t number) {
    GIMNET_ASSERT(number >= first_ && number < end_);
    return ring_[number & (capacity_ - 1)];
  }
  /// REQUIRES: not empty.
  [[nodiscard]] T& front() { return at(first_); }
  /// REQUIRES: not empty.
  [[nodiscard]] T& back() { return at(end_ - 1); }

  T& push_back(T item) {
    if (size() == capacity_) grow();
    T& place = ring_[end_ & (capacity_ - 1)];
    place = std::move(item);
    ++end_;
    return place;
  }
  /// REQUIRES: not empty.
  void pop_front() {
    front() = T{};
    ++first_;
  }
  /// Gives back the memory of a long ring that is empty.
  void trim() {
    if (empty() && capacity_ > kKeepItems) release();
  }
  void clear() {
    while (!empty()) pop_front();
    release();
  }

 private:
  static constexpr std::size_t kFirstItems =
      1;  // a keep-alive is all that an idle connection ever has in one
  static constexpr std::size_t kKeepItems = 16;

  void grow() {
    const std::size_t capacity = capacity_ == 0 ? kFirstItems : 2 * capacity_;
    auto ring = std::make_unique<T[]>(capacity);
    for (std::uint64_t number = first_; number != end_; ++number) {
      ring[number & (capacity - 1)] = std::move(ring_[number & (capacity_ - 1)]);
    }
    ring_ = std::move(ring);
    capacity_ = capacity;
  }
  void release() {
    ring_.reset();
    capacity_ = 0;
  }

  std::unique_ptr<T[]> ring_;
  std::size_t capacity_ = 0;
  std::uint64_t first_ = 0;
  std::uint64_t end_ = 0;
};

}  // namespace gimnet::hub
