#pragma once

#include <cstdint>

#include "hub/shard/hub_frames.hpp"
#include "hub/shard/shard_state.hpp"

namespace gimnet::hub {

/// Frames that come over a link and are not routed. A link is always read. Only an impossible
/// length and a frame of kind LINK end it. Another frame that is not understood is dropped and
/// counted, or resume would send it for ever (docs/protocol.md, section 10). Thread safety: one
/// shard.
class LinkReader {
 public:
  LinkReader(ShardState& state, HubFrames& hub_frames) : state_(state), hub_frames_(hub_frames) {}

  /// A frame that the gate did not admit as data. False: the connection was closed.
  [[nodiscard]] bool take(Connection& connection, const proto::RunView& view, Admission admission);

 private:
  void take_control(Connection& connection, const proto::RunView& view);
  void pass_on_report(const Connection& connection, const proto::RunView& view);
  void pass_on_flow(const Connection& connection, const proto::RunView& view);
  void drop(Connection& connection, const proto::RunView& view, proto::DropReason reason);
  /// Counts a malformed frame, and has it logged.
  void refuse(const Connection& connection, const proto::RunView& view);
  /// Tells the conductor, at most once a second, of a frame that a link should not have sent.
  void tell_refused(const Connection& connection, const proto::RunView& view);
  /// The first bytes of the frame, for the conductor.
  void tell_conductor(const Connection& connection, const proto::RunView& view, std::uint32_t size);

  ShardState& state_;
  HubFrames& hub_frames_;
  std::uint64_t tell_refused_at_ms_ = 0;  ///< the next one is told then
};

}  // namespace gimnet::hub
