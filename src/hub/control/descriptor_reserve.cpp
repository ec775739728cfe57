#include "hub/control/descriptor_reserve.hpp"

#include <fcntl.h>
#include <unistd.h>

namespace gimnet::hub {

int open_spare_descriptor() { return ::open("/dev/null", O_RDONLY | O_CLOEXEC); }

DescriptorReserve::DescriptorReserve(const Limits& limits) : limits_(limits) { fill(); }

DescriptorReserve::~DescriptorReserve() {
  for (const int descriptor : kept_) ::close(descriptor);
}

void DescriptorReserve::fill() {
  while (kept_.size() > limits_.administrators) static_cast<void>(give_up_one());
  while (kept_.size() < limits_.administrators) {
    const int descriptor = open_spare_descriptor();
    if (descriptor < 0) return;
    kept_.push_back(descriptor);
  }
}

bool DescriptorReserve::give_up_one() {
  if (kept_.empty()) return false;
  ::close(kept_.back());
  kept_.pop_back();
  return true;
}

}  // namespace gimnet::hub
