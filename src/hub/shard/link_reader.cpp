#include "hub/shard/connection_reader.hpp"
#include "hub/shard/flow_words.hpp"
#include "proto/frame/frame_parser.hpp"

// Frames that come over a link and are not routed. A link is always read, and only an impossible
// length ends it: a frame that is not understood is dropped and counted, or resume would send it
// for ever (docs/protocol.md, section 10).

namespace gimnet::hub {
namespace {

/// Frames for the conductor, of one link: the records of 4,000 hubs at once, and their changes.
constexpr TokenBucket::Rate kControlFrames{5'000, 50'000};

bool is_counted(proto::Kind kind) {
  if (static_cast<std::uint8_t>(kind) >= proto::kFirstControlKind) return false;
  return kind != proto::Kind::report && kind != proto::Kind::flow;
}

}  // namespace

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

bool ConnectionReader::handle_from_link(Connection& connection, const proto::RunView& view,
                                        Admission admission) {
  switch (admission) {
    case Admission::link:
      return handle_link(connection, view);
    case Admission::flow:
      if (proto::load_header(view.bytes).dst == 0) return handle_flow(connection, view);
      pass_on_flow(connection, view);
      return true;
    case Admission::control:
      if (view.size == proto::kHeaderSize) break;  // it names no operation
      if (connection.link->control.take(kControlFrames, std::chrono::milliseconds{state_.now_ms})) {
        ControlFrameEvent event{connection.session(), connection.attachment, connection.node, {}};
        event.frame.assign(view.bytes, view.bytes + view.size);
        state_.tell_conductor({state_.self, std::move(event)});
      } else {
        state_.counters.too_many_requests.add(1);
      }
      return true;
    case Admission::report:
      pass_on_report(connection, view);
      return true;
    case Admission::wrong_source:
      state_.counters.wrong_source.add(view.frames);
      tell_refused(connection, view);
      drop_from_link(connection, view, proto::DropReason::wrong_source);
      return true;
    case Admission::hop_limit:
      drop_from_link(connection, view, proto::DropReason::hop_limit);
      return true;
    case Admission::malformed:
    case Admission::data:
      break;
  }
  state_.counters.malformed.add(view.frames);
  tell_refused(connection, view);
  drop_from_link(connection, view, proto::DropReason::malformed);
  return true;
}

void ConnectionReader::tell_refused(const Connection& connection, const proto::RunView& view) {
  if (state_.now_ms < tell_refused_at_ms_) return;
  tell_refused_at_ms_ = state_.now_ms + 1'000;
  ControlFrameEvent event{connection.session(), connection.attachment, connection.node, {}};
  event.frame.assign(view.bytes, view.bytes + proto::kHeaderSize);
  state_.tell_conductor({state_.self, std::move(event)});
}

void ConnectionReader::drop_from_link(Connection& connection, const proto::RunView& view,
                                      proto::DropReason reason) {
  if (!is_counted(proto::load_header(view.bytes).kind)) return;
  count(connection, view);
  // A sender that may not speak there is not told: the source may be anybody's.
  if (reason == proto::DropReason::hop_limit) {
    state_.drops.drop(view.bytes, view.frames, reason);
  } else {
    state_.tally.drop(reason, view.frames);
  }
}

/// It counts its hop, and never goes back to the hub that it came from.
void ConnectionReader::pass_on_report(Connection& connection, const proto::RunView& view) {
  const proto::FrameHeader header = proto::load_header(view.bytes);
  const HubId to = hub_of(NodeId{header.dst});
  const bool back =
      to != state_.shared.hub && state_.shared.routes.find(to).neighbour == hub_of(connection.node);
  const bool too_large = view.size > proto::kHeaderSize + proto::kReportSizeMax;
  if (back || too_large || header.hops >= proto::kHopsMax) return;
  auto* bytes = const_cast<std::byte*>(view.bytes);
  bytes[proto::kHopsOffset] = static_cast<std::byte>(header.hops + 1);
  state_.signals.pass_on({bytes, view.size});
}

/// PAUSE or RESUME on its way to a sender. Only the next hop towards the destination may say it.
void ConnectionReader::pass_on_flow(Connection& connection, const proto::RunView& view) {
  const auto message =
      proto::flow::decode({view.bytes + proto::kHeaderSize, view.size - proto::kHeaderSize});
  if (!message || view.size > proto::flow::kFrameSizeMax) return state_.counters.malformed.add(1);
  const proto::flow::Target* target = nullptr;
  if (const auto* pause = std::get_if<proto::flow::Pause>(&*message)) target = &pause->target;
  if (const auto* resume = std::get_if<proto::flow::Resume>(&*message)) target = &resume->target;
  if (target == nullptr) return state_.counters.malformed.add(1);
  const NextHop next = state_.shared.routes.find(hub_of(NodeId{target->dst}));
  if (next.exists() && next.neighbour == hub_of(connection.node))
    state_.signals.pass_on({const_cast<std::byte*>(view.bytes), view.size});
}

}  // namespace gimnet::hub
