#include "hub/shard/signals.hpp"

#include <cstring>

#include "hub/shard/control_frame.hpp"
#include "hub/shard/shard_state.hpp"

namespace gimnet::hub {
namespace {

bool is_resume(std::span<const std::byte> frame) {
  if (proto::load_header(frame.data()).kind != proto::Kind::flow) return false;
  const auto message = proto::flow::decode(frame.subspan(proto::kHeaderSize));
  return message && std::holds_alternative<proto::flow::Resume>(*message);
}

}  // namespace

void Signals::pause(NodeId sender, const proto::flow::Target& target) {
  state_.counters.pauses.add(1);
  flow(sender, proto::flow::Pause{target});
}

void Signals::resume(NodeId sender, const proto::flow::Target& target) {
  state_.counters.resumes.add(1);
  flow(sender, proto::flow::Resume{target});
}

void Signals::flow(NodeId sender, const proto::flow::Message& message) {
  std::byte frame[proto::flow::kFrameSizeMax];
  const std::size_t size = proto::flow::encode_frame(message, NodeId{}, frame);
  // On the way to another hub it says for whom it is.
  if (hub_of(sender) != state_.shared.hub) set_destination({frame, size}, sender);
  send_control(sender, {frame, size});
}

void Signals::pass_on(std::span<std::byte> frame) {
  const proto::FrameHeader header = proto::load_header(frame.data());
  const NodeId node{header.dst};
  const bool here = hub_of(node) == state_.shared.hub;
  if (here && header.kind == proto::Kind::flow) set_destination(frame, NodeId{});
  if (!here && header.kind == proto::Kind::report && !state_.router.place_of(node).exists())
    return state_.counters.reports_lost.add(1);
  send_control(node, frame);
}

void Signals::send_control(NodeId node, std::span<const std::byte> frame) {
  const NodePlace place = state_.router.place_of(node);
  if (!place.exists()) return;
  if (place.shard == state_.self) return apply_control(node, frame);
  Mail mail;
  mail.kind = MailKind::control;
  mail.node = node;
  GIMNET_CHECK(frame.size() <= sizeof mail.small);
  mail.small_size = static_cast<std::uint8_t>(frame.size());
  std::memcpy(mail.small, frame.data(), frame.size());
  state_.fanout.post_word(place.shard, mail);
}

void Signals::apply_control(NodeId node, std::span<const std::byte> frame) {
  Connection* connection = state_.find(node);
  const bool connected = connection != nullptr && connection->connected;
  if (connected && connection->outbox.push_control(frame, state_.egress))
    return state_.recipients.mark_dirty(*connection);
  const bool elsewhere = hub_of(node) != state_.shared.hub;
  if (elsewhere && proto::load_header(frame.data()).kind == proto::Kind::report)
    state_.counters.reports_lost.add(1);
  if (!connected) return;
  // PAUSE is told again, a REPORT may be missed; RESUME is said once.
  if (is_resume(frame) && !connection->is_link()) connection->missed_resume = true;
}

void Signals::hold(NodeId sender) { tell_hold(sender, true); }

void Signals::release(NodeId sender) { tell_hold(sender, false); }

/// A link is always read: a hub that refused to read one would stop everybody behind it.
void Signals::tell_hold(NodeId sender, bool hold) {
  if (hub_of(sender) != state_.shared.hub) return;
  const NodePlace place = state_.router.place_of(sender);
  if (!place.exists()) return;
  if (place.shard == state_.self) return apply_hold(sender, hold);
  Mail mail;
  mail.kind = hold ? MailKind::hold : MailKind::release;
  mail.node = sender;
  state_.fanout.post_word(place.shard, mail);
}

void Signals::apply_hold(NodeId node, bool hold) {
  Connection* connection = state_.find(node);
  if (connection == nullptr) return;
  if (hold) {
    connection->gate.shut(ReadGate::held);
    if (++connection->holds == 1) watch_unread(*connection);
    state_.counters.held_reads.add(1);
  } else if (connection->holds != 0) {
    if (--connection->holds == 0) {
      connection->gate.clear(ReadGate::held);
      watch_unread(*connection);
    }
    connection->on_read_again(state_.now_ms);
  }
  arm(*connection);
}

void Signals::watch_unread(Connection& connection) {
  if (!connection.connected) return;
  const std::uint64_t ms = connection.holds != 0 ? state_.limits.unacknowledged_ms : 0;
  connection.transport->limit_unacknowledged(static_cast<std::uint32_t>(ms));
}

void Signals::send_reports() {
  if (!state_.drops.pending()) return;
  state_.drops.flush(state_.now_ms, [this](NodeId sender, std::span<const std::byte> payload) {
    // A link brings frames before the way back to their hub is known.
    const bool elsewhere = hub_of(sender) != state_.shared.hub;
    if (elsewhere && !state_.router.place_of(sender).exists()) return false;
    std::byte frame[proto::kHeaderSize + proto::kReportSizeMax];
    proto::FrameHeader header;
    header.length = static_cast<std::uint32_t>(payload.size());
    header.dst = sender.value();
    header.src = make_id<NodeId>(state_.shared.hub, kHubIndex).value();
    header.kind = proto::Kind::report;
    header.lane = static_cast<std::uint8_t>(proto::Lane::real_time);
    proto::store_header(frame, header);
    std::memcpy(frame + proto::kHeaderSize, payload.data(), payload.size());
    state_.counters.reports.add(1);
    send_control(sender, {frame, header.frame_size()});
    return true;
  });
  state_.counters.reports_lost.add(state_.drops.take_lost());
}

void Signals::arm(Connection& connection) {
  if (!connection.connected) return;
  const Interest wanted = interest_of(connection.gate, connection.write, connection.must_confirm,
                                      connection.transport->pending_out());
  if (wanted == connection.armed) return;
  connection.armed = wanted;
  const int descriptor = connection.transport->descriptor();
  if (descriptor >= 0) state_.poller.change(descriptor, connection.token(), wanted);
}

}  // namespace gimnet::hub
