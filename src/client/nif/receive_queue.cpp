#include "client/nif/receive_queue.hpp"

#include <algorithm>
#include <array>

namespace gimnet::nif {
namespace {

/// Items taken under one lock; frames are taken apart outside it.
constexpr std::size_t kItemsAtOnce = 64;

std::size_t cost(const Item& item) { return item.bytes + sizeof(Item); }

}  // namespace

ReceiveQueue::~ReceiveQueue() {
  for (const Item& item : items_) item.storage->release();
}

void ReceiveQueue::push(std::span<const Item> items) {
  if (items.empty()) return;
  const MutexLock lock(mutex_);
  const bool was_empty = items_.empty();
  items_.insert(items_.end(), items.begin(), items.end());
  for (const Item& item : items) bytes_ += cost(item);
  if (was_empty && event_) event_->raise();
  if (items.size() > 1) {
    filled_.notify_all();
  } else {
    filled_.notify_one();
  }
}

bool ReceiveQueue::has_room() {
  const MutexLock lock(mutex_);
  const bool room = items_.empty() || bytes_ < (stopped_ ? bytes_max_ / 2 : bytes_max_);
  if (!room && !stopped_) ++stops_;
  stopped_ = !room;
  return room;
}

Item ReceiveQueue::take_first() {
  const Item item = items_.front();
  items_.pop_front();
  bytes_ -= cost(item);
  return item;
}

void ReceiveQueue::after_removal() {
  if (items_.empty() && event_ && end_.status == NIF_OK) event_->clear();
  if (stopped_ && (items_.empty() || bytes_ < bytes_max_ / 2)) {
    stopped_ = false;
    room_.raise();
  }
}

nif_status ReceiveQueue::pop(std::span<nif_incoming> in, std::size_t& count, Deadline deadline) {
  std::array<Item, kItemsAtOnce> taken;
  std::size_t size = 0;
  count = 0;
  {
    const MutexLock lock(mutex_);
    while (items_.empty() || closed_) {
      if (closed_) return fail(NIF_CLOSED, "the handle was closed");
      if (end_.status != NIF_OK) return fail(end_);
      if (deadline != kNever && steady_now_ns() >= deadline) return NIF_TIMEOUT;
      static_cast<void>(filled_.wait_until(mutex_, deadline));
    }
    while (size < std::min(in.size(), taken.size()) && !items_.empty())
      taken[size++] = take_first();
    after_removal();
  }
  for (; count < size; ++count) in[count] = incoming_of(taken[count]);
  return NIF_OK;
}

std::size_t ReceiveQueue::take(std::span<Item> items) {
  const MutexLock lock(mutex_);
  const std::size_t count = std::min(items.size(), items_.size());
  for (Item& item : items.first(count)) item = take_first();
  return count;
}

void ReceiveQueue::give_back(std::span<const Item> items) {
  const MutexLock lock(mutex_);
  if (!items.empty()) items_.insert(items_.begin(), items.begin(), items.end());
  for (const Item& item : items) bytes_ += cost(item);
  after_removal();
}

void ReceiveQueue::end(const Failure& failure) {
  const MutexLock lock(mutex_);
  end_ = failure;
  if (event_) event_->raise();
  filled_.notify_all();
}

void ReceiveQueue::close() {
  const MutexLock lock(mutex_);
  closed_ = true;
  filled_.notify_all();
}

int ReceiveQueue::event_descriptor() {
  const MutexLock lock(mutex_);
  if (!event_) {
    event_ = std::make_unique<net::WakeSignal>();
    if (!items_.empty() || end_.status != NIF_OK) event_->raise();
  }
  return event_->descriptor();
}

std::size_t ReceiveQueue::bytes() {
  const MutexLock lock(mutex_);
  return bytes_;
}

std::uint64_t ReceiveQueue::stops() {
  const MutexLock lock(mutex_);
  return stops_;
}

}  // namespace gimnet::nif
