#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <new>
#include <string>
#include <utility>
#include <vector>

#include "base/byte_buffer.hpp"
#include "base/mutex.hpp"
#include "gimnet/nif.h"

namespace gimnet::nif {

/// Memory of large messages that programs gave back, for the next ones: each 4 KiB of new memory
/// cost a page fault, a tenth of what a message of 1 MiB costs from program to program. Thread
/// safety: any thread.
class SpareBuffers {
 public:
  /// Smaller messages are allocated at the usual cost.
  static constexpr std::size_t kMessageBytesMin = 32 * 1024;
  /// Kept in all for a node that receives large messages: a few pictures.
  static constexpr std::size_t kBytesMax = 8 * 1024 * 1024;

  /// Empty; the byte number `aligned_at` of what is put in will be aligned.
  [[nodiscard]] ByteBuffer take(std::size_t message_bytes, std::size_t aligned_at);
  /// Frees what is too small to be of use, or too much.
  void give(ByteBuffer buffer);
  [[nodiscard]] std::size_t bytes() const;

 private:
  mutable Mutex mutex_;
  std::vector<ByteBuffer> buffers_ GIMNET_GUARDED_BY(mutex_);  ///< the last is warmest
  std::size_t bytes_ GIMNET_GUARDED_BY(mutex_) = 0;
};

/// Memory that received things lie in; freed with its last reference, by whichever thread gives
/// that back. Thread safety: references from any thread; the contents are written before the first
/// other thread gets one.
class Storage {
 public:
  Storage(const Storage&) = delete;
  Storage& operator=(const Storage&) = delete;
  void add_reference() {
    // No partner: whoever adds one holds one, so there is nothing to order.
    references_.fetch_add(1, std::memory_order_relaxed);
  }
  void release() {
    // Partner: the other releases; whoever is last sees everything that the others did with the
    // contents.
    if (references_.fetch_sub(1, std::memory_order_acq_rel) == 1) delete this;
  }
  /// Nobody but the caller has a reference.
  [[nodiscard]] bool is_only_reference() const {
    return references_.load(std::memory_order_acquire) ==
           1;  // partner: the fetch_sub of the others' release()
  }
  /// Bytes of memory that many received things share, and that the last of them frees; 0: each has
  /// its own.
  [[nodiscard]] std::uint32_t shared_bytes() const { return shared_bytes_; }

 protected:
  explicit Storage(std::uint32_t shared_bytes = 0) : shared_bytes_(shared_bytes) {}
  virtual ~Storage() = default;

 private:
  std::atomic<std::uint32_t> references_{1};
  const std::uint32_t shared_bytes_;
};

/// The memory that the socket is read into: many frames behind each other.
class Slab final : public Storage {
 public:
  static constexpr std::uint32_t kBytes = 256 * 1024;
  /// Null: no memory.
  [[nodiscard]] static Slab* make() {
    auto* memory = new (std::nothrow) std::byte[kBytes];
    if (memory == nullptr) return nullptr;
    auto* slab = new (std::nothrow) Slab(memory);
    if (slab == nullptr) delete[] memory;
    return slab;
  }
  [[nodiscard]] std::byte* bytes() { return bytes_; }

 private:
  explicit Slab(std::byte* memory) : Storage(kBytes), bytes_(memory) {}
  ~Slab() override { delete[] bytes_; }
  std::byte* const bytes_;
};

/// The content of a NIF_WATCHED, with all that it points to.
struct WatchedChange {
  WatchedChange() = default;
  WatchedChange(const WatchedChange&) = delete;
  WatchedChange& operator=(const WatchedChange&) = delete;
  virtual ~WatchedChange() = default;
  nif_watched view{};
};

/// One thing that is not a frame in a slab: an event, or a message put together from fragments.
class Record final : public Storage {
 public:
  Record() = default;
  ~Record() override {
    if (spares) spares->give(std::move(payload));
  }
  nif_incoming incoming{};
  std::string text;
  ByteBuffer payload;
  std::vector<std::byte> extensions;
  std::unique_ptr<WatchedChange> watched;
  std::shared_ptr<SpareBuffers> spares;  ///< get the payload's memory in the end

  /// Points the members of `incoming` at what is stored here.
  void finish() {
    incoming.text = text.c_str();
    if (watched) incoming.watched = &watched->view;
    if (!payload.empty()) {
      incoming.payload = payload.data();
      incoming.size = payload.size();
    }
    if (!extensions.empty()) {
      incoming.extensions = extensions.data();
      incoming.extensions_size = extensions.size();
    }
    incoming.storage = static_cast<Storage*>(this);
  }
};

/// A place in the receive queue: a frame in a slab, or (frame null) a record. Holds one reference
/// to its storage.
struct Item {
  Storage* storage = nullptr;
  const std::byte* frame = nullptr;
  std::int64_t arrival_ns = 0;
  std::size_t bytes = 0;    ///< of payload and header, for the queue's limit
  std::uint32_t epoch = 0;  ///< of a message that counts in a window (CreditBook)
};

/// The item as nif_receive() gives it out; the reference goes with it.
[[nodiscard]] nif_incoming incoming_of(const Item& item);

}  // namespace gimnet::nif
