#include "hub/shard/hub_frames.hpp"

#include <algorithm>
#include <utility>

#include "base/clock.hpp"
#include "hub/shard/flow_words.hpp"

namespace gimnet::hub {

bool HubFrames::take(Connection& connection, const proto::RunView& view, Admission admission) {
  switch (admission) {
    case Admission::flow:
      return take_flow(connection, view);
    case Admission::link:
      return take_goodbye(connection, view);
    case Admission::control:
      return take_request(connection, view);
    case Admission::wrong_source:
      state_.counters.wrong_source.add(1);
      return refuse(
          connection, proto::DropReason::wrong_source, proto::GoodbyeCode::wrong_source,
          "a frame's source is not this connection's node id; put the id from WELCOME into src");
    case Admission::data:
    case Admission::malformed:
    case Admission::hop_limit:
    case Admission::report:
      break;
  }
  return refuse(
      connection, proto::DropReason::malformed, proto::GoodbyeCode::malformed,
      std::string("malformed frame: ") + proto::frame_error_text(connection.ingress.error));
}

bool HubFrames::take_flow(Connection& connection, const proto::RunView& view) {
  const auto message =
      proto::flow::decode({view.bytes + proto::kHeaderSize, view.size - proto::kHeaderSize});
  if (!message && connection.is_link()) {
    state_.counters.malformed.add(1);
    return true;
  }
  if (!message) {
    return refuse(connection, proto::DropReason::malformed, proto::GoodbyeCode::malformed,
                  "malformed FLOW frame: unknown operation, or too short for it");
  }
  if (const auto* ping = std::get_if<proto::flow::Ping>(&*message)) on_ping(connection, *ping);
  if (const auto* confirm = std::get_if<proto::flow::Confirm>(&*message))
    on_confirm(connection, *confirm);
  if (const auto* skip = std::get_if<proto::flow::Skip>(&*message))
    return on_skip(connection, *skip);
  if (const auto* credit = std::get_if<proto::flow::Credit>(&*message)) {
    if (!state_.pacer.on_credit(connection, *credit)) return on_bad_credit(connection);
  }
  if (const auto* missed = std::get_if<proto::flow::Missed>(&*message))
    return tell_missed(state_, connection, *missed) || on_bad_credit(connection);
  return true;
}

bool HubFrames::on_bad_credit(Connection& connection) {
  state_.counters.bad_credits.add(1);
  const Limits& limits = state_.limits;
  const std::chrono::milliseconds now{state_.now_ms};
  if (connection.oddities.take({limits.oddities_per_s, limits.oddities_burst}, now)) return true;
  closer_.close(
      connection, proto::GoodbyeCode::oddities,
      "more than " + std::to_string(limits.oddities_burst) +
          " CREDITs in a short time were of no use, or MISSEDs came more than once a second");
  return false;
}

void HubFrames::on_ping(Connection& connection, const proto::flow::Ping& ping) {
  send_flow(state_, connection, proto::flow::Pong{ping.sequence, ping.sent_ns, wall_now_ns()});
  if (connection.resume) send_confirm(state_, connection);
}

void HubFrames::on_confirm(Connection& connection, const proto::flow::Confirm& confirm) {
  if (!connection.resume) return;
  const std::uint64_t confirmed = connection.resume->kept.confirm(confirm.count);
  state_.tally.delivered += confirmed;
  connection.outbox.counters()->delivered.add(confirmed);
  state_.tally.queued -= static_cast<std::int64_t>(confirmed);
  if (confirmed != 0 && connection.progress) connection.progress->block_since_ms = state_.now_ms;
  state_.recipients.mark_dirty(connection);
}

bool HubFrames::on_skip(Connection& connection, const proto::flow::Skip& skip) {
  if (!connection.resume || skip.count == proto::flow::kSkipUnknown) return true;
  // The frames before it may not have been taken, so they must not be confirmed with it.
  if (connection.gate.has(ReadGate::draining)) return true;
  std::uint64_t& taken = connection.resume->taken;
  if (skip.count > UINT64_MAX - 1 - std::min(taken, UINT64_MAX - 1)) {
    return refuse(connection, proto::DropReason::malformed, proto::GoodbyeCode::malformed,
                  "SKIP for more frames than there can be");
  }
  taken += skip.count;
  state_.counters.gap_frames.add_within(skip.count, kGapFramesMost);
  return true;
}

bool HubFrames::take_goodbye(Connection& connection, const proto::RunView& view) {
  const std::span<const std::byte> payload(view.bytes + proto::kHeaderSize,
                                           view.size - proto::kHeaderSize);
  const auto goodbye = proto::decode<proto::Goodbye>(payload);
  if (!goodbye) {
    const auto control = proto::split_control(payload);
    const bool is_goodbye = control && control->header.operation == proto::Goodbye::kOperation;
    return refuse(
        connection, proto::DropReason::malformed, proto::GoodbyeCode::malformed,
        is_goodbye ? goodbye.error().sentence : "after WELCOME the only LINK message is GOODBYE");
  }
  closer_.on_goodbye(connection, goodbye->code, goodbye->sentence);
  return false;
}

bool HubFrames::take_request(Connection& connection, const proto::RunView& view) {
  if (++connection.requests > state_.limits.requests) {
    closer_.close(connection, proto::GoodbyeCode::too_many_requests,
                  "more than " + std::to_string(state_.limits.requests) +
                      " requests are unanswered; wait for answers before asking more");
    return false;
  }
  ControlFrameEvent event{connection.session(), connection.attachment, connection.node, {}};
  event.frame.assign(view.bytes, view.bytes + view.size);
  state_.tell_conductor({state_.self, std::move(event)});
  return true;
}

bool HubFrames::refuse(Connection& connection, proto::DropReason reason, proto::GoodbyeCode code,
                       const std::string& sentence) {
  // One frame came and ended here; what stands behind it is not looked at and so was never a frame.
  state_.tally.accepted += 1;
  state_.tally.drop(reason, 1);
  closer_.close(connection, code, sentence);
  return false;
}

}  // namespace gimnet::hub
