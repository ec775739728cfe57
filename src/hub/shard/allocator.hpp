#pragma once

#include <cstdint>

namespace gimnet::hub {

/// Bytes that the calling thread has allocated since it began, as jemalloc counts them. It shows
/// that a shard's turn allocates nothing, and costs one read to ask. Thread safety: one thread,
/// which also made it.
class AllocationMeter {
 public:
  AllocationMeter();

  /// Never falls. 0 in a program whose allocator is not jemalloc.
  [[nodiscard]] std::uint64_t bytes() const { return allocated_ != nullptr ? *allocated_ : 0; }

 private:
  const std::uint64_t* allocated_ = nullptr;  ///< jemalloc's own count
};

/// Gives the pages that the calling thread's memory has freed back to the kernel, which the
/// allocator would do some seconds later. System calls: one for each run of freed pages. Does
/// nothing in a program whose allocator is not jemalloc.
void return_freed_pages();

}  // namespace gimnet::hub
