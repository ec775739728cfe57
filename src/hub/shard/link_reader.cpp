#include "hub/shard/link_reader.hpp"

#include "hub/shard/flow_words.hpp"
#include "proto/control/route.hpp"
#include "proto/frame/frame_parser.hpp"

namespace gimnet::hub {
namespace {

using proto::route::RouteOperation;

/// Frames for the conductor, of one link: the records of 4,000 hubs at once, and their changes.
constexpr TokenBucket::Rate kControlFrames{5'000, 50'000};

/// Of a ROUTE frame, after its header. The largest message has 10,240 bytes.
constexpr std::uint32_t kRouteBytesMax = 16 * 1024;

bool is_route(const proto::RunView& view) {
  return proto::load_header(view.bytes).kind == proto::Kind::route;
}

bool is_too_large(const proto::RunView& view) {
  return is_route(view) && view.size > proto::kHeaderSize + kRouteBytesMax;
}

/// A ROUTE frame of an operation that this version does not have.
bool is_unknown(const proto::RunView& view) {
  if (!is_route(view)) return false;
  const auto control =
      proto::split_control({view.bytes + proto::kHeaderSize, view.size - proto::kHeaderSize});
  return !control ||
         control->header.operation < static_cast<std::uint16_t>(RouteOperation::record) ||
         control->header.operation > static_cast<std::uint16_t>(RouteOperation::joined);
}

bool is_counted(proto::Kind kind) {
  if (static_cast<std::uint8_t>(kind) >= proto::kFirstControlKind) return false;
  return kind != proto::Kind::report && kind != proto::Kind::flow;
}

/// Why the frame is refused: its source is at a hub that `allow` does not name, or is none of
/// another hub.
proto::DropReason refusal_of(const proto::RunView& view, const LinkRule& rule) {
  const HubId source = hub_of(NodeId{proto::load_header(view.bytes).src});
  const bool elsewhere = source != rule.own && source != kOwnHub && source.value() <= kHubIdMax;
  return elsewhere ? proto::DropReason::not_allowed : proto::DropReason::wrong_source;
}

}  // namespace

bool LinkReader::take(Connection& connection, const proto::RunView& view, Admission admission) {
  switch (admission) {
    case Admission::link:
      return hub_frames_.take_goodbye(connection, view);
    case Admission::flow:
      if (proto::load_header(view.bytes).dst == 0) return hub_frames_.take_flow(connection, view);
      pass_on_flow(connection, view);
      return true;
    case Admission::control:
      if (view.size == proto::kHeaderSize || is_too_large(view)) break;
      if (is_unknown(view)) {
        state_.counters.malformed.add(1);
      } else {
        take_control(connection, view);
      }
      return true;
    case Admission::report:
      pass_on_report(connection, view);
      return true;
    case Admission::wrong_source:
      state_.counters.wrong_source.add(view.frames);
      tell_refused(connection, view);
      drop(connection, view, refusal_of(view, connection.link->rule));
      return true;
    case Admission::hop_limit:
      drop(connection, view, proto::DropReason::hop_limit);
      return true;
    case Admission::malformed:
    case Admission::data:
      break;
  }
  refuse(connection, view);
  drop(connection, view, proto::DropReason::malformed);
  return true;
}

void LinkReader::refuse(const Connection& connection, const proto::RunView& view) {
  state_.counters.malformed.add(view.frames);
  tell_refused(connection, view);
}

void LinkReader::take_control(Connection& connection, const proto::RunView& view) {
  if (connection.link->control.take(kControlFrames, std::chrono::milliseconds{state_.now_ms})) {
    tell_conductor(connection, view, view.size);
  } else {
    state_.counters.too_many_requests.add(1);
  }
}

void LinkReader::tell_refused(const Connection& connection, const proto::RunView& view) {
  if (state_.now_ms < tell_refused_at_ms_) return;
  tell_refused_at_ms_ = state_.now_ms + 1'000;
  tell_conductor(connection, view, proto::kHeaderSize);
}

void LinkReader::tell_conductor(const Connection& connection, const proto::RunView& view,
                                std::uint32_t size) {
  ControlFrameEvent event{connection.session(), connection.attachment, connection.node, {}};
  event.frame.assign(view.bytes, view.bytes + size);
  state_.tell_conductor({state_.self, std::move(event)});
}

void LinkReader::drop(Connection& connection, const proto::RunView& view,
                      proto::DropReason reason) {
  if (!is_counted(proto::load_header(view.bytes).kind)) return;
  count_accepted(state_, connection, view);
  // The source of other frames is not told of them: it may be anybody's.
  if (reason == proto::DropReason::hop_limit || reason == proto::DropReason::not_allowed) {
    state_.drops.drop(view.bytes, view.frames, reason);
  } else {
    state_.tally.drop(reason, view.frames);
  }
}

/// It counts its hop, and never goes back to the hub that it came from.
void LinkReader::pass_on_report(const Connection& connection, const proto::RunView& view) {
  const proto::FrameHeader header = proto::load_header(view.bytes);
  const HubId to = hub_of(NodeId{header.dst});
  const bool back =
      to != state_.shared.hub && state_.shared.routes.find(to).neighbour == hub_of(connection.node);
  const bool too_large = view.size > proto::kHeaderSize + proto::kReportSizeMax;
  if (back || too_large || header.hops >= proto::kHopsMax)
    return state_.counters.reports_lost.add(1);
  auto* bytes = const_cast<std::byte*>(view.bytes);
  bytes[proto::kHopsOffset] = static_cast<std::byte>(header.hops + 1);
  state_.signals.pass_on({bytes, view.size});
}

/// PAUSE or RESUME on its way to a sender. Only the next hop towards the destination may say it.
void LinkReader::pass_on_flow(const Connection& connection, const proto::RunView& view) {
  const auto message =
      proto::flow::decode({view.bytes + proto::kHeaderSize, view.size - proto::kHeaderSize});
  if (!message || view.size > proto::flow::kFrameSizeMax) return refuse(connection, view);
  const proto::flow::Target* target = nullptr;
  if (const auto* pause = std::get_if<proto::flow::Pause>(&*message)) target = &pause->target;
  if (const auto* resume = std::get_if<proto::flow::Resume>(&*message)) target = &resume->target;
  if (target == nullptr) return refuse(connection, view);
  const NextHop next = state_.shared.routes.find(hub_of(NodeId{target->dst}));
  if (next.exists() && next.neighbour == hub_of(connection.node))
    state_.signals.pass_on({const_cast<std::byte*>(view.bytes), view.size});
}

}  // namespace gimnet::hub
