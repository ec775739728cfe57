#include "client/gimi/ping_table.hpp"

#include <utility>

#include "client/gimi/ending.hpp"

namespace gimnet::gimi {

void PingTable::expect(std::uint32_t number, Peer peer) {
  const MutexLock lock(mutex_);
  waiting_[number] = {peer, steady_now_ns(), std::nullopt};
}

void PingTable::forget(std::uint32_t number) {
  const MutexLock lock(mutex_);
  waiting_.erase(number);
}

Outcome<TracedPing> PingTable::wait(std::uint32_t number, std::int64_t deadline, Timeout timeout) {
  const MutexLock lock(mutex_);
  const auto place = waiting_.find(number);
  if (place == waiting_.end()) return Failure{Status::bad_argument, "no such ping"};
  while (!place->second.answer) {
    if (end_) {
      place->second.answer = end_.failure("ping " + place->second.peer.text());
    } else if (is_over(deadline)) {
      place->second.answer =
          Failure{Status::timeout, place->second.peer.text() + " did not answer within " +
                                       std::to_string(timeout.count()) + " ms"};
    } else {
      static_cast<void>(answered_.wait_until(mutex_, deadline));
    }
  }
  auto answer = std::move(*place->second.answer);
  waiting_.erase(place);
  return answer;
}

void PingTable::on_pong(std::uint32_t number, Peer from, std::vector<TraceHop> way) {
  const std::int64_t now = steady_now_ns();
  const MutexLock lock(mutex_);
  const auto place = waiting_.find(number);
  if (place == waiting_.end() || place->second.peer != from) return;
  place->second.answer = TracedPing{now - place->second.sent_ns, std::move(way)};
  answered_.notify_all();
}

void PingTable::on_lost(std::uint32_t number, Failure why) {
  const MutexLock lock(mutex_);
  const auto place = waiting_.find(number);
  if (place == waiting_.end()) return;
  why.sentence.insert(0, place->second.peer.text() + " cannot be reached: ");
  place->second.answer = std::move(why);
  answered_.notify_all();
}

void PingTable::end(const Ending& ending) {
  const MutexLock lock(mutex_);
  end_ = ending;
  answered_.notify_all();
}

}  // namespace gimnet::gimi
