#include "hub/shard/poller.hpp"

#include <unistd.h>

#include <cerrno>
#include <system_error>

namespace gimnet::hub {
namespace {

epoll_event make_event(std::uint64_t token, Interest interest) {
  epoll_event event{};
  event.events = (interest.read ? EPOLLIN | EPOLLRDHUP : 0u) | (interest.write ? EPOLLOUT : 0u);
  // The kernel tells the end of a connection to those who did not ask, too, at each wait. Nobody looks at it now.
  if (!interest.read && !interest.write) event.events = EPOLLONESHOT;
  event.data.u64 = token;
  return event;
}

}  // namespace

Poller::Poller() : epoll_(::epoll_create1(EPOLL_CLOEXEC)) {
  if (epoll_ < 0) throw std::system_error(errno, std::generic_category(), "epoll_create1");
}

Poller::~Poller() { ::close(epoll_); }

bool Poller::add(int descriptor, std::uint64_t token, Interest interest) {
  epoll_event event = make_event(token, interest);
  return ::epoll_ctl(epoll_, EPOLL_CTL_ADD, descriptor, &event) == 0;
}

void Poller::change(int descriptor, std::uint64_t token, Interest interest) {
  epoll_event event = make_event(token, interest);
  static_cast<void>(::epoll_ctl(epoll_, EPOLL_CTL_MOD, descriptor, &event));
}

void Poller::remove(int descriptor) { static_cast<void>(::epoll_ctl(epoll_, EPOLL_CTL_DEL, descriptor, nullptr)); }

std::span<const Ready> Poller::wait(int timeout_ms) {
  const int count = ::epoll_wait(epoll_, events_.data(), static_cast<int>(events_.size()), timeout_ms);
  // An interrupted wait is one in which nothing became ready.
  const std::size_t ready = count > 0 ? static_cast<std::size_t>(count) : 0;
  for (std::size_t i = 0; i < ready; ++i) {
    const std::uint32_t events = events_[i].events;
    ready_[i] = {events_[i].data.u64, (events & (EPOLLIN | EPOLLRDHUP | EPOLLHUP | EPOLLERR)) != 0,
                 (events & (EPOLLOUT | EPOLLHUP | EPOLLERR)) != 0};
  }
  return {ready_.data(), ready};
}

}  // namespace gimnet::hub
