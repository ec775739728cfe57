#pragma once

#include <string>

#include "hub/shard/closer.hpp"
#include "hub/shard/shard_state.hpp"
#include "proto/frame/flow.hpp"
#include "proto/frame/frame_parser.hpp"

namespace gimnet::hub {

/// Frames of a connection that are for the hub itself: FLOW, GOODBYE and requests. Closes a
/// connection that sends what no node may send. Thread safety: one shard.
class HubFrames {
 public:
  HubFrames(ShardState& state, Closer& closer) : state_(state), closer_(closer) {}

  /// A frame of a node that the gate did not admit as data. False, as of the other functions: the
  /// connection was closed.
  [[nodiscard]] bool take(Connection& connection, const proto::RunView& view, Admission admission);
  [[nodiscard]] bool take_flow(Connection& connection, const proto::RunView& view);
  /// A frame of kind LINK.
  [[nodiscard]] bool take_goodbye(Connection& connection, const proto::RunView& view);
  /// Closes the connection for its frame. Returns false.
  [[nodiscard]] bool refuse(Connection& connection, proto::DropReason reason,
                            proto::GoodbyeCode code, const std::string& sentence);

 private:
  [[nodiscard]] bool take_request(Connection& connection, const proto::RunView& view);
  void on_ping(Connection& connection, const proto::flow::Ping& ping);
  void on_confirm(Connection& connection, const proto::flow::Confirm& confirm);
  [[nodiscard]] bool on_skip(Connection& connection, const proto::flow::Skip& skip);
  /// One that is of no use, as a limited number of them may be.
  [[nodiscard]] bool on_bad_credit(Connection& connection);

  ShardState& state_;
  Closer& closer_;
};

}  // namespace gimnet::hub
