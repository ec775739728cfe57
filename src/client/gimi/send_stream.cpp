#include "client/gimi/send_stream.hpp"

#include <utility>

#include "base/endian.hpp"
#include "client/gimi/deadline.hpp"

namespace gimnet::gimi {
namespace {

using proto::gimi::Operation;

Failure closed_failure() { return {Status::closed, "cannot send: the node was closed"}; }

}  // namespace

Outcome<void> SendStream::send(BytesView data, Timeout timeout, More more) {
  const std::int64_t deadline = deadline_after(timeout);
  std::uint32_t sequence = 0;
  {
    const MutexLock lock(mutex_);
    auto turn = take_turn(data, deadline);
    if (!turn) return turn.failure();
    if (*turn == Turn::held) return {};
    sequence = window_.open(steady_now_ns());
  }
  const nif_status status = transmit(Operation::data, sequence, data, more, nif_timeout_until(deadline));
  auto failure = status == NIF_OK ? Failure{} : failure_of(status, target());
  if (finish(sequence, status, more)) watch_if_needed();
  if (status == NIF_OK) return {};
  return failure;
}

Outcome<SendStream::Turn> SendStream::take_turn(BytesView data, std::int64_t deadline) {
  while (!closed_) {
    if (!sending_ && window_.has_room()) {
      if (std::exchange(held_, std::nullopt)) ++counts_.skipped;
      sending_ = true;
      return Turn::send;
    }
    if (!window_.has_room() && options_.at_full == AtFullWindow::skip) {
      ++counts_.skipped;
      return Failure{Status::window_full, "not sent to " + to_.text() + ": " + std::to_string(window_.size()) +
                                              " messages wait for their acknowledgement"};
    }
    if (!window_.has_room() && options_.at_full == AtFullWindow::hold_latest) {
      hold(data);
      return Turn::held;
    }
    // Nobody acknowledges what was not written.
    if (std::exchange(unflushed_, false)) static_cast<void>(nif_flush(uplink_.node()));
    if (is_over(deadline)) {
      return Failure{Status::timeout,
                     "not sent to " + to_.text() + ": earlier messages were not acknowledged within the time given"};
    }
    static_cast<void>(changed_.wait_until(mutex_, deadline));
  }
  return closed_failure();
}

void SendStream::hold(BytesView data) {
  if (held_) ++counts_.skipped;
  held_.emplace(data.span().begin(), data.span().end());
}

nif_status SendStream::transmit(Operation operation, std::uint32_t number, BytesView data, More more,
                                std::int32_t timeout_ms) const {
  const bool synchronized = options_.window != 0;
  Envelope envelope{to_.id, NIF_UNICAST, NIF_POLICY_DEFAULT, options_.lane, options_.key, options_.age_max_ms, 0};
  if (synchronized) envelope.flags |= NIF_FLAG_REPORT;
  if (more == More::yes) envelope.flags |= NIF_FLAG_MORE;
  proto::gimi::MessageHeader header{number, operation, 0, 0};
  if (synchronized) header.flags |= proto::gimi::kFlagAckWanted;
  return uplink_.transmit(envelope, header, options_.timestamp && operation == Operation::data, data, timeout_ms);
}

nif_status SendStream::transmit_ping(std::uint32_t number) const {
  std::array<std::byte, proto::gimi::kPingTimeSize> sent;
  store_le(sent.data(), wall_now_ns());
  return transmit(Operation::ping, number, sent, More::no, 0);
}

/// True: somebody should watch over the stream.
bool SendStream::finish(std::uint32_t sequence, nif_status status, More more) {
  const MutexLock lock(mutex_);
  sending_ = false;
  changed_.notify_all();
  if (status != NIF_OK) {
    // It may have been given up with all others meanwhile; then it counts as never sent all the same.
    if (window_.synchronized() && !window_.cancel(sequence) && counts_.lost != 0) --counts_.lost;
    return false;
  }
  ++counts_.sent;
  unflushed_ = more == More::yes;
  return !window_.empty() && !watched_;
}

void SendStream::watch_if_needed() {
  {
    const MutexLock lock(mutex_);
    if (watched_ || closed_) return;
    watched_ = true;
  }
  keeper_.watch(*this);
}

Outcome<void> SendStream::settle(Timeout timeout) {
  const std::int64_t deadline = deadline_after(timeout);
  const MutexLock lock(mutex_);
  if (std::exchange(unflushed_, false)) static_cast<void>(nif_flush(uplink_.node()));
  while (!window_.empty() || held_) {
    if (closed_) return closed_failure();
    if (is_over(deadline)) {
      return Failure{Status::timeout,
                     std::to_string(window_.size()) + " messages to " + to_.text() + " are not acknowledged yet"};
    }
    static_cast<void>(changed_.wait_until(mutex_, deadline));
  }
  if (counts_.lost == 0) return {};
  return Failure{Status::not_delivered, std::to_string(counts_.lost) + " of " + std::to_string(counts_.sent) +
                                            " messages to " + to_.text() + " were not acknowledged: " + counts_.loss};
}

SendCounts SendStream::counts() {
  const MutexLock lock(mutex_);
  SendCounts counts = counts_;
  counts.waiting = window_.size() + (held_ ? 1 : 0);
  return counts;
}

void SendStream::settle_freed(const SendWindow::Freed& freed, const std::string& why) {
  if (!freed.any()) return;
  counts_.acknowledged += freed.acknowledged;
  counts_.lost += freed.lost;
  if (freed.lost != 0) counts_.loss = why;
  changed_.notify_all();
}

bool SendStream::on_ack(std::uint32_t sequence, const proto::gimi::Ack& ack) {
  const MutexLock lock(mutex_);
  settle_freed(window_.acknowledge(sequence, ack.bitmap, ack.pong_sequence, steady_now_ns()),
               "the receiver answered a later question, but did not get them");
  return held_ && window_.has_room();
}

void SendStream::on_lost(std::uint32_t sequence, const std::string& why) {
  const MutexLock lock(mutex_);
  settle_freed(window_.lose(sequence), why);
}

void SendStream::on_doubt() {
  const MutexLock lock(mutex_);
  window_.hurry();
}

void SendStream::on_broken(const std::string& why) {
  const MutexLock lock(mutex_);
  SendWindow::Freed freed = window_.lose_all();
  if (std::exchange(held_, std::nullopt)) ++freed.lost;
  settle_freed(freed, why);
}

void SendStream::close() {
  const MutexLock lock(mutex_);
  closed_ = true;
  changed_.notify_all();
}

bool SendStream::tick(std::int64_t now_ns) {
  std::uint32_t ping = 0;
  std::uint32_t sequence = 0;
  std::optional<std::vector<std::byte>> data;
  {
    const MutexLock lock(mutex_);
    if (closed_ || (window_.empty() && !held_)) return watched_ = false;
    if (sending_) return true;  // what that thread sends stands before a PING that could be put behind it now
    if (held_ && window_.has_room()) {
      data = std::exchange(held_, std::nullopt);
      sequence = window_.open(now_ns);
    } else if (window_.ping_due(now_ns)) {
      ping = window_.ping_number() != 0 ? window_.ping_number() : uplink_.next_ping();
    } else {
      return true;
    }
    sending_ = true;
  }
  const nif_status status = data ? transmit(Operation::data, sequence, *data, More::no, 0) : transmit_ping(ping);
  if (data) {
    static_cast<void>(finish(sequence, status, More::no));
    const MutexLock lock(mutex_);
    if (status != NIF_OK && !held_) held_ = std::move(data);
    return true;
  }
  const MutexLock lock(mutex_);
  sending_ = false;
  changed_.notify_all();
  if (status == NIF_OK) window_.ping_sent(ping, now_ns);
  return true;
}

}  // namespace gimnet::gimi
