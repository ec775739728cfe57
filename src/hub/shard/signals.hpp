#pragma once

#include <cstdint>

#include "hub/data/egress/egress_context.hpp"

namespace gimnet::hub {

struct ShardState;
struct Connection;

/// Words about senders, from the outboxes of this shard or from another one: PAUSE and RESUME
/// frames, held reads, reports. A sender on another shard gets them through that shard's mailbox.
/// Thread safety: one shard.
class Signals final : public SenderSignals {
 public:
  explicit Signals(ShardState& state) : state_(state) {}

  void pause(NodeId sender, const proto::flow::Target& target) override;
  void resume(NodeId sender, const proto::flow::Target& target) override;
  void hold(NodeId sender) override;
  void release(NodeId sender) override;

  /// A frame that the hub made, to a node here or on another shard.
  void send_control(NodeId node, std::span<const std::byte> frame);
  /// The same, and the holds, as another shard asked for them.
  void apply_control(NodeId node, std::span<const std::byte> frame);
  void apply_hold(NodeId node, bool hold);
  /// A frame of another hub for a node: a REPORT, or a word about its sending.
  void pass_on(std::span<std::byte> frame);
  /// REPORTs that are due.
  void send_reports();

  /// Sets what the connection is waited for, from its state.
  void arm(Connection& connection);
  /// Nothing is heard of a node that is not read, however long: bounds how long its machine may
  /// take nothing (for a peer that is read it would end those too that have to take nothing but
  /// LATEST messages).
  void watch_unread(Connection& connection);

 private:
  void flow(NodeId sender, const proto::flow::Message& message);
  void tell_hold(NodeId sender, bool hold);

  ShardState& state_;
};

}  // namespace gimnet::hub
