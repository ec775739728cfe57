#include "hub/shard/connection_reader.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include "hub/shard/flow_words.hpp"
#include "proto/frame/extensions.hpp"
#include "proto/frame/frame_parser.hpp"

namespace gimnet::hub {

std::size_t receive_more(Connection& connection, std::span<std::byte> room, Tally& tally) {
  std::size_t bytes = 0;
  for (int reads = 0; reads < kReadsMore && bytes < std::min(kSmallReadBytes, room.size());
       ++reads) {
    const net::IoResult more = connection.transport->receive(room.subspan(bytes));
    ++tally.receive_calls;
    if (more.status != net::IoStatus::ok) break;
    bytes += more.bytes;
  }
  if (bytes != 0) {
    connection.read_again.succeeded();
  } else {
    connection.read_again.failed();
  }
  return bytes;
}

namespace {

/// A newcomer's destinations show only when it is read: so much of it is read, even if some shard
/// has too much to do.
constexpr std::uint64_t kFirstReadBytes = 4 * 1024;

template <class Word>
Word word_of(const Mail& mail) {
  Word word;
  std::memcpy(&word, mail.small, sizeof word);
  return word;
}

}  // namespace

std::uint64_t ConnectionReader::share() const {
  const std::size_t rests = state_.receive_buffer.rests();
  const std::uint64_t all = state_.limits.turn_deliveries;
  return rests == 0 ? all : std::max<std::uint64_t>(1, all / (1 + rests));
}

/// In read(), which is once a turn for each connection.
[[gnu::always_inline]] inline void ConnectionReader::route_all(Connection& connection,
                                                               ReceiveBuffer::Received received) {
  const std::uint64_t accepted_before = state_.tally.accepted;
  deliveries_end_ = state_.router.deliveries() + share();
  const bool open = process(connection, received);
  connection.outbox.counters()->accepted.add(state_.tally.accepted - accepted_before);
  state_.fanout.post_all();
  const std::uint64_t posted = state_.fanout.take_posted();
  if (!open) return;
  connection.posted_shards = posted;
  if ((posted & state_.fanout.crowded()) != 0) return wait_for_room(connection);
}

void ConnectionReader::read_some(Connection& connection) {
  state_.egress.owner.check_here();
  if (connection.gate.has(ReadGate::rest)) return;
  std::uint64_t most =
      state_.receive_buffer.many_rests() ? kFirstReadBytes : state_.limits.turn_bytes;
  if ((connection.posted_shards & state_.fanout.crowded()) != 0) {
    if (connection.posted_shards != kAllShards) return wait_for_room(connection);
    most = kFirstReadBytes;
  }
  const std::span<std::byte> room = state_.receive_buffer.prepare(connection.tail);
  const std::span<std::byte> share = room.first(std::min<std::size_t>(room.size(), most));
  const net::IoResult result = receive_repeatedly(connection, share, state_.tally);
  if (result.status == net::IoStatus::would_block) return;
  if (result.status != net::IoStatus::ok) return closer_.on_end(connection);
  state_.tally.received_bytes += result.bytes;
  connection.outbox.counters()->received_bytes.add(result.bytes);
  // A peer that takes nothing may go on sending for ever: that does not count as a sign of life.
  if (connection.write != WriteState::failed) connection.last_heard_ms = state_.now_ms;
  route_all(connection, state_.receive_buffer.commit(connection.tail, result.bytes));
}

void ConnectionReader::go_on(Connection& connection) {
  if ((connection.posted_shards & state_.fanout.crowded()) != 0) {
    state_.go_on_later(connection);
    return wait_for_room(connection);
  }
  // It may have said more, which is not read before this is done.
  if (connection.write != WriteState::failed) connection.last_heard_ms = state_.now_ms;
  connection.gate.clear(ReadGate::rest);
  route_all(connection, state_.receive_buffer.go_on(connection.tail));
  look_at_stream(connection);
}

void ConnectionReader::wait_for_room(Connection& connection) {
  if (connection.gate.has(ReadGate::no_room)) return;
  connection.gate.shut(ReadGate::no_room);
  state_.waiting_for_room.push_back(&connection);
  state_.signals.arm(connection);
}

bool ConnectionReader::process(Connection& connection, ReceiveBuffer::Received received) {
  if (connection.link != nullptr) [[unlikely]]
    return process_link(connection, received);
  const auto length_max = static_cast<std::uint32_t>(state_.limits.frame_bytes);
  const std::byte* next = received.begin;
  state_.router.begin_bytes(connection.node);
  while (next != received.end) {
    const proto::RunView repeats = state_.router.append_repeats(next, received.end);
    if (repeats.frames != 0) {
      count_accepted(state_, connection, repeats);
      next += repeats.size;
      if (next == received.end) break;
    }
    proto::NextRun found = proto::next_run(next, received.end, length_max);
    if (found.found == proto::Found::run) {
      if (state_.router.deliveries() >= deliveries_end_) {
        keep_rest(connection, {next, received.end});
        break;
      }
      if (!handle_run(connection, found)) return false;
      next += found.run.size;
      continue;
    }
    return take_begun(connection, {next, received.end}, next == received.begin, found);
  }
  connection.tail_since_ms = 0;
  return true;
}

bool ConnectionReader::process_link(Connection& connection, ReceiveBuffer::Received received) {
  state_.router.set_neighbour(hub_of(connection.node));
  const bool open = process_runs(connection, received);
  state_.router.set_neighbour(kOwnHub);
  return open;
}

bool ConnectionReader::process_runs(Connection& connection, ReceiveBuffer::Received received) {
  const auto length_max = static_cast<std::uint32_t>(state_.limits.frame_bytes);
  const std::byte* next = received.begin;
  state_.router.begin_bytes(connection.node);
  while (next != received.end) {
    proto::NextRun found = proto::next_run(next, received.end, length_max);
    if (found.found != proto::Found::run)
      return take_begun(connection, {next, received.end}, next == received.begin, found);
    if (state_.router.deliveries() >= deliveries_end_) {
      keep_rest(connection, {next, received.end});
      break;
    }
    if (!handle_run(connection, found)) return false;
    next += found.run.size;
  }
  connection.tail_since_ms = 0;
  return true;
}

/// Bytes behind the last whole frame.
[[gnu::noinline]] bool ConnectionReader::take_begun(Connection& connection,
                                                    std::span<const std::byte> begun,
                                                    bool nothing_before,
                                                    const proto::NextRun& found) {
  if (found.found == proto::Found::too_long) {
    connection.ingress.error = proto::FrameError::too_long;
    return hub_frames_.refuse(connection, proto::DropReason::malformed,
                              proto::GoodbyeCode::malformed,
                              "the frame's length is over the largest frame, " +
                                  std::to_string(state_.limits.frame_bytes) + " bytes");
  }
  if (connection.tail_since_ms == 0 || !nothing_before) connection.tail_since_ms = state_.now_ms;
  if (keep(connection, begun, found.needed)) return true;
  closer_.close(connection, proto::GoodbyeCode::no_memory,
                "the hub keeps too many begun frames; write frames whole, or in smaller pieces");
  return false;
}

void ConnectionReader::keep_rest(Connection& connection, std::span<const std::byte> rest) {
  state_.receive_buffer.keep_rest(connection.tail, rest.data(), rest.data() + rest.size());
  connection.gate.shut(ReadGate::rest);
  state_.go_on_later(connection);
}

/// Closed itself, a newcomer would pay for those who begin frames and never end them.
bool ConnectionReader::keep(Connection& connection, std::span<const std::byte> begun,
                            std::uint32_t needed) {
  const std::byte* const end = begun.data() + begun.size();
  while (!state_.receive_buffer.keep(connection.tail, begun.data(), end, needed)) {
    Connection* const oldest = begun_before(connection);
    if (oldest == nullptr) return false;
    closer_.close(*oldest, proto::GoodbyeCode::no_memory,
                  "the hub keeps too many begun frames, and this one was begun longest ago; write "
                  "frames whole, or in "
                  "smaller pieces");
  }
  return true;
}

Connection* ConnectionReader::begun_before(const Connection& connection) const {
  Connection* oldest = nullptr;
  std::uint64_t since_ms = connection.tail_since_ms;
  for (const std::unique_ptr<Connection>& each : state_.connections) {
    if (each == nullptr || each->tail.empty() || each->tail_since_ms >= since_ms) continue;
    // A connection that is not read cannot end its frame.
    if (each->gate.has(ReadGate::held | ReadGate::no_room | ReadGate::rest)) continue;
    since_ms = each->tail_since_ms;
    oldest = each.get();
  }
  return oldest;
}

bool ConnectionReader::handle_run(Connection& connection, proto::NextRun& found) {
  proto::RunView& view = found.run;
  auto* bytes = const_cast<std::byte*>(view.bytes);  // ours until it is handed on
  const Admission admission = state_.gate.admit(connection.ingress, bytes, view, state_.now_ms);
  if (admission == Admission::data) {
    if (connection.gate.has(ReadGate::draining)) {
      // Read for the CONFIRM behind it. All shards were told that nothing follows, and may have
      // closed whom it is for: it stays its sender's, like what is not read any more.
      state_.counters.untaken_frames.add(view.frames);
    } else {
      route(connection, found);
    }
    return true;
  }
  if (connection.is_link()) return link_reader_.take(connection, view, admission);
  return hub_frames_.take(connection, view, admission);
}

void ConnectionReader::route(Connection& connection, const proto::NextRun& found) {
  const proto::RunView& view = found.run;
  count_accepted(state_, connection, view);
  if (proto::load_header(view.bytes).has(proto::kFlagExt)) stamp_arrival(connection, view);
  state_.router.route(state_.receive_buffer.buffer(), view);
}

/// TRACE gets the time of arrival. The origin of an AGE is in the time of the hub that the frame
/// comes from; it is moved to this hub's.
void ConnectionReader::stamp_arrival(const Connection& connection, const proto::RunView& view) {
  const LinkPeer* link = connection.link.get();
  const proto::Origin origin = link != nullptr ? proto::Origin::hub : proto::Origin::node;
  const auto frame = proto::parse_frame({view.bytes, view.size}, origin);
  if (!frame) return;
  const std::span<std::byte> extensions(const_cast<std::byte*>(frame->extensions.data()),
                                        frame->extensions.size());
  // Departure is set again when the frame is written; a frame that never waits leaves in the turn
  // in which it came. Both are the time of their turn: read anew, an arrival could be later than a
  // departure.
  const std::int64_t now_ns = state_.egress.now_wall_ns;
  proto::adopt_origin(extensions, link != nullptr ? link->clock_ahead_ns : 0, now_ns);
  static_cast<void>(proto::fill_trace(extensions, {state_.shared.hub, now_ns, now_ns}));
}

void ConnectionReader::begin_mail() {
  deliveries_end_ = state_.router.deliveries() + state_.limits.turn_deliveries;
}

bool ConnectionReader::take_rest_of_mail() {
  if (has_rest_of_mail()) take_frames(std::exchange(mail_rest_, Run{}));
  return !has_rest_of_mail();
}

bool ConnectionReader::take_mail(const Mail& mail) {
  if (mail.kind != MailKind::frames) {
    take_word(mail);
    return true;
  }
  take_frames({state_.pool.adopt(mail.lent), mail.bytes, mail.size, mail.frames});
  return !has_rest_of_mail();
}

void ConnectionReader::take_frames(const Run& frames) {
  const auto length_max = static_cast<std::uint32_t>(state_.limits.frame_bytes);
  mail_rest_ = state_.router.route_handed_over(frames, length_max, deliveries_end_);
}

void ConnectionReader::take_word(const Mail& mail) {
  switch (mail.kind) {
    case MailKind::frames:
      return;
    case MailKind::control:
      return state_.signals.apply_control(mail.node, {mail.small, mail.small_size});
    case MailKind::hold:
      return state_.signals.apply_hold(mail.node, true);
    case MailKind::release:
      return state_.signals.apply_hold(mail.node, false);
    case MailKind::start_wanted:
      return state_.retained.on_start_wanted(word_of<GroupStart>(mail));
    case MailKind::start:
      return state_.retained.on_start(word_of<GroupStart>(mail));
    case MailKind::last:
      state_.done_shards |= std::uint64_t{1} << word_of<ShardIndex>(mail).value();
      return;
    case MailKind::retained:
      return state_.retained.on_handed(
          word_of<GroupStart>(mail),
          {state_.pool.adopt(mail.lent), mail.bytes, mail.size, mail.frames});
  }
}

}  // namespace gimnet::hub
