#include "net/wait.hpp"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>

namespace gimnet::net {
namespace {

/// Milliseconds for poll(), rounded up so that a wait never ends before its deadline.
int poll_timeout_ms(Deadline deadline) {
  if (deadline == kNever) return -1;
  const std::int64_t left_ns = deadline - steady_now_ns();
  if (left_ns <= 0) return 0;
  return static_cast<int>(std::min<std::int64_t>((left_ns + kNsPerMs - 1) / kNsPerMs, 60'000));
}

}  // namespace

WakeSignal::WakeSignal() : descriptor_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {}

WakeSignal::~WakeSignal() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

void WakeSignal::raise() {
  const std::uint64_t one = 1;
  // Fails only where the counter is full: then it is raised already.
  static_cast<void>(!::write(descriptor_, &one, sizeof one));
}

void WakeSignal::clear() {
  std::uint64_t count = 0;
  static_cast<void>(!::read(descriptor_, &count, sizeof count));
}

Deadline WakeSignal::beat(Deadline deadline) const {
  if (!beat_) return deadline;
  beat_();
  return std::min(deadline, steady_now_ns() + kBeatNs);
}

Readiness wait_for(const Stream* stream, Interest interest, const WakeSignal& wake,
                   Deadline deadline) {
  const auto events =
      static_cast<short>((interest.read ? POLLIN : 0) | (interest.write ? POLLOUT : 0));
  // A negative descriptor is skipped: with nothing asked of the stream even its errors must not end
  // the wait at once.
  const int descriptor = events != 0 && stream != nullptr ? stream->descriptor() : -1;
  std::array<pollfd, 2> waits{{{wake.descriptor(), POLLIN, 0}, {descriptor, events, 0}}};
  Readiness ready;
  ready.readable = interest.read && stream != nullptr && stream->pending_in() != 0;
  const Deadline until = wake.beat(deadline);
  const int timeout_ms = ready.readable ? 0 : poll_timeout_ms(until);
  if (::poll(waits.data(), waits.size(), timeout_ms) <= 0) return ready;
  ready.woken = waits[0].revents != 0;
  const bool broken = (waits[1].revents & (POLLERR | POLLHUP | POLLNVAL)) != 0;
  ready.readable |= (waits[1].revents & POLLIN) != 0 || (broken && interest.read);
  ready.writable = (waits[1].revents & POLLOUT) != 0 || (broken && interest.write);
  return ready;
}

Raised wait_for_either(const WakeSignal& one, const WakeSignal& other, Deadline deadline) {
  std::array<pollfd, 2> waits{{{one.descriptor(), POLLIN, 0}, {other.descriptor(), POLLIN, 0}}};
  const Deadline until = other.beat(deadline);
  if (::poll(waits.data(), waits.size(), poll_timeout_ms(until)) <= 0) return {};
  return {waits[0].revents != 0, waits[1].revents != 0};
}

}  // namespace gimnet::net
