#include "hub/shard/allocator.hpp"

#include <array>
#include <cstddef>
#include <cstdio>

namespace gimnet::hub {

// jemalloc's door to its statistics and arenas (jemalloc(3), "mallctl"). Weak: null in a program
// without jemalloc.
extern "C" __attribute__((weak)) int mallctl(const char* name, void* old_value,
                                             std::size_t* old_size, void* new_value,
                                             std::size_t new_size);

AllocationMeter::AllocationMeter() {
  if (mallctl == nullptr) return;
  std::size_t size = sizeof allocated_;
  if (mallctl("thread.allocatedp", static_cast<void*>(&allocated_), &size, nullptr, 0) != 0)
    allocated_ = nullptr;
}

void return_freed_pages() {
  if (mallctl == nullptr) return;
  unsigned arena = 0;
  std::size_t size = sizeof arena;
  if (mallctl("thread.arena", &arena, &size, nullptr, 0) != 0) return;
  std::array<char, 32> name{};
  static_cast<void>(std::snprintf(name.data(), name.size(), "arena.%u.purge", arena));
  static_cast<void>(mallctl(name.data(), nullptr, nullptr, nullptr, 0));
}

}  // namespace gimnet::hub
