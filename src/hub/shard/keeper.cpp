#include "hub/shard/keeper.hpp"

#include <algorithm>

#include <bit>

#include "base/clock.hpp"
#include "hub/shard/allocator.hpp"
#include "hub/shard/flow_words.hpp"

namespace gimnet::hub {

void Keeper::tick() {
  // The queues of connections that keep up come and go. The allocator keeps the pages that they
  // leave for seconds, which came to a third of the budget (stress.mixture_test).
  if (state_.now_ms >= return_pages_at_ms_ && state_.is_scarce()) {
    return_pages_at_ms_ = state_.now_ms + kReturnPagesMs;
    return_freed_pages();
  }
  if (state_.now_ms < next_tick_at_ms_) return;
  const std::uint64_t late_ms = state_.now_ms - next_tick_at_ms_;
  next_tick_at_ms_ = state_.now_ms + kTickMs;
  state_.pool.take_back_lent();
  state_.link_budget.begin_turn(state_.now_ms);  // also once the last link has gone
  if (state_.is_scarce()) state_.pool.free_kept();
  const bool says_again = state_.now_ms >= say_again_at_ms_;
  if (says_again) say_again_at_ms_ = state_.now_ms + kSayAgainMs;
  for (const std::unique_ptr<Connection>& connection : state_.connections) {
    if (connection == nullptr) continue;
    // Those who were paused for a share may go on once memory is not scarce; of an absent
    // connection nothing else tells them.
    connection->outbox.signal_room(state_.egress);
    if (says_again) connection->outbox.say_pauses_again(state_.egress);
    if (!connection->connected) continue;
    if (late_ms > kTickMs) forgive(*connection, late_ms);
    look_at(*connection);
  }
}

void Keeper::forgive(Connection& connection, std::uint64_t late_ms) const {
  // Nothing began later than now, so what began after the tick was due has all its time, and no
  // more.
  const auto move = [&](std::uint64_t& since_ms) {
    since_ms = std::min(since_ms + late_ms, state_.now_ms);
  };
  if (connection.tail_since_ms != 0) move(connection.tail_since_ms);
  if (!connection.progress) return;
  move(connection.progress->since_ms);
  move(connection.progress->block_since_ms);
}

bool Keeper::is_silent(Connection& connection) {
  const auto over = [&] {
    return state_.now_ms - connection.last_heard_ms >= silent_ms(connection);
  };
  if (!over()) return false;
  // Its words may lie unread: the hub stood still, epoll_wait was interrupted, or more connections
  // were ready than it tells at a time.
  reader_.read(connection);
  return connection.connected && !connection.gate.has(ReadGate::no_room) && over();
}

std::uint64_t Keeper::next_tick_at_ms() const {
  if (state_.counters.connections.value() == 0 && (!draining_ || drained_told_))
    return Poller::kNever;
  return next_tick_at_ms_;
}

bool Keeper::is_written(const Connection& connection) {
  return connection.outbox.empty() && !connection.writer.in_frame() && !connection.confirm_due() &&
         connection.transport->pending_out() == 0;
}

void Keeper::look_at(Connection& connection) {
  const Limits& limits = state_.limits;
  if (draining_ &&
      (state_.now_ms >= drain_deadline_ms_ || (state_.nothing_follows && is_written(connection)))) {
    return closer_.close(connection, proto::GoodbyeCode::draining,
                         "the hub ends, or begins anew under another hub id; dial again");
  }
  if (connection.missed_resume) {
    return closer_.close(connection, proto::GoodbyeCode::too_many_requests,
                         "the hub's words wait and are not taken, RESUME among them; read what the "
                         "hub says, come back");
  }
  if (connection.is_link() && connection.write == WriteState::failed)
    return closer_.on_broken(connection);
  // Frames that a peer sent before it was gone wait for whoever holds it, but no longer than its
  // session waits for the peer. A peer that is held by its own outbox would wait for ever.
  if (connection.write == WriteState::failed &&
      state_.now_ms - connection.last_heard_ms >= std::max(limits.grace_ms, limits.silent_ms)) {
    return closer_.on_broken(connection);
  }
  const bool heard = connection.gate.is_open();
  if (heard && is_silent(connection)) {
    if (connection.write == WriteState::failed) return closer_.on_broken(connection);
    state_.counters.silent.add(1);
    return closer_.close(connection, proto::GoodbyeCode::silent,
                         "nothing was heard for " + std::to_string(silent_ms(connection)) + " ms");
  }
  if (!connection.connected) return;
  if (connection.is_link()) return look_at_link(connection);
  if (heard && connection.tail_since_ms != 0 &&
      state_.now_ms - connection.tail_since_ms >= limits.stalled_frame_ms) {
    state_.counters.stalled_frames.add(1);
    return closer_.close(connection, proto::GoodbyeCode::stalled_frame,
                         "a frame was begun and not finished for " +
                             std::to_string(limits.stalled_frame_ms) + " ms");
  }
  if (state_.now_ms - connection.last_sent_ms >= limits.keep_alive_ms) {
    // Sent or not, not again before another interval: a peer that does not read gets no heap of
    // them.
    connection.last_sent_ms = state_.now_ms;
    connection.outbox.trim();
    if (connection.resume) connection.resume->kept.trim();
    if (connection.write == WriteState::open) say_ping(connection);
    if (!connection.connected) return;
    if (connection.resume) send_confirm(state_, connection);
  }
  if (heard) ask_if_silent(connection);
  flusher_.look_after(connection);
}

void Keeper::ask_if_silent(Connection& connection) {
  const bool asked = connection.last_ping_ms > connection.last_heard_ms;
  if (asked || connection.write == WriteState::failed) return;
  if (state_.now_ms - connection.last_heard_ms >= silent_ms(connection) / 2) say_ping(connection);
}

std::uint64_t Keeper::silent_ms(const Connection& connection) const {
  return connection.link ? connection.link->silent_ms : state_.limits.silent_ms;
}

/// The conductor says the keep-alives of links, and no limit for slow or stalled nodes holds.
void Keeper::look_at_link(Connection& connection) {
  if (connection.resume) send_confirm(state_, connection);
  flusher_.look_after(connection);
  if (connection.link->ending) end_if_quiet(connection);
}

void Keeper::end_if_quiet(Connection& connection) {
  bool waits = !is_written(connection);
  LinkEnding::Carried carried;
  if (const ResumeState* resume = connection.resume.get()) {
    waits = waits || resume->kept.unconfirmed() != 0 || resume->taken != resume->taken_told;
    carried = {resume->kept.written(), resume->taken};
  }
  LinkEnding& ending = *connection.link->ending;
  if (!ending.is_due(waits, carried, state_.now_ms)) return;
  const CloseCommand close = ending.close();
  closer_.close(connection, close.code, close.sentence);
}

/// Written at once: ten thousand who are told at one tick would each take a piece of memory until
/// its end, and the shard would keep all of it.
void Keeper::say_ping(Connection& connection) {
  const proto::flow::Ping ping{++connection.ping_sequence, wall_now_ns()};
  if (!push_flow(state_, connection, ping)) return;
  connection.last_ping_ms = state_.now_ms;
  flusher_.flush(connection);
}

void Keeper::drain(std::uint64_t deadline_ms) {
  draining_ = true;
  drain_deadline_ms_ = state_.now_ms + deadline_ms;
  next_tick_at_ms_ = state_.now_ms;
  for (const std::unique_ptr<Connection>& connection : state_.connections) {
    if (connection == nullptr || !connection->connected) continue;
    if (connection->write == WriteState::failed) {
      closer_.on_broken(*connection);
      continue;
    }
    connection->gate.shut(ReadGate::draining);
    state_.signals.arm(*connection);
  }
  state_.fanout.post_last();
  state_.done_shards |= std::uint64_t{1} << state_.self.value();
}

void Keeper::look_for_others() {
  if (!draining_ || state_.nothing_follows) return;
  const std::size_t shards = state_.fanout.shards();
  if (static_cast<std::size_t>(std::popcount(state_.done_shards)) != shards) return;
  state_.nothing_follows = true;
  for (const std::unique_ptr<Connection>& connection : state_.connections) {
    if (connection != nullptr && connection->connected) state_.recipients.mark_dirty(*connection);
  }
}

bool Keeper::take_drained() {
  const bool over = state_.nothing_follows || state_.now_ms >= drain_deadline_ms_;
  if (!draining_ || drained_told_ || !over || state_.counters.connections.value() != 0)
    return false;
  drained_told_ = true;
  return true;
}

}  // namespace gimnet::hub
