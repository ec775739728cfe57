#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <span>
#include <utility>

namespace gimnet {

/// Bytes that grow and are never filled with zeros first: for messages of up to a gigabyte, which
/// realloc() can often extend by moving pages instead of bytes. Thread safety: one owner at a time.
/// Ownership: move-only, frees its memory. Errors: false where memory is short.
class ByteBuffer {
 public:
  ByteBuffer() = default;
  ByteBuffer(ByteBuffer&& other) noexcept
      : bytes_(std::exchange(other.bytes_, nullptr)),
        size_(std::exchange(other.size_, 0)),
        capacity_(std::exchange(other.capacity_, 0)) {}
  ByteBuffer& operator=(ByteBuffer&& other) noexcept {
    std::swap(bytes_, other.bytes_);
    std::swap(size_, other.size_);
    std::swap(capacity_, other.capacity_);
    return *this;
  }
  ByteBuffer(const ByteBuffer&) = delete;
  ByteBuffer& operator=(const ByteBuffer&) = delete;
  ~ByteBuffer() { std::free(bytes_); }

  [[nodiscard]] std::byte* data() { return bytes_; }
  [[nodiscard]] const std::byte* data() const { return bytes_; }
  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] std::size_t capacity() const { return capacity_; }
  [[nodiscard]] bool empty() const { return size_ == 0; }
  [[nodiscard]] std::span<std::byte> span() { return {bytes_, size_}; }
  [[nodiscard]] std::span<const std::byte> span() const { return {bytes_, size_}; }

  /// Makes room for exactly `capacity` bytes, if there is less. False: no memory, nothing changed.
  [[nodiscard]] bool reserve(std::size_t capacity) {
    if (capacity <= capacity_) return true;
    auto* grown = static_cast<std::byte*>(std::realloc(bytes_, capacity));
    if (grown == nullptr) return false;
    bytes_ = grown;
    capacity_ = capacity;
    return true;
  }

  /// Copies `more` to the end; grows by doubling, but not over `capacity_max` as long as the bytes
  /// fit there.
  [[nodiscard]] bool append(std::span<const std::byte> more, std::size_t capacity_max = SIZE_MAX) {
    const std::size_t needed = size_ + more.size();
    if (needed > capacity_ &&
        !reserve(std::max(needed, std::min(std::max(2 * capacity_, kFirstGrowth), capacity_max)))) {
      return false;
    }
    if (!more.empty()) std::memcpy(bytes_ + size_, more.data(), more.size());
    size_ = needed;
    return true;
  }

  /// Forgets the bytes and keeps the memory.
  void clear() { size_ = 0; }

 private:
  static constexpr std::size_t kFirstGrowth = 256;

  std::byte* bytes_ = nullptr;
  std::size_t size_ = 0;
  std::size_t capacity_ = 0;
};

}  // namespace gimnet
