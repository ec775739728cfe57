#pragma once

#include <cstddef>
#include <vector>

#include "base/byte_buffer.hpp"
#include "base/mutex.hpp"

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

}  // namespace gimnet::nif
