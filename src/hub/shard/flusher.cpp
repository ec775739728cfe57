#include "hub/shard/flusher.hpp"

#include <algorithm>
#include <utility>

#include "base/clock.hpp"
#include "hub/shard/flow_words.hpp"

namespace gimnet::hub {
namespace {

/// The least that may wait unsent in the kernel on a connection that does not take everything at
/// once. More is allowed at its measured rate (unsent_ms), up to unsent_bytes
/// (docs/architecture.md, "Freshness").
constexpr std::uint64_t kUnsentBytesMin = 4 * 1024;
constexpr std::uint64_t kRateWindowMs = 200;
/// Above this rate what waits in the kernel is gone in a moment, and bounding it costs a quarter of
/// the throughput.
constexpr std::uint64_t kFastBytesPerS = 10 << 20;

/// That left the send queue. WELCOME went past the flusher and may still be unsent.
std::uint64_t taken_bytes(const Connection& connection) {
  return connection.sent_bytes -
         std::min(connection.transport->unsent_bytes(), connection.sent_bytes);
}

}  // namespace

bool Flusher::flush_dirty() {
  std::vector<Recipient*>& dirty = state_.recipients.dirty();
  // Flushing may mark others (a sender that is told to go on): they come at the end of the same
  // list.
  std::size_t next = 0;
  const auto flush_rest = [&] {
    while (next < dirty.size()) {
      auto& connection = static_cast<Connection&>(*dirty[next++]);
      connection.dirty = false;
      flush(connection);
    }
  };
  flush_rest();
  if (!state_.confirms.empty()) {
    say_confirms();
    flush_rest();
  }
  dirty.clear();
  for (Connection* connection : again_) state_.recipients.mark_dirty(*connection);
  again_.clear();
  return !dirty.empty();
}

/// The frames that a CONFIRM counts were handed on before, as far as their recipients take them: if
/// the hub dies between the two, their sender still has them.
void Flusher::say_confirms() {
  for (const SessionRef session : state_.confirms) {
    Connection* const connection = state_.find(session);
    if (connection == nullptr || connection->resume == nullptr) continue;
    connection->resume->confirm_due = false;
    if (connection->connected && push_confirm(state_, *connection)) flush(*connection);
  }
  state_.confirms.clear();
}

void Flusher::flush(Connection& connection) {
  if (connection.write != WriteState::open) return let_wait(connection);
  if (connection.outbox.has_untold_losses()) tell_losses(connection);
  const std::uint64_t sent_before = state_.tally.sent_bytes;
  const std::uint64_t control_before = state_.tally.sent_control_bytes;
  const std::uint64_t delivered_before = state_.tally.delivered;
  const Flush result = connection.writer.flush(
      connection.outbox, connection.resume ? &connection.resume->kept : nullptr,
      *connection.transport, state_.egress);
  if (connection.transport->pending_out() != 0) state_.signals.arm(connection);
  const std::uint64_t sent = state_.tally.sent_bytes - sent_before;
  const bool sent_data = sent != state_.tally.sent_control_bytes - control_before;
  if (const bool must_confirm = result == Flush::waits; must_confirm != connection.must_confirm) {
    connection.must_confirm = must_confirm;
    state_.signals.arm(connection);
    if (must_confirm && connection.outbox.budget(state_.egress).scarce())
      ask_for_confirm(connection);
  } else if (must_confirm && sent_data && connection.outbox.budget(state_.egress).scarce()) {
    ask_for_confirm(connection);
  }
  connection.sent_bytes += sent;
  SessionCounters& counters = *connection.outbox.counters();
  counters.sent_bytes.store(connection.sent_bytes);
  counters.delivered.add(state_.tally.delivered - delivered_before);
  if (sent_data && connection.progress) connection.progress->data_end = connection.sent_bytes;
  if (sent != 0) connection.last_sent_ms = state_.now_ms;
  if (connection.link != nullptr && connection.paced) state_.pacer.on_written(connection);
  if (connection.events == EventState::missed && connection.outbox.control().empty())
    ask_to_be_told(connection);
  switch (result) {
    case Flush::emptied:
      return on_emptied(connection);
    case Flush::blocked:
      let_wait(connection);
      return on_blocked(connection);
    case Flush::waits:
      let_wait(connection);
      return watch(connection);
    case Flush::more:
      let_wait(connection);
      again_.push_back(&connection);
      return;
    case Flush::failed:
      return on_write_failed(connection);
  }
}

/// A small share is used up long before a quarter of the resume buffer is taken, and the peer would
/// confirm only with keep-alive.
void Flusher::ask_for_confirm(Connection& connection) {
  send_flow(state_, connection, proto::flow::Ping{++connection.ping_sequence, wall_now_ns()});
}

void Flusher::ask_to_be_told(Connection& connection) {
  connection.events = EventState::asked;
  state_.tell_conductor({state_.self, EventsMissedEvent{connection.session(), connection.attachment,
                                                        connection.node}});
}

/// Frames that were not written stay: for a transport that takes no more, for a confirmation, or
/// for the node to come back.
void Flusher::let_wait(Connection& connection) {
  connection.outbox.settle(state_.egress);
  connection.outbox.signal_room(state_.egress);
  state_.sessions.set_queued(connection.slot, connection.outbox.waiting_bytes());
  connection.gauged = true;
}

void Flusher::on_emptied(Connection& connection) {
  connection.outbox.on_emptied(state_.egress);
  connection.outbox.signal_room(state_.egress);
  if (std::exchange(connection.gauged, false)) {
    state_.sessions.set_queued(connection.slot, 0);
    if (connection.progress) connection.progress->emptied = true;
  }
  if (connection.gate.has(ReadGate::draining) && state_.nothing_follows &&
      !connection.confirm_due() && connection.transport->pending_out() == 0) {
    closer_.close(connection, proto::GoodbyeCode::draining, "the hub is shutting down");
  }
}

void Flusher::on_blocked(Connection& connection) {
  connection.write = WriteState::blocked;
  state_.signals.arm(connection);
  watch(connection);
}

/// Frames that the kernel has taken for the hub would go with the descriptor: its own, if it sent
/// them, said GOODBYE and left, and those of a sender that is not read because of BLOCK, which
/// promises that nothing is lost.
void Flusher::on_write_failed(Connection& connection) {
  if (connection.gate.has(ReadGate::draining))
    return closer_.on_broken(connection);  // it is read no more
  let_wait(connection);
  connection.write = WriteState::failed;
  connection.on_read_again(state_.now_ms);
  state_.signals.arm(connection);
  watch(connection);
}

void Flusher::watch(Connection& connection) {
  if (connection.progress) return;
  if (spare_.empty()) {
    connection.progress = std::make_unique<Progress>();
  } else {
    connection.progress = std::move(spare_.back());
    spare_.pop_back();
    *connection.progress = Progress{};
  }
  Progress& progress = *connection.progress;
  progress.since_ms = progress.block_since_ms = progress.rate_since_ms = state_.now_ms;
  progress.taken_bytes = progress.block_taken_bytes = progress.rate_bytes = taken_bytes(connection);
  progress.data_end = connection.sent_bytes;
}

void Flusher::end_watch(Connection& connection) {
  if (spare_.size() < kSpareMax) spare_.push_back(std::move(connection.progress));
  connection.progress.reset();
}

/// Control frames go first, so the node hears of a gap before the data behind it.
void Flusher::tell_losses(Connection& connection) {
  connection.outbox.tell_losses(
      [&](const proto::flow::Dropped& losses) { return push_flow(state_, connection, losses); });
}

void Flusher::on_writable(Connection& connection) {
  if (connection.transport->pending_out() != 0) {
    const net::IoStatus status = connection.transport->send({}).status;
    if (status == net::IoStatus::failed) return on_write_failed(connection);
    if (status == net::IoStatus::would_block) return;
  }
  connection.write = WriteState::open;
  state_.signals.arm(connection);
  state_.recipients.mark_dirty(connection);
}

void Flusher::look_after(Connection& connection) {
  if (!connection.connected || !connection.progress) return;
  // Nobody is slow whom nothing reaches any more: what waits for it waits as it will while it is
  // away.
  if (connection.write == WriteState::failed && connection.waits_when_away) return;
  Progress& progress = *connection.progress;
  // An empty queue does not say that it has caught up if messages were dropped because it took
  // nothing.
  const bool caught_up = taken_bytes(connection) >= progress.owed_bytes;
  if (connection.outbox.empty() && !connection.writer.in_frame() && caught_up) {
    end_watch(connection);
    return;
  }
  // On some transports the kernel counts its own bookkeeping as unsent, so the difference may
  // shrink: never take less than before.
  const std::uint64_t taken = std::max(taken_bytes(connection), progress.rate_bytes);
  adapt_to_rate(connection, taken);
  // The hub's own words (PING, PONG, CONFIRM) may pass while data does not.
  const std::uint64_t data_taken = std::min(taken, progress.data_end);
  if (data_taken != progress.block_taken_bytes || !connection.outbox.has_block()) {
    progress.block_taken_bytes = data_taken;
    progress.block_since_ms = state_.now_ms;
  } else if (state_.now_ms - progress.block_since_ms >= state_.limits.block_ms) {
    connection.outbox.time_out_block(state_.egress);
    progress.block_since_ms = state_.now_ms;
    progress.owed_bytes = connection.sent_bytes;
  }
  // A frame of which the transport took a part waits, too: it may be all that a reader who takes
  // nothing was sent.
  const bool nothing_waits = connection.outbox.stale_bytes() == 0 &&
                             !connection.writer.in_stale_frame() && taken >= progress.owed_bytes;
  if (taken - progress.taken_bytes >= state_.limits.slow_consumer_bytes || nothing_waits) {
    progress.taken_bytes = taken;
    progress.since_ms = state_.now_ms;
  } else if (connection.write != WriteState::failed && !connection.is_link() &&
             state_.now_ms - progress.since_ms >= state_.limits.slow_consumer_ms) {
    state_.counters.slow_consumers.add(1);
    closer_.close(connection, proto::GoodbyeCode::slow_consumer,
                  "took less than " + std::to_string(state_.limits.slow_consumer_bytes) +
                      " bytes in " + std::to_string(state_.limits.slow_consumer_ms) +
                      " ms while messages waited; read faster, or subscribe with delivery latest");
  }
}

void Flusher::adapt_to_rate(Connection& connection, std::uint64_t taken) {
  Progress& progress = *connection.progress;
  const std::uint64_t passed_ms = state_.now_ms - progress.rate_since_ms;
  if (passed_ms < kRateWindowMs) return;
  const std::uint64_t rate = (taken - progress.rate_bytes) * 1'000 / passed_ms;
  progress.rate_bytes = taken;
  progress.rate_since_ms = state_.now_ms;
  const bool emptied = std::exchange(progress.emptied, false);
  if (connection.is_link())
    connection.outbox.on_link_took(rate * Outbox::kLinkLaneMs / 1'000, emptied);
  const std::uint64_t wanted = std::clamp(rate * state_.limits.unsent_ms / 1'000, kUnsentBytesMin,
                                          state_.limits.unsent_bytes);
  const auto limit = rate > kFastBytesPerS ? 0u : static_cast<std::uint32_t>(wanted);
  // A change that matters; each is a system call.
  if (limit > connection.unsent_limit / 4 * 5 || limit < connection.unsent_limit / 4 * 3) {
    connection.unsent_limit = limit;
    connection.transport->limit_unsent(limit);
  }
}

}  // namespace gimnet::hub
