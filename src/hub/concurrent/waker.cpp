#include "hub/concurrent/waker.hpp"

#include <sys/eventfd.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

namespace gimnet::hub {

Waker::Waker() : descriptor_(::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {
  if (descriptor_ < 0) throw std::system_error(errno, std::generic_category(), "eventfd");
}

Waker::~Waker() { ::close(descriptor_); }

bool Waker::wake() {
  // The fence orders the sender's item before this load; its partner is the fence in
  // prepare_to_sleep(), which orders the sleeping mark before the last look at the queue. One of
  // the two threads sees the other.
  std::atomic_thread_fence(std::memory_order_seq_cst);
  // relaxed: the fence above orders it; the exchange lets exactly one sender pay for the system
  // call.
  if (!sleeping_.load(std::memory_order_relaxed) ||
      !sleeping_.exchange(false, std::memory_order_relaxed))
    return false;
  const std::uint64_t one = 1;
  // The counter can't overflow, and a failed write has no remedy that a retry would not be.
  static_cast<void>(!::write(descriptor_, &one, sizeof one));
  return true;
}

void Waker::prepare_to_sleep() {
  sleeping_.store(true, std::memory_order_relaxed);  // relaxed: ordered by the fence that follows
  std::atomic_thread_fence(std::memory_order_seq_cst);  // pairs with the fence in wake()
}

void Waker::awake() {
  sleeping_.store(
      false,
      std::memory_order_relaxed);  // relaxed: a wake() that still saw true only costs a system call
}

void Waker::clear() {
  std::uint64_t count = 0;
  static_cast<void>(!::read(descriptor_, &count, sizeof count));
}

}  // namespace gimnet::hub
