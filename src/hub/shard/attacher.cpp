#include "hub/shard/attacher.hpp"

#include <algorithm>
#include <utility>

#include "base/random.hpp"
#include "hub/shard/control_frame.hpp"
#include "hub/shard/flow_words.hpp"
#include "hub/shard/flusher.hpp"

namespace gimnet::hub {
namespace {

std::uint64_t random_epoch() {
  std::uint64_t epoch = 0;
  // Epochs only have to differ from earlier ones; 0 means none.
  while (epoch == 0) epoch = random_bits();
  return epoch;
}

}  // namespace

void Attacher::attach(AttachCommand command) {
  Connection& connection = session_of(command);
  closer_.fence(connection);
  connection.transport = std::move(command.transport);
  connection.unsent_limit = static_cast<std::uint32_t>(
      std::min<std::uint64_t>(kFirstUnsentBytes, state_.limits.unsent_bytes));
  connection.transport->limit_unsent(connection.unsent_limit);
  connection.attachment = command.attachment;
  connection.connected = true;
  connection.write = WriteState::open;
  connection.events = EventState::told;
  connection.frame_bytes = command.peer_frame_bytes;
  state_.router.forget_flows();
  connection.last_heard_ms = connection.last_sent_ms = state_.now_ms;
  connection.tail_since_ms = 0;
  connection.ingress = IngressState{};
  connection.read_again = Backoff{};
  connection.goes_on = false;
  connection.ingress.node = connection.node;
  if (command.link) {
    connection.link = std::make_unique<LinkPeer>(LinkPeer{
        std::move(command.link->rule), command.link->silent_ms, command.link->clock_ahead_ns});
    connection.ingress.link = &connection.link->rule;
  }
  connection.posted_shards = kAllShards;
  state_.counters.connections.add(1);
  const std::uint64_t gap = settle_counts(connection, command);
  if (connection.holds != 0) state_.signals.watch_unread(connection);
  connection.armed =
      interest_of(connection.gate, connection.write, false, connection.transport->pending_out());
  const int descriptor = connection.transport->descriptor();
  if (descriptor >= 0 && !state_.poller.add(descriptor, connection.token(), connection.armed)) {
    // GOODBYE stands behind the opening, as WELCOME would.
    const iovec opening{const_cast<std::byte*>(proto::kOpening.data()), proto::kOpening.size()};
    static_cast<void>(connection.transport->send({&opening, 1}));
    closer_.close(connection, proto::GoodbyeCode::no_memory,
                  "the hub cannot wait for another connection; try later");
    return;
  }
  if (command.link && command.link->dialled) {
    if (gap != 0)
      send_flow(state_, connection, proto::flow::Skip{proto::DropReason::link_lost, gap});
    return state_.recipients.mark_dirty(connection);
  }
  welcome(connection, command.welcome, gap);
  if (connection.connected) tell_again(connection, command);
}

void Attacher::tell_again(Connection& connection, const AttachCommand& command) {
  if (!command.told.empty()) connection.outbox.push_first_control(command.told, state_.egress);
}

void Attacher::renumber(Connection& connection, NodeId node) {
  closer_.lose_all(connection);
  // The node begins anew: no connection of before it knew its id is gone on with.
  if (connection.resume) connection.resume->hub_epoch = random_epoch();
  state_.retained.renumber_provider(connection.node, node);
  connection.node = node;
  // Outboxes release whom they held by the id that they knew, which leads to nobody now. They hold
  // the new one anew.
  connection.holds = 0;
  connection.gate.clear(ReadGate::held);
  state_.signals.arm(connection);
}

Connection& Attacher::session_of(const AttachCommand& command) {
  if (Connection* known = state_.find(command.session)) return *known;
  const std::size_t slot = command.session.slot.value();
  if (slot >= state_.connections.size()) state_.connections.resize(slot + 1);
  GIMNET_CHECK(state_.connections[slot] ==
               nullptr);  // released before the conductor gives the slot to another session
  auto connection = std::make_unique<Connection>();
  connection->node = command.node;
  connection->slot = command.session.slot;
  connection->generation = command.session.generation;
  if (connection->is_link()) connection->outbox.set_link();
  connection->outbox.set_counters(state_.sessions.begin(connection->slot, connection->generation));
  state_.recipients.put(*connection);
  state_.counters.sessions.add(1);
  state_.connections[slot] = std::move(connection);
  return *state_.connections[slot];
}

std::uint64_t Attacher::settle_counts(Connection& connection, AttachCommand& command) {
  Run partial = connection.writer.take_partial();
  bool same_life = command.resume_wanted && connection.resume != nullptr &&
                   command.peer_epoch == connection.resume->peer_epoch;
  if (command.link && command.link->dialled) {
    same_life = same_life && command.link->resumed;
  } else {
    same_life = same_life && command.known_hub_epoch == connection.resume->hub_epoch;
  }
  std::uint64_t gap = 0;
  command.welcome.resumed = same_life && go_on(connection, command, partial, gap);
  if (!command.welcome.resumed) begin_anew(connection, command, partial);
  connection.waits_when_away = connection.resume != nullptr;
  if (connection.resume) {
    command.welcome.epoch = connection.resume->hub_epoch;
    command.welcome.taken = connection.resume->taken;
    command.welcome.resume_buffer_bytes = static_cast<std::uint32_t>(resume_bytes(connection));
  }
  return gap;
}

bool Attacher::go_on(Connection& connection, const AttachCommand& command, Run& partial,
                     std::uint64_t& gap) {
  RunQueue replay;
  const ResumeBuffer::Rewind rewind = connection.resume->kept.rewind(command.known_taken, replay);
  // A count that cannot be: this peer's life is not the one that we know.
  if (!rewind.possible) return false;
  state_.counters.resumed.add(1);
  state_.counters.gap_frames.add_within(rewind.lost, kGapFramesMost);
  state_.tally.delivered += rewind.confirmed;
  connection.outbox.counters()->delivered.add(rewind.confirmed);
  connection.outbox.count_dropped(rewind.lost, proto::DropReason::link_lost);
  state_.tally.drop(proto::DropReason::link_lost, rewind.lost);
  state_.tally.queued -= static_cast<std::int64_t>(rewind.confirmed + rewind.lost);
  if (partial.frames != 0) replay.push(std::move(partial));
  RingQueue<Run>& waiting = connection.outbox.replay().runs();
  for (; !waiting.empty(); waiting.pop_front()) replay.push(std::move(waiting.front()));
  connection.outbox.replay() = std::move(replay);
  connection.resume->taken_told = connection.resume->taken;
  connection.resume->bytes_since_told = 0;
  connection.resume->peer_resume_bytes = command.peer_resume_bytes;
  gap = rewind.gap;
  return true;
}

void Attacher::begin_anew(Connection& connection, const AttachCommand& command,
                          const Run& partial) {
  // One that an administrator gave another id begins anew, too.
  const bool same_program = command.resume_wanted && connection.resume != nullptr &&
                            command.peer_epoch == connection.resume->peer_epoch;
  closer_.lose_unconfirmed(connection, partial);
  connection.outbox.drop_replay(proto::DropReason::link_lost, state_.egress);
  // A command for the program before would be carried out late, by a program that never heard of
  // it. What waits for a link is for the nodes behind it.
  if (!same_program && !connection.is_link()) connection.outbox.drop_addressed(state_.egress);
  connection.outbox.set_resume(nullptr);
  connection.resume.reset();
  count_anew(connection);
  if (command.link && command.link->counts_anew) {
    connection.sent_bytes = 0;
    connection.outbox.counters()->clear();
  }
  if (!command.resume_wanted) return;
  connection.resume = std::make_unique<ResumeState>(resume_bytes(connection));
  connection.outbox.set_resume(&connection.resume->kept);
  const bool dialled = command.link && command.link->dialled;
  connection.resume->hub_epoch = dialled ? command.link->epoch : random_epoch();
  connection.resume->peer_epoch = command.peer_epoch;
  connection.resume->peer_resume_bytes = command.peer_resume_bytes;
}

std::uint64_t Attacher::resume_bytes(const Connection& connection) const {
  return connection.is_link() ? kLinkResumeBytes : state_.limits.resume_bytes;
}

/// Messages on their way to the subscriber are lost, and both ends count from 0.
void Attacher::count_anew(Connection& connection) {
  if (!connection.paced) return;
  state_.pacer.on_new_epoch(connection);
  connection.paced->for_each([&](PacedSubscription& each) {
    const bool has_newer =
        each.held() != 0 || connection.outbox.waiting_messages(each.group()) != 0;
    if (each.retained && !has_newer) state_.retained.ask_start(each);
  });
}

void Attacher::welcome(Connection& connection, const proto::Welcome& welcome, std::uint64_t gap) {
  std::vector<std::byte> bytes(proto::kOpening.begin(), proto::kOpening.end());
  const std::vector<std::byte> frame =
      control_frame(proto::Kind::link, connection.node, state_.shared.hub, proto::encode(welcome));
  bytes.insert(bytes.end(), frame.begin(), frame.end());
  // The opening is no frame: it goes past the outbox. A fresh connection takes this much at once,
  // or it is of no use.
  const iovec piece{bytes.data(), bytes.size()};
  const net::IoResult sent = connection.transport->send({&piece, 1});
  if (sent.status != net::IoStatus::ok || sent.bytes != bytes.size())
    return closer_.on_broken(connection);
  if (gap != 0) {
    send_flow(state_, connection, proto::flow::Skip{proto::DropReason::link_lost, gap});
  }
  state_.recipients.mark_dirty(connection);
  state_.signals.arm(connection);
  // The stream may have read on behind HELLO, which no poller shows.
  state_.go_on_later(connection);
}

}  // namespace gimnet::hub
