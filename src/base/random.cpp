#include "base/random.hpp"

#include <sys/random.h>

#include <cerrno>

#include "base/check.hpp"

namespace gimnet {

void fill_randomly(std::span<std::byte> memory) {
  while (!memory.empty()) {
    const ssize_t count = ::getrandom(memory.data(), memory.size(), 0);
    if (count < 0 && errno == EINTR) continue;  // a signal, before the system had its first bits
    GIMNET_CHECK(count > 0);
    memory = memory.subspan(static_cast<std::size_t>(count));
  }
}

std::uint64_t random_bits() {
  std::uint64_t bits = 0;
  fill_randomly(std::as_writable_bytes(std::span{&bits, 1}));
  return bits;
}

}  // namespace gimnet
