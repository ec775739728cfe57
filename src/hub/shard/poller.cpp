#include "hub/shard/poller.hpp"

#include <sys/timerfd.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

namespace gimnet::hub {
namespace {

epoll_event make_event(std::uint64_t token, Interest interest) {
  epoll_event event{};
  event.events = (interest.read ? EPOLLIN | EPOLLRDHUP : 0u) | (interest.write ? EPOLLOUT : 0u);
  // The kernel tells the end of a connection to those who did not ask, too, at each wait. Nobody
  // looks at it now.
  if (!interest.read && !interest.write) event.events = EPOLLONESHOT;
  event.data.u64 = token;
  return event;
}

}  // namespace

Poller::Poller()
    : epoll_(::epoll_create1(EPOLL_CLOEXEC)),
      timer_(::timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC | TFD_NONBLOCK)) {
  epoll_event event{};
  // Edge-triggered: to set it anew is all that it takes, nobody has to read it.
  event.events = EPOLLIN | EPOLLET;
  event.data.u64 = kTimerToken;
  if (epoll_ >= 0 && timer_ >= 0 && ::epoll_ctl(epoll_, EPOLL_CTL_ADD, timer_, &event) == 0) return;
  const int error = errno;
  if (epoll_ >= 0) ::close(epoll_);
  if (timer_ >= 0) ::close(timer_);
  throw std::system_error(error, std::generic_category(), "epoll_create1, timerfd_create");
}

Poller::~Poller() {
  ::close(timer_);
  ::close(epoll_);
}

bool Poller::add(int descriptor, std::uint64_t token, Interest interest) {
  epoll_event event = make_event(token, interest);
  return ::epoll_ctl(epoll_, EPOLL_CTL_ADD, descriptor, &event) == 0;
}

void Poller::change(int descriptor, std::uint64_t token, Interest interest) {
  epoll_event event = make_event(token, interest);
  static_cast<void>(::epoll_ctl(epoll_, EPOLL_CTL_MOD, descriptor, &event));
}

void Poller::remove(int descriptor) {
  static_cast<void>(::epoll_ctl(epoll_, EPOLL_CTL_DEL, descriptor, nullptr));
}

void Poller::set_timer(std::uint64_t at_ms) {
  itimerspec when{};
  when.it_value.tv_sec = static_cast<::time_t>(at_ms / 1'000);
  when.it_value.tv_nsec = static_cast<long>(at_ms % 1'000 * 1'000'000);
  static_cast<void>(::timerfd_settime(timer_, TFD_TIMER_ABSTIME, &when, nullptr));
  timer_at_ms_ = at_ms;
}

std::span<const Ready> Poller::wait_until(std::uint64_t at_ms) {
  if (at_ms == kNow) return wait(0);
  if (at_ms < timer_at_ms_) set_timer(at_ms);
  return wait(-1);
}

std::span<const Ready> Poller::wait(int timeout_ms) {
  const int count =
      ::epoll_wait(epoll_, events_.data(), static_cast<int>(events_.size()), timeout_ms);
  // An interrupted wait is one in which nothing became ready.
  std::size_t ready = 0;
  for (int i = 0; i < count; ++i) {
    const epoll_event& event = events_[static_cast<std::size_t>(i)];
    if (event.data.u64 == kTimerToken) {
      timer_at_ms_ = kNever;
      continue;
    }
    ready_[ready++] = {event.data.u64,
                       (event.events & (EPOLLIN | EPOLLRDHUP | EPOLLHUP | EPOLLERR)) != 0,
                       (event.events & (EPOLLOUT | EPOLLHUP | EPOLLERR)) != 0};
  }
  return {ready_.data(), ready};
}

}  // namespace gimnet::hub
