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
/// realloc() can often extend by moving pages instead of bytes. One byte of them, the first unless
/// told otherwise, stands at a multiple of kAlignment. Thread safety: one owner at a time.
/// Ownership: move-only, frees its memory. Errors: false where memory is short.
class ByteBuffer {
 public:
  /// A cache line, and the widest vector of a processor.
  static constexpr std::size_t kAlignment = 64;

  ByteBuffer() = default;
  /// The byte number `aligned_at` is the one that is aligned.
  explicit ByteBuffer(std::size_t aligned_at) : aligned_at_(aligned_at) {}
  ByteBuffer(ByteBuffer&& other) noexcept
      : aligned_at_(other.aligned_at_),
        block_(std::exchange(other.block_, nullptr)),
        begin_(std::exchange(other.begin_, 0)),
        size_(std::exchange(other.size_, 0)),
        capacity_(std::exchange(other.capacity_, 0)) {}
  ByteBuffer& operator=(ByteBuffer&& other) noexcept {
    std::swap(aligned_at_, other.aligned_at_);
    std::swap(block_, other.block_);
    std::swap(begin_, other.begin_);
    std::swap(size_, other.size_);
    std::swap(capacity_, other.capacity_);
    return *this;
  }
  ByteBuffer(const ByteBuffer&) = delete;
  ByteBuffer& operator=(const ByteBuffer&) = delete;
  ~ByteBuffer() { std::free(block_); }

  [[nodiscard]] std::byte* data() { return block_ + begin_; }
  [[nodiscard]] const std::byte* data() const { return block_ + begin_; }
  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] std::size_t capacity() const { return capacity_; }
  [[nodiscard]] bool empty() const { return size_ == 0; }
  [[nodiscard]] std::span<std::byte> span() { return {data(), size_}; }
  [[nodiscard]] std::span<const std::byte> span() const { return {data(), size_}; }

  /// Makes room for exactly `capacity` bytes, if there is less. False: no memory, nothing changed.
  [[nodiscard]] bool reserve(std::size_t capacity) {
    if (capacity <= capacity_) return true;
    if (capacity > SIZE_MAX - kAlignment) return false;
    auto* grown = static_cast<std::byte*>(std::realloc(block_, capacity + kAlignment - 1));
    if (grown == nullptr) return false;
    block_ = grown;
    const auto address = reinterpret_cast<std::uintptr_t>(grown);
    const std::size_t former = std::exchange(begin_, -(address + aligned_at_) % kAlignment);
    // Only of a small block: large ones stay at the same place of their pages.
    if (size_ != 0 && begin_ != former) std::memmove(data(), block_ + former, size_);
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
    if (!more.empty()) std::memcpy(data() + size_, more.data(), more.size());
    size_ = needed;
    return true;
  }

  /// Forgets the bytes and keeps the memory.
  void clear() { size_ = 0; }
  /// From now on, the byte number `aligned_at` is aligned. REQUIRES: empty().
  void align(std::size_t aligned_at) {
    aligned_at_ = aligned_at;
    begin_ = -(reinterpret_cast<std::uintptr_t>(block_) + aligned_at) % kAlignment;
  }

 private:
  static constexpr std::size_t kFirstGrowth = 256;

  std::size_t aligned_at_ = 0;
  std::byte* block_ = nullptr;  ///< as realloc() gave it
  std::size_t begin_ = 0;       ///< of the bytes in it
  std::size_t size_ = 0;
  std::size_t capacity_ = 0;
};

}  // namespace gimnet
