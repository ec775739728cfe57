#include "client/gimi/watch_queues.hpp"

#include <utility>

#include "client/gimi/ending.hpp"
#include "client/gimi/hub_records.hpp"

namespace gimnet::gimi {
namespace {

WatchEvent event_of(const nif_incoming& in) {
  const nif_watched& told = *in.watched;
  WatchEvent event;
  event.change = static_cast<Change>(told.change);
  event.former_name = told.former_name;
  event.hub_id = told.hub_id;
  event.epoch = told.epoch;
  event.version = told.version;
  event.why = in.text;
  if (told.node != nullptr) event.node = record_of(*told.node);
  if (told.service != nullptr) event.service = record_of(*told.service);
  return event;
}

}  // namespace

Outcome<WatchEvent> WatchQueue::receive(Timeout timeout) {
  const std::int64_t deadline = deadline_after(timeout);
  Entry entry;
  {
    const MutexLock lock(mutex_);
    while (entries_.empty()) {
      if (end_) return end_.failure("watch");
      if (is_over(deadline))
        return Failure{Status::timeout, "nothing changed within the time given"};
      static_cast<void>(changed_.wait_until(mutex_, deadline));
    }
    entry = std::move(entries_.front());
    entries_.pop_front();
    source_.update(!entries_.empty() || end_);
  }
  return taken(std::move(entry));
}

WatchEvent WatchQueue::taken(Entry entry) const {
  if (entry.last) static_cast<void>(nif_watch_taken(uplink_.node(), entry.watch));
  return std::move(entry.event);
}

void WatchQueue::put(WatchEvent event, std::uint32_t watch, bool last) {
  const MutexLock lock(mutex_);
  entries_.push_back({std::move(event), watch, last});
  changed_.notify_all();
  source_.update(true);
}

void WatchQueue::end(const Ending& ending) {
  const MutexLock lock(mutex_);
  end_ = ending;
  changed_.notify_all();
  source_.update(true);
}

void WatchQueue::visit(const SourceVisitor& visitor) {
  const MutexLock lock(mutex_);
  visitor(source_, !entries_.empty() || end_);
}

Outcome<WatchQueues::Begun> WatchQueues::watch(const std::string& pattern,
                                               const WatchOptions& options, Timeout timeout) {
  std::uint32_t subjects = NIF_WATCH_BY_HAND;
  if (options.nodes) subjects |= NIF_WATCH_NODES;
  if (options.services) subjects |= NIF_WATCH_SERVICES;
  {
    const MutexLock lock(mutex_);
    ++asking_;
  }
  Begun begun;
  const nif_status status = nif_watch(uplink_.node(), pattern.empty() ? nullptr : pattern.c_str(),
                                      subjects, &begun.number, nif_timeout(timeout));
  const std::string doing = pattern.empty() ? "watch" : "watch '" + pattern + "'";
  auto failure = status == NIF_OK ? Failure{} : failure_of(status, doing);
  {
    const MutexLock lock(mutex_);
    --asking_;
    if (status == NIF_OK) {
      begun.queue = std::make_shared<WatchQueue>(uplink_);
      queues_.emplace(begun.number, begun.queue);
      if (end_) begun.queue->end(end_);
    }
  }
  // NIF held back the events that came meanwhile.
  static_cast<void>(nif_deliver(uplink_.node()));
  if (status != NIF_OK) return failure;
  return begun;
}

void WatchQueues::unwatch(std::uint32_t number) {
  {
    const MutexLock lock(mutex_);
    queues_.erase(number);
  }
  static_cast<void>(nif_unwatch(uplink_.node(), number, kLeaveTimeoutMs));
}

bool WatchQueues::on_watched(const nif_incoming& in) {
  if (in.watched == nullptr) return true;
  std::shared_ptr<WatchQueue> queue;
  {
    const MutexLock lock(mutex_);
    const auto found = queues_.find(in.watched->watch);
    if (found == queues_.end()) return asking_ == 0;
    queue = found->second;
  }
  queue->put(event_of(in), in.watched->watch, in.watched->last != 0);
  return true;
}

void WatchQueues::end(const Ending& ending) {
  const MutexLock lock(mutex_);
  end_ = ending;
  for (const auto& [number, queue] : queues_) queue->end(ending);
}

}  // namespace gimnet::gimi
