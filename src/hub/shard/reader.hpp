#pragma once

#include "hub/shard/closer.hpp"
#include "hub/shard/shard_state.hpp"

namespace gimnet::hub {

/// Reads connections: bytes to frames, through the gate, to the router, or to who else they are for.
/// Thread safety: one shard.
class Reader {
 public:
  Reader(ShardState& state, Closer& closer) : state_(state), closer_(closer) {}

  /// Reads what is there, up to one turn's share. The connection may be closed by it.
  void read(Connection& connection);
  /// Frames from another shard.
  void take_mail(const Mail& mail);

 private:
  /// Not read until the shards that it sends to have room.
  /// Apart from read(), of which nearly every call has no use for it.
  [[gnu::noinline]] void tell_heard(Connection& connection);
  void wait_for_room(Connection& connection);
  /// False: the connection was closed.
  [[nodiscard]] bool process(Connection& connection, ReceiveBuffer::Received received);
  /// Keeps the frame that was begun; where too much is kept, those go whose frames were begun before. False: nobody is
  /// left to go.
  [[nodiscard]] bool keep(Connection& connection, std::span<const std::byte> begun, std::uint32_t needed);
  /// Who began its frame longest ago, and before this one; nullptr: nobody.
  [[nodiscard]] Connection* begun_before(const Connection& connection) const;
  /// May shorten `view` to the frames that it handled.
  [[nodiscard]] bool handle_run(Connection& connection, proto::RunView& view);
  [[nodiscard]] bool handle_other(Connection& connection, const proto::RunView& view, Admission admission);
  void route(Connection& connection, const proto::RunView& view);
  [[nodiscard]] bool handle_flow(Connection& connection, const proto::RunView& view);
  [[nodiscard]] bool handle_link(Connection& connection, const proto::RunView& view);
  [[nodiscard]] bool handle_control(Connection& connection, const proto::RunView& view);
  void on_ping(Connection& connection, const proto::flow::Ping& ping);
  void on_pong(Connection& connection, const proto::flow::Pong& pong);
  /// False: it was one too many, and the connection was closed.
  [[nodiscard]] bool take_bad_credit(Connection& connection);
  void on_confirm(Connection& connection, const proto::flow::Confirm& confirm);
  void on_skip(Connection& connection, const proto::flow::Skip& skip);
  /// Data frames that it sent, admitted.
  void count(Connection& connection, const proto::RunView& view);
  void count_taken(Connection& connection, const proto::RunView& view);
  void fill_trace(const proto::RunView& view);
  [[nodiscard]] bool refuse(Connection& connection, const proto::RunView& view, proto::DropReason reason,
                            proto::GoodbyeCode code, const std::string& sentence);

  ShardState& state_;
  Closer& closer_;
};

/// Tells the peer how many data frames were taken from it.
void send_confirm(ShardState& state, Connection& connection);
/// The conductor wants to know when the node has read all that it was sent so far; `move` is its name for that.
void ask_whether_read(ShardState& state, Connection& connection, std::uint64_t move);
/// A FLOW frame to the peer of this connection.
void send_flow(ShardState& state, Connection& connection, const proto::flow::Message& message);

}  // namespace gimnet::hub
