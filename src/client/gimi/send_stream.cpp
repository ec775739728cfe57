#include "client/gimi/send_stream.hpp"

#include <utility>

#include "base/endian.hpp"
#include "client/gimi/ending.hpp"

namespace gimnet::gimi {
namespace {

using proto::gimi::MessageOperation;

proto::gimi::MessageHeader data_header(std::uint32_t sequence, bool asks, std::uint32_t epoch) {
  const std::uint8_t flags = asks ? proto::gimi::kFlagAckWanted : std::uint8_t{0};
  return {sequence, MessageOperation::data, flags, 0, epoch};
}

Loss withdrawn() { return {LossReason::service_gone, "the service was withdrawn"}; }

}  // namespace

Outcome<void> SendStream::send(BytesView data, Timeout timeout, More more, AtAway at_away,
                               AtTimeout at_timeout) {
  return send(data, {.deadline_ns = deadline_after(timeout),
                     .more = more,
                     .at_away = at_away,
                     .at_timeout = timeout == kNoWait ? AtTimeout::try_again : at_timeout});
}

Outcome<void> SendStream::send_confirmed(BytesView data, Timeout timeout, AtAway at_away) {
  Confirmation confirmation;
  const Order order{.deadline_ns = deadline_after(timeout),
                    .at_away = at_away,
                    .at_timeout = timeout == kNoWait ? AtTimeout::try_again : AtTimeout::give_up,
                    .confirmation = &confirmation};
  auto fate = send(data, order);
  const MutexLock lock(mutex_);
  if (fate) fate = await(confirmation, order.deadline_ns);
  std::erase(confirmations_, &confirmation);
  return fate;
}

Outcome<void> SendStream::await(const Confirmation& confirmation, std::int64_t deadline_ns) {
  while (!confirmation.decided() && !end_ && !is_over(deadline_ns))
    static_cast<void>(changed_.wait_until(mutex_, deadline_ns));
  if (confirmation.acknowledged) return {};
  const std::string message = "the message to " + target();
  if (confirmation.loss) {
    return Failure{Status::not_delivered,
                   message + " was not acknowledged: " + confirmation.loss.words};
  }
  if (end_) return end_.failure("learn whether " + message + " arrived");
  return Failure{Status::timeout, message +
                                      " was sent, and not acknowledged within the time given: "
                                      "it may have arrived, or may still arrive"};
}

Outcome<void> SendStream::send(BytesView data, const Order& order) {
  Departure departure{.asks = synchronized() || order.confirmation != nullptr, .more = order.more};
  Destination to;
  {
    const MutexLock lock(mutex_);
    auto turn = take_turn(data, order);
    if (!turn) return turn.failure();
    if (*turn == Turn::held) return {};
    departure.sequence =
        departure.asks ? window_.open(data.size(), steady_now_ns()) : window_.pass();
    if (order.confirmation != nullptr) {
      order.confirmation->sequence = departure.sequence;
      confirmations_.push_back(order.confirmation);
    }
    to = destination_;
  }
  const nif_status status = transmit(to, data_header(departure.sequence, departure.asks, to.epoch),
                                     data, order.more, nif_timeout_until(order.deadline_ns));
  auto failure = status == NIF_OK ? Failure{} : failure_of(status, "send to " + target());
  bool unwatched = false;
  {
    const MutexLock lock(mutex_);
    unwatched = finish(departure, status);
    if (status == NIF_TOO_LARGE && departure.sequence == refused_sequence_)
      failure.sentence = "cannot send to " + target() + ": " + refusal_;
  }
  if (unwatched) watch_if_needed();
  if (status == NIF_OK) return {};
  uplink_.note_unsent(status, order.at_timeout);
  return failure;
}

Failure SendStream::nobody_there() const {
  std::string why = "nobody accepts it at the moment; it can be sent to again when it is back";
  if (destination_.id != 0) {
    why = service_ + " is away";
    const std::int64_t away_s = (steady_now_ns() - away_since_ns_) / 1'000'000'000;
    if (away_since_ns_ != 0) why += " since " + std::to_string(away_s) + " s";
  }
  return {Status::not_found, "not sent to " + service_ + ": " + why};
}

Outcome<SendStream::Turn> SendStream::take_turn(BytesView data, const Order& order) {
  // A message to be confirmed waits for room, whatever others of its stream do.
  const bool waits = order.confirmation != nullptr || options_.at_full == AtFullWindow::wait;
  while (!end_) {
    if (options_.end_at_loss && counts_.lost != 0) return loss();
    if (destination_.id == 0) return nobody_there();
    if (place_.away) {
      if (order.at_away == AtAway::refuse) return nobody_there();
      if (is_over(order.deadline_ns)) return Failure{Status::timeout, nobody_there().sentence};
      static_cast<void>(changed_.wait_until(mutex_, order.deadline_ns));
      continue;
    }
    const bool asks = synchronized() || order.confirmation != nullptr;
    const bool room = !asks || window_.has_room(data.size());
    if (!sending_ && room) {
      if (std::exchange(held_, std::nullopt)) ++counts_.skipped;
      sending_ = true;
      return Turn::send;
    }
    if (!room && !waits && options_.at_full == AtFullWindow::skip) {
      ++counts_.skipped;
      return Failure{Status::window_full, "not sent to " + target() + ": " +
                                              std::to_string(window_.size()) +
                                              " messages wait for their acknowledgement"};
    }
    if (!room && !waits) {
      hold(data);
      return Turn::held;
    }
    // Nobody acknowledges what was not written.
    if (std::exchange(unflushed_, false)) static_cast<void>(nif_flush(uplink_.node()));
    if (is_over(order.deadline_ns)) {
      uplink_.note_unsent(NIF_TIMEOUT, order.at_timeout);
      return Failure{Status::timeout,
                     "not sent to " + target() +
                         ": earlier messages were not acknowledged within the time given"};
    }
    static_cast<void>(changed_.wait_until(mutex_, order.deadline_ns));
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
  Envelope envelope{to.id, to.kind, NIF_POLICY_DEFAULT, options_.lane, to.key, options_.age_ms_max,
                    0};
  if (header.has(proto::gimi::kFlagAckWanted)) envelope.flags |= NIF_FLAG_REPORT;
  if (more == More::yes) envelope.flags |= NIF_FLAG_MORE;
  const bool stamped = options_.timestamp && header.operation == MessageOperation::data;
  return uplink_.transmit(envelope, header, stamped, data, timeout_ms);
}

nif_status SendStream::transmit_ping(const Destination& to, std::uint32_t number) const {
  std::array<std::byte, proto::gimi::kPingTimeSize> sent;
  store_le(sent.data(), wall_now_ns());
  return transmit(to, {number, MessageOperation::ping, proto::gimi::kFlagAckWanted, 0, to.epoch},
                  sent, More::no, 0);
}

/// True: somebody should watch over the stream. Another thread may have left a message to be held
/// while this one was sending: it goes by tick() only, also where this one was not sent, or is
/// acknowledged already.
bool SendStream::finish(const Departure& departure, nif_status status) {
  sending_ = false;
  changed_.notify_all();
  if (status != NIF_OK) {
    // It may have been given up with all others meanwhile; then it counts as never sent all the
    // same.
    if (departure.asks && !window_.cancel(departure.sequence) && counts_.lost != 0) --counts_.lost;
    if (window_.empty()) forget_doubts();
  } else {
    ++counts_.sent;
    unflushed_ = departure.more == More::yes;
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
  for (Confirmation* each : confirmations_) {
    if (!each->decided() && !window_.waits_for(each->sequence)) each->loss = why;
  }
  changed_.notify_all();
}

bool SendStream::on_ack(std::uint32_t sequence, const proto::gimi::Ack& ack) {
  const MutexLock lock(mutex_);
  const bool answers = ack.pong_sequence != 0 && ack.pong_sequence == window_.ping_number();
  const AckWindow::Freed freed =
      window_.acknowledge(sequence, ack.bitmap, ack.pong_sequence, steady_now_ns());
  for (Confirmation* each : confirmations_) {
    if (!each->decided())
      each->acknowledged = AckWindow::says_taken(sequence, ack.bitmap, each->sequence);
  }
  const Loss& doubt = asked_ ? asked_ : doubt_;
  settle_freed(freed,
               doubt ? doubt
                     : Loss{LossReason::not_received,
                            "the receiver answered a later question, but this did not arrive"});
  if (answers) asked_ = {};
  if (freed.lost != 0 || window_.empty()) forget_doubts();
  return held_ && window_.has_room(held_->size());
}

void SendStream::on_lost(std::uint32_t sequence, const Loss& why) {
  const MutexLock lock(mutex_);
  settle_freed(window_.lose(sequence), why);
  if (window_.empty()) forget_doubts();
}

void SendStream::on_refused(std::uint32_t sequence, const Loss& why) {
  on_lost(sequence, why);
  const MutexLock lock(mutex_);
  refused_sequence_ = sequence;
  refusal_ = why.words;
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
  if (place.away != place_.away) away_since_ns_ = place.away ? steady_now_ns() : 0;
  place_ = place;
  changed_.notify_all();
  if (same) return;
  lose_all(id == 0 ? withdrawn()
                   : Loss{LossReason::service_gone,
                          "the service is somewhere else now, and cannot tell any more"});
  // Another provider knows nothing of what the former one got.
  destination_.epoch = Uplink::draw_epoch();
  destination_.id = id;
  if (id != 0) destination_.key = place.key;
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
    if (held_ && window_.has_room(held_->size()) && !place_.away) {
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
        transmit(to, data_header(sequence, true, to.epoch), *data, More::no, 0);
    const MutexLock lock(mutex_);
    static_cast<void>(finish({.sequence = sequence, .asks = true}, status));
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
