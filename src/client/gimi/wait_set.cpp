#include "client/gimi/wait_set.hpp"

#include <utility>

#include "client/gimi/ending.hpp"

namespace gimnet::gimi {
namespace {

thread_local constinit bool t_in_callback = false;

}  // namespace

bool is_in_callback() { return t_in_callback; }

bool set_in_callback(bool inside) { return std::exchange(t_in_callback, inside); }

bool WaitSource::join(std::shared_ptr<WaitSet> set, const Member& member, bool ready) {
  if (set_ != nullptr && !set_->has_ended()) return false;
  set_ = std::move(set);
  member_ = member;
  ready_ = false;
  update(ready);
  return true;
}

void WaitSource::leave() {
  if (set_ == nullptr) return;
  set_->take_out(*this);
  set_ = nullptr;
  member_ = {};
}

void WaitSource::change(bool ready) {
  ready_ = ready;
  if (ready) {
    set_->put(*this);
  } else {
    set_->take_out(*this);
  }
}

bool WaitSet::has_ended() {
  const MutexLock lock(mutex_);
  return ended_;
}

void WaitSet::put(WaitSource& source) {
  const MutexLock lock(mutex_);
  if (ended_) return;
  source.enter_before(ready_);
  if (waiting_ != 0) changed_.notify_one();
  show();
}

void WaitSet::take_out(WaitSource& source) {
  const MutexLock lock(mutex_);
  source.WaitLink::leave();
  show();
}

void WaitSet::show() {
  if (!signal_ || shown_ == is_awake()) return;
  shown_ = !shown_;
  if (shown_) {
    signal_->raise();
  } else {
    signal_->clear();
  }
}

Outcome<std::size_t> WaitSet::wait(std::span<gimi_ready> ready, Timeout timeout) {
  const std::int64_t deadline = deadline_after(timeout);
  const MutexLock lock(mutex_);
  while (!is_awake()) {
    if (ended_) return Failure{Status::closed, "the wait set was closed"};
    if (is_over(deadline)) return Failure{Status::timeout, "no member has anything"};
    ++waiting_;
    static_cast<void>(changed_.wait_until(mutex_, deadline));
    --waiting_;
  }
  woken_ = false;
  std::size_t count = 0;
  const WaitLink* const last = ready_.previous();
  while (count < ready.size() && !ready_.alone()) {
    auto& source = static_cast<WaitSource&>(*ready_.next());
    ready[count++] = {source.member_.handle, source.member_.user, 0};
    source.WaitLink::leave();
    source.enter_before(ready_);
    if (&source == last) break;
  }
  // Another thread need not wait until this one has taken everything.
  if (waiting_ != 0 && !ready_.alone()) changed_.notify_one();
  show();
  return count;
}

void WaitSet::wake() {
  const MutexLock lock(mutex_);
  woken_ = !ended_;
  changed_.notify_one();
  show();
}

Outcome<int> WaitSet::descriptor() {
  const MutexLock lock(mutex_);
  if (ended_) return Failure{Status::closed, "the wait set was closed"};
  if (!signal_) {
    signal_.emplace();
    if (!signal_->valid()) {
      signal_.reset();
      return Failure{Status::system, "the system has no descriptor left for the wait set"};
    }
    show();
  }
  return signal_->descriptor();
}

void WaitSet::end() {
  const MutexLock lock(mutex_);
  ended_ = true;
  woken_ = false;
  while (!ready_.alone()) ready_.next()->leave();
  signal_.reset();
  changed_.notify_all();
}

}  // namespace gimnet::gimi
