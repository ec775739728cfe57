#include "client/nif/node.hpp"

#include <array>
#include <utility>

#include "proto/frame/frame_builder.hpp"

namespace gimnet::nif {

Node::Node(Options options) : parts_(std::move(options)), thread_(parts_, *this) {}

Node::~Node() = default;

Result<std::unique_ptr<Node>, Failure> Node::connect(Options options) {
  std::unique_ptr<Node> node(new Node(std::move(options)));
  if (auto failure = node->thread_.start()) return std::move(*failure);
  return node;
}

void Node::set_name(const std::string& name, std::vector<std::byte> token) {
  parts_.record.set_name(name, std::move(token));
  parts_.wake.raise();
}

nif_info Node::info() {
  const auto best = parts_.clock.best();
  nif_info whole = parts_.record.info();
  whole.keep_alive_seen = best ? 1 : 0;
  whole.round_trip_ns = best ? best->round_trip_ns : 0;
  whole.clock_offset_ns = best ? best->offset_ns : 0;
  return whole;
}

nif_counters Node::counters() {
  nif_counters whole{};
  parts_.outbound.add_counters(whole);
  whole.receive_queue_bytes = parts_.received.bytes();
  whole.read_stops = parts_.received.stops();
  parts_.record.add_counters(whole);
  return whole;
}

nif_status Node::send(const nif_outgoing& message, std::int32_t timeout_ms, std::uint64_t tag) {
  Outgoing outgoing;
  if (const auto failure = outgoing.read(message, &parts_.clock)) return fail(*failure);
  outgoing.set_tag(tag);
  const bool may_wait = timeout_ms != 0 && !thread_.is_current();
  return parts_.outbound.send(outgoing, may_wait ? deadline_after(timeout_ms) : 0);
}

nif_status Node::ping_hub(HubClock::Measurement& measured, Deadline deadline) {
  const nif_status status = parts_.outbound.wait_connected(deadline);
  if (status != NIF_OK) return status;
  const proto::flow::Ping ping = parts_.clock.ping(steady_now_ns(), wall_now_ns());
  if (!parts_.outbound.post(ping))
    return fail(NIF_NOT_CONNECTED, "the connection broke while the hub was pinged");
  const auto answer = parts_.clock.wait_for(ping.sequence, deadline);
  if (answer) {
    measured = *answer;
    return NIF_OK;
  }
  if (parts_.closing.load()) return fail(NIF_CLOSED, "the handle was closed");
  if (deadline != kNever && steady_now_ns() >= deadline)
    return fail(NIF_TIMEOUT, "the hub did not answer in time");
  return fail(NIF_NOT_CONNECTED, "the connection broke while the hub was pinged");
}

void Node::begin_close() {
  parts_.closing.store(true);
  parts_.outbound.end({NIF_CLOSED, "the handle was closed"});
  parts_.received.close();
  parts_.requests.close();
  parts_.clock.clear();
}

void Node::close() { thread_.stop(); }

void Node::deliver(std::span<const Item> items) { parts_.received.push(items); }

bool Node::on_flow(const proto::flow::Message& message) {
  if (const auto* ping = std::get_if<proto::flow::Ping>(&message)) {
    parts_.outbound.post(proto::flow::Pong{ping->sequence, ping->sent_ns, wall_now_ns()});
    thread_.confirm();
  } else if (const auto* pong = std::get_if<proto::flow::Pong>(&message)) {
    parts_.clock.on_pong(*pong, steady_now_ns());
  } else if (const auto* pause = std::get_if<proto::flow::Pause>(&message)) {
    parts_.outbound.on_pause(pause->target);
  } else if (const auto* resume = std::get_if<proto::flow::Resume>(&message)) {
    parts_.outbound.on_resume(resume->target);
    if (resume->target.kind == proto::Kind::taken)
      thread_.tell_taken_again(NodeId{resume->target.dst});
  } else if (const auto* confirmed = std::get_if<proto::flow::Confirm>(&message)) {
    return parts_.outbound.on_confirm(confirmed->count);
  }
  return true;
}

std::vector<Item> Node::on_answer(proto::Kind kind, const proto::ControlView& answer) {
  if (kind == proto::Kind::ns &&
      answer.header.operation == proto::ns::SubscribeAnswer::kOperation) {
    // Before the first message behind it, which the program may take before it has seen this
    // answer.
    proto::Payload payload(proto::kControlHeaderSize);
    store_le(payload.data(), answer.header.operation);
    payload.insert(payload.end(), answer.body.begin(), answer.body.end());
    const auto subscribed = proto::decode_answer<proto::ns::SubscribeAnswer>(payload);
    if (subscribed) {
      parts_.credits.open(subscribed->group, subscribed->window, subscribed->number);
      parts_.declarations.on_subscribe_answer(subscribed->group);
    }
  }
  static_cast<void>(parts_.requests.on_answer(kind, answer));
  std::vector<Item> events = parts_.declarations.take_events();
  const std::vector<Item> ended_watches = parts_.watches.take_events();
  events.insert(events.end(), ended_watches.begin(), ended_watches.end());
  return events;
}

bool Node::on_service_moved(const proto::ns::ServiceMoved& event) {
  return parts_.declarations.on_service_moved(event);
}

bool Node::on_watch_events(const proto::ns::WatchEvents& events) {
  return parts_.watches.on_events(events);
}

void Node::on_taken(std::uint32_t from, const proto::Taken& taken) {
  if (const auto report = parts_.outbound.on_taken(from, taken))
    parts_.push_event(make_report(*report, from));
}

bool Node::on_report(const proto::Report& report) {
  if (report.reason == proto::DropReason::no_such_node ||
      report.reason == proto::DropReason::renumbered) {
    parts_.names.forget(report.header.dst);
  }
  return parts_.outbound.on_report(report);
}

std::optional<ReportedMessages::Start> Node::message_of(const proto::Report& report) {
  return parts_.outbound.message_of(report);
}

void Node::send_taken(std::uint32_t to, const proto::Taken& taken) {
  std::array<std::byte, proto::kTakenSize> payload;
  proto::encode_taken(taken, payload);
  proto::FrameParts parts;
  parts.header.kind = proto::Kind::taken;
  parts.header.dst = to;
  parts.header.lane = static_cast<std::uint8_t>(proto::Lane::real_time);
  std::array<std::byte, proto::kHeaderSize + proto::kTakenSize> frame;
  static_cast<void>(proto::write_frame(parts, payload, frame));
  parts_.outbound.post_data(frame);
}

}  // namespace gimnet::nif
