#include "tests/stress/support/cutting_proxy.hpp"

#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <stdexcept>
#include <utility>

namespace gimnet::stress {
namespace {

constexpr std::size_t kPieceBytes = 64 * 1024;

bool would_block() { return errno == EAGAIN || errno == EINTR; }

}  // namespace

CuttingProxy::CuttingProxy(std::string hub_url, const CutPlan& plan)
    : hub_url_(std::move(hub_url)), plan_(plan), random_(plan.seed) {
  std::tie(listener_, url_) = listen_on_loopback();
  choose_cut();
  thread_ = std::thread([this] { run(); });
}

CuttingProxy::~CuttingProxy() {
  stopping_.store(true);
  thread_.join();
}

void CuttingProxy::choose_cut() {
  const bool is_planned = cuts_.load() < plan_.cuts && plan_.bytes_between > 0;
  until_cut_ =
      is_planned ? std::uniform_int_distribution<std::uint64_t>(1, 2 * plan_.bytes_between)(random_)
                 : UINT64_MAX;
  is_cut_due_ = false;
}

void CuttingProxy::run() {
  while (!stopping_.load()) {
    if (node_.is_open()) {
      serve();
      continue;
    }
    wait_readable({listener_.get()}, 20);
    Descriptor came(::accept4(listener_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
    if (!came.is_open()) continue;
    try {
      hub_ = dial(hub_url_);
    } catch (const std::runtime_error&) {
      continue;  // there is no hub now, which the node learns as it would without this
    }
    node_ = std::move(came);
    connected_at_ = Clock::now();
  }
}

void CuttingProxy::serve() {
  if (is_cut_due_) {
    if (Clock::now() - connected_at_ >= plan_.least_life) return cut();
    return wait_readable({}, 1);
  }
  std::vector<int> waited{node_.get()};
  if (!held_.load()) waited.push_back(hub_.get());
  const bool stuck = std::any_of(directions_.begin(), directions_.end(),
                                 [](const Direction& d) { return d.bytes.size() > d.sent; });
  wait_readable(waited, stuck ? 1 : 20);
  const bool goes_on = forward(node_.get(), hub_.get(), directions_[0]) &&
                       (held_.load() || forward(hub_.get(), node_.get(), directions_[1]));
  if (!is_cut_due_ && (!goes_on || cut_now_.exchange(false))) cut();
}

bool CuttingProxy::write(int to, Direction& direction) {
  while (direction.sent < direction.bytes.size()) {
    const std::size_t rest = direction.bytes.size() - direction.sent;
    const std::size_t allowed = std::min<std::uint64_t>(rest, until_cut_);
    const ssize_t size = ::send(to, direction.bytes.data() + direction.sent, allowed, MSG_NOSIGNAL);
    if (size < 0) return would_block();
    direction.sent += static_cast<std::size_t>(size);
    if (until_cut_ != UINT64_MAX) until_cut_ -= static_cast<std::uint64_t>(size);
    if (until_cut_ == 0) {
      is_cut_due_ = true;
      return true;
    }
  }
  return true;
}

bool CuttingProxy::forward(int from, int to, Direction& direction) {
  if (is_cut_due_ || !write(to, direction)) return false;
  if (direction.sent < direction.bytes.size()) return true;
  direction.sent = 0;
  direction.bytes.resize(kPieceBytes);
  const ssize_t size = ::recv(from, direction.bytes.data(), kPieceBytes, 0);
  direction.bytes.resize(size > 0 ? static_cast<std::size_t>(size) : 0);
  if (size == 0 || (size < 0 && !would_block())) return false;
  return write(to, direction);
}

void CuttingProxy::cut() {
  if (cuts_.fetch_add(1) % 2 == 0) {
    reset_on_close(node_.get());
    reset_on_close(hub_.get());
  }
  node_.reset();
  hub_.reset();
  directions_ = {};
  choose_cut();
}

}  // namespace gimnet::stress
