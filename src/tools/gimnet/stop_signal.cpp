#include "tools/gimnet/stop_signal.hpp"

#include <pthread.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <csignal>
#include <cstdint>
#include <utility>

#include "base/clock.hpp"

namespace gimnet::tool {
namespace {

/// Ends the watcher; nobody sends it from outside for another reason.
constexpr int kEndWatcher = SIGUSR1;
constexpr int kSignalExitBase = 128;

bool is_ignored(int signal) {
  struct sigaction action{};
  return ::sigaction(signal, nullptr, &action) == 0 && action.sa_handler == SIG_IGN;
}

sigset_t watched_signals() {
  sigset_t set;
  sigemptyset(&set);
  sigaddset(&set, SIGINT);
  sigaddset(&set, SIGTERM);
  // A blocked signal waits for us even where it is ignored.
  if (!is_ignored(SIGHUP)) sigaddset(&set, SIGHUP);
  sigaddset(&set, kEndWatcher);
  return set;
}

}  // namespace

StopSignal::StopSignal() : descriptor_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
  const sigset_t set = watched_signals();
  pthread_sigmask(SIG_BLOCK, &set, nullptr);
  watcher_ = std::thread([this] { watch(); });
}

StopSignal::~StopSignal() {
  pthread_kill(watcher_.native_handle(), kEndWatcher);
  watcher_.join();
  ::close(descriptor_);
}

void StopSignal::watch() {
  const sigset_t set = watched_signals();
  for (int signal = 0; sigwait(&set, &signal) == 0 && signal != kEndWatcher;) take(signal);
}

void StopSignal::take(int signal) {
  {
    const MutexLock lock(mutex_);
    // Of a terminal that goes one may hear twice, from the shell and from the kernel.
    if (signal_ != 0 && signal == SIGHUP) return;
    if (signal_ != 0 || ends_at_once_) ::_exit(kSignalExitBase + signal);
    signal_ = signal;
    taken_ns_ = steady_now_ns();
    changed_.notify_all();
  }
  static_cast<void>(::eventfd_write(descriptor_, 1));
  {
    const MutexLock lock(action_mutex_);
    if (action_) std::exchange(action_, nullptr)();
  }
  const MutexLock lock(mutex_);
  is_over_ = true;
  changed_.notify_all();
}

int StopSignal::signal() {
  const MutexLock lock(mutex_);
  return signal_;
}

bool StopSignal::wait_until(std::int64_t deadline_ns) {
  const MutexLock lock(mutex_);
  while (signal_ == 0) {
    if (steady_now_ns() >= deadline_ns) return true;
    static_cast<void>(changed_.wait_until(mutex_, deadline_ns));
  }
  return false;
}

void StopSignal::end_at_once() {
  const MutexLock lock(mutex_);
  if (signal_ != 0) ::_exit(kSignalExitBase + signal_);
  ends_at_once_ = true;
}

void StopSignal::leave(int code) {
  const MutexLock lock(mutex_);
  if (signal_ == 0) return;
  const std::int64_t deadline_ns = taken_ns_ + kPatienceNs;
  while (!is_over_ && steady_now_ns() < deadline_ns)
    static_cast<void>(changed_.wait_until(mutex_, deadline_ns));
  if (!is_over_) ::_exit(code);
}

void StopSignal::on_stop(std::function<void()> action) {
  {
    const MutexLock lock(mutex_);
    ends_at_once_ = false;
  }
  const bool late = signal() != 0;
  const MutexLock lock(action_mutex_);
  action_ = std::move(action);
  if (late && action_) std::exchange(action_, nullptr)();
}

}  // namespace gimnet::tool
