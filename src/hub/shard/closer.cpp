#include "hub/shard/closer.hpp"

#include <utility>

#include "hub/shard/control_frame.hpp"
#include "proto/frame/frame_parser.hpp"

namespace gimnet::hub {

void Closer::close(Connection& connection, proto::GoodbyeCode code, std::string sentence) {
  if (!connection.connected) return;
  if (code == proto::GoodbyeCode::malformed) state_.counters.malformed.add(1);
  if (code == proto::GoodbyeCode::too_many_requests) state_.counters.too_many_requests.add(1);
  if (code == proto::GoodbyeCode::oddities) state_.counters.oddities.add(1);
  if (code == proto::GoodbyeCode::no_memory) state_.counters.no_memory.add(1);
  detach(connection, say_goodbye(connection, code, sentence));
  tell(connection, false, code, std::move(sentence));
}

void Closer::on_end(Connection& connection) {
  if (!connection.tail.empty()) state_.counters.unfinished_frames.add(1);
  on_broken(connection);
}

void Closer::on_broken(Connection& connection) {
  detach(connection, false);
  tell(connection, false, proto::GoodbyeCode::done, {});
}

void Closer::on_goodbye(Connection& connection, proto::GoodbyeCode code, std::string sentence) {
  // Before the socket is closed: a node that has seen that may have its name again at once.
  tell(connection, true, code, std::move(sentence));
  detach(connection, false);
}

void Closer::fence(Connection& connection) {
  if (!connection.connected) return;
  detach(connection,
         say_goodbye(
             connection, proto::GoodbyeCode::replaced,
             "a newer connection of this session took its place; do not come back by yourself"));
}

/// Returns whether it was written.
bool Closer::say_goodbye(Connection& connection, proto::GoodbyeCode code,
                         const std::string& sentence) {
  // In the middle of a frame a GOODBYE would be read as the rest of it.
  if (connection.writer.in_frame()) return false;
  const std::vector<std::byte> frame =
      control_frame(proto::Kind::link, connection.node, state_.shared.hub,
                    proto::encode(proto::Goodbye{code, sentence}));
  // Past the outbox: nothing follows a GOODBYE. A peer that takes nothing any more does not get it.
  const iovec piece{const_cast<std::byte*>(frame.data()), frame.size()};
  const net::IoResult sent = connection.transport->send({&piece, 1});
  return sent.status == net::IoStatus::ok && sent.bytes == frame.size();
}

void Closer::give_up_rest(Connection& connection) {
  const std::byte* next = connection.tail.buffer->data + connection.tail.begin;
  const std::byte* const end = next + connection.tail.size;
  // Its sender keeps what was not confirmed, or sees that the hub ends.
  const bool senders = connection.resume != nullptr || connection.gate.has(ReadGate::draining);
  while (next != end) {
    proto::NextRun found =
        proto::next_run(next, end, static_cast<std::uint32_t>(state_.limits.frame_bytes));
    if (found.found != proto::Found::run) return;
    proto::RunView& view = found.run;
    const Admission admission =
        state_.gate.admit(connection.ingress, const_cast<std::byte*>(next), view, state_.now_ms);
    if (admission == Admission::malformed || admission == Admission::wrong_source) return;
    if (admission == Admission::data && senders) state_.counters.untaken_frames.add(view.frames);
    if (admission == Admission::data && !senders) {
      state_.tally.accepted += view.frames;
      connection.outbox.counters()->accepted.add(view.frames);
      state_.drops.drop(view.bytes, view.frames, proto::DropReason::link_lost);
    }
    next += view.size;
  }
}

void Closer::detach(Connection& connection, bool said_goodbye) {
  if (connection.gate.has(ReadGate::rest)) give_up_rest(connection);
  std::unique_ptr<net::Stream> transport = std::move(connection.transport);
  if (transport->descriptor() >= 0) {
    state_.poller.remove(transport->descriptor());
    if (said_goodbye) state_.tell_conductor({state_.self, FarewellEvent{std::move(transport)}});
  }
  connection.connected = false;
  connection.write = WriteState::gone;
  connection.missed_resume = false;
  connection.must_confirm = false;
  connection.gate.clear(ReadGate::draining);
  connection.gate.clear(ReadGate::rest);
  connection.armed = Interest{};
  connection.requests = 0;
  connection.progress.reset();
  state_.receive_buffer.forget(connection.tail);
  if (connection.gate.has(ReadGate::no_room)) {
    connection.gate.clear(ReadGate::no_room);
    std::erase(state_.waiting_for_room, &connection);
  }
  state_.counters.connections.subtract(1);
  if (connection.is_link()) count_lost_reports(connection);
  connection.outbox.clear_control();
  if (!connection.waits_when_away) lose_all(connection);
}

/// Those that wait for a link are not sent over another one.
void Closer::count_lost_reports(Connection& connection) {
  RingQueue<Run>& runs = connection.outbox.control().runs();
  for (; !runs.empty(); runs.pop_front()) {
    for (Run rest = runs.front().share(); rest.frames != 0; rest.skip_frame())
      if (rest.header().kind == proto::Kind::report) state_.counters.reports_lost.add(1);
  }
}

void Closer::lose_all(Connection& connection) {
  lose_unconfirmed(connection, connection.writer.take_partial());
  connection.outbox.drop_all(proto::DropReason::link_lost, state_.egress);
  state_.pacer.on_away(connection);
  if (std::exchange(connection.gauged, false)) state_.sessions.set_queued(connection.slot, 0);
}

void Closer::tell(const Connection& connection, bool said_by_peer, proto::GoodbyeCode code,
                  std::string sentence) {
  static const ResumeState kNone{0};
  const bool resumes = connection.is_link() && connection.resume != nullptr;
  const ResumeState& resume = resumes ? *connection.resume : kNone;
  state_.tell_conductor(
      {state_.self, DetachedEvent{connection.session(), connection.attachment, connection.node,
                                  said_by_peer, code, std::move(sentence), resume.hub_epoch,
                                  resume.peer_epoch, resume.taken}});
}

void Closer::lose_unconfirmed(Connection& connection, const Run& partial) {
  std::uint64_t lost = 0;
  const auto lose = [&](const Run& run, proto::DropReason reason) {
    lost += run.frames;
    state_.drops.drop_mixed(run.bytes, run.size, reason);
  };
  if (connection.resume) {
    // The other end may have taken them: a program may have done what they ask for before it ended.
    constexpr auto kUnsure = proto::DropReason::link_unsure;
    const std::uint64_t let_go =
        connection.resume->kept.clear([&](const Run& run) { lose(run, kUnsure); });
    state_.tally.drop(kUnsure, let_go);
    lost += let_go;
  }
  const std::uint64_t may_have_arrived = lost;
  if (partial.frames != 0) lose(partial, proto::DropReason::link_lost);
  connection.outbox.count_dropped(lost, proto::DropReason::link_lost);
  connection.outbox.counters()->unsure.add(may_have_arrived);
  state_.tally.queued -= static_cast<std::int64_t>(lost);
}

void Closer::release(SessionRef session) {
  Connection* connection = state_.find(session);
  if (connection == nullptr) return;
  if (connection->connected) {
    detach(*connection,
           say_goodbye(*connection, proto::GoodbyeCode::kicked, "the session is over"));
  }
  lose_unconfirmed(*connection, connection->writer.take_partial());
  connection->outbox.drop_all(proto::DropReason::link_lost, state_.egress);
  if (connection->is_link()) {
    state_.tell_conductor(
        {state_.self,
         ReleasedEvent{session, state_.sessions.counts(session.slot, session.generation)}});
  }
  state_.pacer.forget(*connection);
  state_.retained.forget_provider(connection->node);
  state_.sessions.set_queued(connection->slot, 0);
  state_.recipients.remove(*connection);
  state_.router.forget_flows();
  state_.counters.sessions.subtract(1);
  state_.connections[session.slot.value()].reset();
}

}  // namespace gimnet::hub
