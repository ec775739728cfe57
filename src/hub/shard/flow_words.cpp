#include "hub/shard/flow_words.hpp"

#include <algorithm>
#include <utility>

#include "base/clock.hpp"

namespace gimnet::hub {

bool push_flow(ShardState& state, Connection& connection, const proto::flow::Message& message) {
  std::byte frame[proto::flow::kFrameSizeMax];
  const std::size_t size = proto::flow::encode_frame(message, NodeId{}, frame);
  return connection.outbox.push_control({frame, size}, state.egress);
}

void send_flow(ShardState& state, Connection& connection, const proto::flow::Message& message) {
  if (push_flow(state, connection, message)) state.recipients.mark_dirty(connection);
}

void send_confirm(ShardState& state, Connection& connection) {
  ResumeState& resume = *connection.resume;
  if (resume.taken == resume.taken_told || std::exchange(resume.confirm_due, true)) return;
  state.confirms.push_back(connection.session());
}

bool push_confirm(ShardState& state, Connection& connection) {
  ResumeState& resume = *connection.resume;
  // Without room it is said with what is taken next, at the next PING, or with keep-alive.
  if (!push_flow(state, connection, proto::flow::Confirm{resume.taken})) return false;
  resume.taken_told = resume.taken;
  resume.bytes_since_told = 0;
  return true;
}

void note_taken(ShardState& state, Connection& connection, const proto::RunView& view) {
  ResumeState& resume = *connection.resume;
  resume.taken += view.frames;
  resume.bytes_since_told += view.size;
  if (resume.bytes_since_told >= resume.peer_resume_bytes / 4) send_confirm(state, connection);
}

bool tell_missed(ShardState& state, Connection& connection, const proto::flow::Missed& missed) {
  if (connection.is_link()) return true;
  const std::uint64_t most = std::max<std::uint64_t>(1, state.limits.subscriptions_per_node);
  if (!connection.missed.take({most, most}, std::chrono::milliseconds{state.now_ms})) return false;
  state.tell_conductor({state.self, MissedEvent{connection.session(), connection.node, missed}});
  return true;
}

}  // namespace gimnet::hub
