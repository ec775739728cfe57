#include "client/gimi/send_stream.hpp"

#include <utility>

#include "base/endian.hpp"
#include "client/gimi/ending.hpp"

namespace gimnet::gimi {
namespace {

using proto::gimi::MessageOperation;

Loss withdrawn() { return {LossReason::service_gone, "the service was withdrawn"}; }

}  // namespace

Outcome<void> SendStream::send(BytesView data, Timeout timeout, More more) {
  const std::int64_t deadline = deadline_after(timeout);
  std::uint32_t sequence = 0;
  Destination to;
  {
    const MutexLock lock(mutex_);
    auto turn = take_turn(data, deadline);
    if (!turn) return turn.failure();
    if (*turn == Turn::held) return {};
    sequence = window_.open(data.size(), steady_now_ns());
    to = destination_;
  }
  const nif_status status = transmit(to, {sequence, MessageOperation::data, 0, 0, to.epoch}, data,
                                     more, nif_timeout_until(deadline));
  auto failure = status == NIF_OK ? Failure{} : failure_of(status, "send to " + target());
  bool unwatched = false;
  {
    const MutexLock lock(mutex_);
    unwatched = finish(sequence, status, more);
  }
  if (unwatched) watch_if_needed();
  if (status == NIF_OK) return {};
  return failure;
}

Outcome<SendStream::Turn> SendStream::take_turn(BytesView data, std::int64_t deadline) {
  while (!end_) {
    if (options_.end_at_loss && counts_.lost != 0) return loss();
    if (destination_.id == 0) {
      return Failure{
          Status::not_found,
          "not sent to " + service_ +
              ": nobody accepts it at the moment; it can be sent to again when it is back"};
    }
    const bool room = window_.has_room(data.size());
    if (!sending_ && room) {
      if (std::exchange(held_, std::nullopt)) ++counts_.skipped;
      sending_ = true;
      return Turn::send;
    }
    if (!room && options_.at_full == AtFullWindow::skip) {
      ++counts_.skipped;
      return Failure{Status::window_full, "not sent to " + target() + ": " +
                                              std::to_string(window_.size()) +
                                              " messages wait for their acknowledgement"};
    }
    if (!room && options_.at_full == AtFullWindow::hold_latest) {
      hold(data);
      return Turn::held;
    }
    // Nobody acknowledges what was not written.
    if (std::exchange(unflushed_, false)) static_cast<void>(nif_flush(uplink_.node()));
    if (is_over(deadline)) {
      return Failure{Status::timeout,
                     "not sent to " + target() +
                         ": earlier messages were not acknowledged within the time given"};
    }
    static_cast<void>(changed_.wait_until(mutex_, deadline));
  }
  return end_.failure("send to " + target());
}

void SendStream::hold(BytesView data) {
  if (held_) ++counts_.skipped;
  held_.emplace(data.span().begin(), data.span().end());
}

/// Puts back a message that the program was told to be held: it could not be sent yet.
void SendStream::hold_again(std::vector<std::byte> data) {
  if (held_) {
    ++counts_.skipped;  // a newer one came meanwhile
  } else if (end_ || destination_.id == 0) {
    settle_freed({.acknowledged = 0, .lost = 1},
                 end_ ? Loss{LossReason::connection_lost, end_.why()} : withdrawn());
  } else {
    held_ = std::move(data);
  }
}

nif_status SendStream::transmit(const Destination& to, const proto::gimi::MessageHeader& header,
                                BytesView data, More more, std::int32_t timeout_ms) const {
  const bool synchronized = options_.window != 0;
  Envelope envelope{to.id, to.kind, NIF_POLICY_DEFAULT, options_.lane, to.key, options_.age_ms_max,
                    0};
  if (synchronized) envelope.flags |= NIF_FLAG_REPORT;
  if (more == More::yes) envelope.flags |= NIF_FLAG_MORE;
  proto::gimi::MessageHeader asking = header;
  if (synchronized) asking.flags |= proto::gimi::kFlagAckWanted;
  const bool stamped = options_.timestamp && header.operation == MessageOperation::data;
  return uplink_.transmit(envelope, asking, stamped, data, timeout_ms);
}

nif_status SendStream::transmit_ping(const Destination& to, std::uint32_t number) const {
  std::array<std::byte, proto::gimi::kPingTimeSize> sent;
  store_le(sent.data(), wall_now_ns());
  return transmit(to, {number, MessageOperation::ping, 0, 0, to.epoch}, sent, More::no, 0);
}

/// True: somebody should watch over the stream. Another thread may have left a message to be held
/// while this one was sending: it goes by tick() only, also where this one was not sent, or is
/// acknowledged already.
bool SendStream::finish(std::uint32_t sequence, nif_status status, More more) {
  sending_ = false;
  changed_.notify_all();
  if (status != NIF_OK) {
    // It may have been given up with all others meanwhile; then it counts as never sent all the
    // same.
    if (window_.synchronized() && !window_.cancel(sequence) && counts_.lost != 0) --counts_.lost;
    if (window_.empty()) forget_doubts();
  } else {
    ++counts_.sent;
    unflushed_ = more == More::yes;
  }
  return (!window_.empty() || held_) && !watched_;
}

void SendStream::watch_if_needed() {
  {
    const MutexLock lock(mutex_);
    if (watched_ || end_) return;
    watched_ = true;
  }
  keeper_.watch(*this);
}

Outcome<void> SendStream::settle(Timeout timeout) {
  const std::int64_t deadline = deadline_after(timeout);
  const MutexLock lock(mutex_);
  if (std::exchange(unflushed_, false)) static_cast<void>(nif_flush(uplink_.node()));
  while (!window_.empty() || held_) {
    if (end_) return end_.failure("settle what was sent to " + target());
    if (is_over(deadline)) {
      return Failure{Status::timeout, std::to_string(window_.size()) + " messages to " + target() +
                                          " are not acknowledged yet"};
    }
    static_cast<void>(changed_.wait_until(mutex_, deadline));
  }
  if (counts_.lost == 0) return {};
  return loss();
}

Failure SendStream::loss() const {
  return {Status::not_delivered, std::to_string(counts_.lost) + " of " +
                                     std::to_string(counts_.sent) + " messages to " + target() +
                                     " were not acknowledged: " + counts_.loss};
}

SendCounts SendStream::counts() {
  const MutexLock lock(mutex_);
  SendCounts counts = counts_;
  counts.waiting = window_.size() + (held_ ? 1 : 0);
  return counts;
}

void SendStream::settle_freed(const AckWindow::Freed& freed, const Loss& why) {
  if (!freed.any()) return;
  counts_.acknowledged += freed.acknowledged;
  counts_.lost += freed.lost;
  // That one of them may have arrived is what a program has to know before it sends them again.
  if (freed.lost != 0 && counts_.loss_reason != LossReason::link_unsure) {
    counts_.loss = why.words;
    counts_.loss_reason = why.reason;
  }
  changed_.notify_all();
}

bool SendStream::on_ack(std::uint32_t sequence, const proto::gimi::Ack& ack) {
  const MutexLock lock(mutex_);
  const bool answers = ack.pong_sequence != 0 && ack.pong_sequence == window_.ping_number();
  const AckWindow::Freed freed =
      window_.acknowledge(sequence, ack.bitmap, ack.pong_sequence, steady_now_ns());
  const Loss& doubt = asked_ ? asked_ : doubt_;
  settle_freed(freed, doubt ? doubt
                            : Loss{LossReason::not_received,
                                   "the receiver answered a later question, but did not get them"});
  if (answers) asked_ = {};
  if (freed.lost != 0 || window_.empty()) forget_doubts();
  return held_ && window_.has_room(held_->size());
}

void SendStream::on_lost(std::uint32_t sequence, const Loss& why) {
  const MutexLock lock(mutex_);
  settle_freed(window_.lose(sequence), why);
  if (window_.empty()) forget_doubts();
}

void SendStream::forget_doubts() {
  doubt_ = {};
  asked_ = {};
}

void SendStream::on_doubt(const Loss& why) {
  const MutexLock lock(mutex_);
  // The first reason counts: what is reported after it may be its consequence.
  if (!doubt_ && !window_.empty()) doubt_ = why;
  window_.hurry();
}

void SendStream::lose_all(const Loss& why) {
  AckWindow::Freed freed = window_.lose_all();
  if (std::exchange(held_, std::nullopt)) ++freed.lost;
  const Loss& doubt = asked_ ? asked_ : doubt_;
  settle_freed(freed, doubt.reason == LossReason::link_unsure ? doubt : why);
  forget_doubts();
}

void SendStream::on_broken(const Loss& why) {
  const MutexLock lock(mutex_);
  lose_all(why);
}

void SendStream::on_moved(const ServicePlace& place) {
  const MutexLock lock(mutex_);
  const std::uint32_t id = place.destination();
  const bool same =
      id == destination_.id && place.provider == place_.provider && place.session == place_.session;
  place_ = place;
  if (same) return;
  lose_all(id == 0 ? withdrawn()
                   : Loss{LossReason::service_gone,
                          "the service is somewhere else now, and cannot tell any more"});
  // Another provider knows nothing of what the former one got.
  destination_.epoch = Uplink::draw_epoch();
  destination_.id = id;
  if (id != 0) destination_.key = place.key;
  changed_.notify_all();
}

std::uint32_t SendStream::epoch() {
  const MutexLock lock(mutex_);
  return destination_.epoch;
}

void SendStream::end(const Ending& ending) {
  const MutexLock lock(mutex_);
  end_ = ending;
  changed_.notify_all();
}

bool SendStream::idle() {
  const MutexLock lock(mutex_);
  return !sending_ && !watched_ && !held_ && window_.empty();
}

std::uint32_t SendStream::group() {
  const MutexLock lock(mutex_);
  return destination_.id;
}

bool SendStream::tick(std::int64_t now_ns) {
  std::uint32_t ping = 0;
  std::uint32_t sequence = 0;
  std::optional<std::vector<std::byte>> data;
  Destination to;
  {
    const MutexLock lock(mutex_);
    to = destination_;
    if (end_ || (window_.empty() && !held_)) return watched_ = false;
    if (sending_)
      return true;  // what that thread sends stands before a PING that could be put behind it now
    if (held_ && window_.has_room(held_->size())) {
      data = std::exchange(held_, std::nullopt);
      sequence = window_.open(data->size(), now_ns);
    } else if (window_.ping_due(now_ns)) {
      ping = window_.ping_number() != 0 ? window_.ping_number() : uplink_.next_ping();
      if (ping != window_.ping_number()) asked_ = std::exchange(doubt_, {});
      window_.ping_sent(ping, now_ns);  // before the PONG can be here
    } else {
      return true;
    }
    sending_ = true;
  }
  if (data) {
    const nif_status status =
        transmit(to, {sequence, MessageOperation::data, 0, 0, to.epoch}, *data, More::no, 0);
    const MutexLock lock(mutex_);
    static_cast<void>(finish(sequence, status, More::no));
    // Before the turn is anybody else's, whose message is newer.
    if (status != NIF_OK) hold_again(std::move(*data));
    return true;
  }
  const nif_status status = transmit_ping(to, ping);
  const MutexLock lock(mutex_);
  sending_ = false;
  changed_.notify_all();
  if (status != NIF_OK) window_.ping_not_sent();
  return true;
}

}  // namespace gimnet::gimi
