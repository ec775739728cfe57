#include "hub/shard/allocation_meter.hpp"

#include <cstddef>

// jemalloc's door to its statistics (jemalloc(3), "mallctl"). Weak: null in a program without
// jemalloc.
extern "C" __attribute__((weak)) int mallctl(const char* name, void* old_value,
                                             std::size_t* old_size, void* new_value,
                                             std::size_t new_size);

namespace gimnet::hub {

AllocationMeter::AllocationMeter() {
  if (mallctl == nullptr) return;
  std::size_t size = sizeof allocated_;
  if (mallctl("thread.allocatedp", static_cast<void*>(&allocated_), &size, nullptr, 0) != 0)
    allocated_ = nullptr;
}

}  // namespace gimnet::hub
