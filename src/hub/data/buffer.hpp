#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <utility>

namespace gimnet::hub {

class BudgetLease;
class BufferPool;

/// Memory that a Buffer has before its bytes.
inline constexpr std::uint32_t kBufferRoom = 64;
/// Bytes of the largest chunk that several frames share. With its room it is the largest piece that
/// jemalloc packs side by side (SC_SMALL_MAXCLASS): those from 16 KiB on begin at any line of a
/// page, and so have a page more than their size, a fifth of the memory that thousands of waiting
/// chunks take.
inline constexpr std::uint32_t kSharedChunkBytes = 14 * 1024 - kBufferRoom;

enum class BufferKind : std::uint8_t {
  slab,   ///< what connections read into; frames are routed where they lie
  chunk,  ///< smaller memory: for waiting frames that are copied, and for a frame that comes slowly
  foreign,  ///< stands on this shard for a slab or chunk of another one
};

/// Bytes with a reference count. The count is a plain integer: a buffer belongs to one shard, and
/// another shard holds it through a `foreign` buffer of its own, so that only handing over between
/// shards costs an atomic operation. Bytes that were handed on are immutable.
struct Buffer {
  std::byte* data = nullptr;
  std::uint32_t capacity = 0;
  std::uint32_t references = 0;
  BufferKind kind = BufferKind::chunk;
  std::uint8_t size_class = 0;
  BufferPool* pool = nullptr;
  BudgetLease* payer = nullptr;  ///< that it counts against, because a waiting frame keeps it
  Buffer* next_free = nullptr;
  Buffer* lender = nullptr;            ///< of a foreign buffer: what it stands for
  std::atomic<std::uint32_t> lent{0};  ///< foreign buffers and mailbox entries that stand for it
};
static_assert(sizeof(Buffer) <= kBufferRoom);

/// One reference to a Buffer. Copying is spelled share(). Thread safety: none; one shard.
class BufferRef {
 public:
  BufferRef() = default;
  /// Takes a reference of its own.
  explicit BufferRef(Buffer* buffer) : buffer_(buffer) {
    if (buffer_ != nullptr) ++buffer_->references;
  }
  BufferRef(BufferRef&& other) noexcept : buffer_(std::exchange(other.buffer_, nullptr)) {}
  BufferRef& operator=(BufferRef&& other) noexcept {
    std::swap(buffer_, other.buffer_);
    return *this;
  }
  BufferRef(const BufferRef&) = delete;
  BufferRef& operator=(const BufferRef&) = delete;
  ~BufferRef() { reset(); }

  [[nodiscard]] BufferRef share() const { return BufferRef(buffer_); }
  [[nodiscard]] Buffer* get() const { return buffer_; }
  [[nodiscard]] explicit operator bool() const { return buffer_ != nullptr; }
  Buffer* operator->() const { return buffer_; }

  void reset() {
    if (buffer_ != nullptr && --buffer_->references == 0) recycle(*buffer_);
    buffer_ = nullptr;
  }

 private:
  static void recycle(Buffer& buffer);

  Buffer* buffer_ = nullptr;
};

}  // namespace gimnet::hub
