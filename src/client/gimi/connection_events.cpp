#include "client/gimi/connection_events.hpp"

#include <cstdio>
#include <cstdlib>
#include <string_view>
#include <utility>

#include "base/clock.hpp"

namespace gimnet::gimi {

void log_info(const std::string& node, const std::string& words) {
  const char* const level = std::getenv("GIMNET_LOG");
  if (level == nullptr || std::string_view(level) != "info") return;
  const std::string line = "gimnet: " + node + ": " + words + "\n";
  static_cast<void>(std::fwrite(line.data(), 1, line.size(), stderr));
}

Outcome<ConnectionEvent> ConnectionQueue::receive(Timeout timeout) {
  const std::int64_t deadline = deadline_after(timeout);
  const MutexLock lock(mutex_);
  while (events_.empty()) {
    if (end_) return end_.failure("wait for events of the connection");
    if (is_over(deadline))
      return Failure{Status::timeout, "the connection did not change within the time given"};
    static_cast<void>(changed_.wait_until(mutex_, deadline));
  }
  ConnectionEvent event = std::move(events_.front());
  events_.pop_front();
  source_.update(!events_.empty() || end_);
  return event;
}

void ConnectionQueue::visit(const SourceVisitor& visitor) {
  const MutexLock lock(mutex_);
  visitor(source_, !events_.empty() || end_);
}

void ConnectionQueue::put(ConnectionEvent event) {
  const MutexLock lock(mutex_);
  if (events_.size() == kEventsMax) {
    const std::uint32_t skipped = events_.front().skipped + 1;
    events_.pop_front();
    events_.front().skipped += skipped;
  }
  events_.push_back(std::move(event));
  changed_.notify_all();
  source_.update(true);
}

void ConnectionQueue::end(const Ending& ending) {
  const MutexLock lock(mutex_);
  if (end_) return;
  end_ = ending;
  changed_.notify_all();
  source_.update(true);
}

ConnectionEvents::Queue ConnectionEvents::begin() {
  auto queue = std::make_shared<ConnectionQueue>();
  const MutexLock lock(mutex_);
  queue->put(last_);
  if (end_) queue->end(end_);
  queues_.push_back(queue);
  return queue;
}

void ConnectionEvents::remove(const Queue& queue) {
  const MutexLock lock(mutex_);
  std::erase(queues_, queue);
}

void ConnectionEvents::tell(ConnectionChange change, const std::string& node, std::string why) {
  log_info(node, why);
  const MutexLock lock(mutex_);
  last_ = {change, 0, wall_now_ns(), std::move(why)};
  for (const Queue& queue : queues_) queue->put(last_);
}

void ConnectionEvents::end(const Ending& ending) {
  const MutexLock lock(mutex_);
  if (end_) return;
  end_ = ending;
  for (const Queue& queue : queues_) queue->end(ending);
}

}  // namespace gimnet::gimi
