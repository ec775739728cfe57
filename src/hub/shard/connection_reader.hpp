#pragma once

#include <algorithm>
#include <cstddef>
#include <span>

#include "hub/data/tally.hpp"
#include "hub/shard/closer.hpp"
#include "hub/shard/connection.hpp"
#include "hub/shard/hub_frames.hpp"
#include "hub/shard/link_reader.hpp"
#include "hub/shard/shard_state.hpp"

namespace gimnet::hub {

/// From this size on a read is worth its system call.
inline constexpr std::size_t kSmallReadBytes = 16 * 1024;
/// So often more is read behind a small read.
inline constexpr int kReadsMore = 4;

/// Reads what follows into the rest of the room. An end or an error shows again at the next read.
[[nodiscard]] std::size_t receive_more(Connection& connection, std::span<std::byte> room,
                                       Tally& tally);

/// Reads, and after a small read reads again if that often finds more. A sender that writes message
/// by message has written the next one while the first was read. Both then leave in one write, and
/// a message costs mostly its write (docs/why-these-figures.md). REQUIRES: `room` is not empty.
/// Thread safety: one shard.
[[nodiscard]] inline net::IoResult receive_repeatedly(Connection& connection,
                                                      std::span<std::byte> room, Tally& tally) {
  net::IoResult result = connection.transport->receive(room);
  ++tally.receive_calls;
  if (result.status == net::IoStatus::ok && result.bytes < std::min(kSmallReadBytes, room.size()) &&
      connection.read_again.is_due()) {
    result.bytes += receive_more(connection, room.subspan(result.bytes), tally);
  }
  return result;
}

/// Reads connections: bytes to frames, through the gate, to the router, or to who else they are
/// for. Thread safety: one shard.
class ConnectionReader {
 public:
  ConnectionReader(ShardState& state, Closer& closer) : state_(state), closer_(closer) {}

  /// Reads what is there, up to one turn's share, and routes it, up to another. The connection may
  /// be closed by it. Does nothing while it has a rest.
  void read(Connection& connection) {
    read_some(connection);
    look_at_stream(connection);
  }
  /// Routes the rest of what was read in an earlier turn, up to a turn's share. As read().
  /// REQUIRES: it has one.
  void go_on(Connection& connection);
  /// Mail has a turn's share too, that of all shards together.
  void begin_mail();
  /// Goes on with the mail that an earlier turn left. Returns false once the share is used up.
  [[nodiscard]] bool take_rest_of_mail();
  /// The same with frames or a word from another shard; frames that are too many are left.
  /// REQUIRES: none are left.
  [[nodiscard]] bool take_mail(const Mail& mail);
  [[nodiscard]] bool has_rest_of_mail() const { return mail_rest_.frames != 0; }
  /// It lies in another shard's memory.
  void let_go() { mail_rest_ = Run{}; }

 private:
  /// Not read until the shards that it sends to have room.
  void wait_for_room(Connection& connection);
  void read_some(Connection& connection);
  /// A stream that was read may keep bytes that no poller shows, and may have made some to send.
  void look_at_stream(Connection& connection) {
    if (!connection.connected) return;
    if (connection.transport->pending_in() != 0) state_.go_on_later(connection);
    if (connection.transport->pending_out() != 0) state_.signals.arm(connection);
  }
  void route_all(Connection& connection, ReceiveBuffer::Received received);
  /// The turn's share is used up: [begin of a whole frame, end) waits for another turn.
  void keep_rest(Connection& connection, std::span<const std::byte> rest);
  void take_frames(const Run& frames);
  void take_word(const Mail& mail);
  /// The share that a connection has of this turn's deliveries: those with a rest have one
  /// together.
  [[nodiscard]] std::uint64_t share() const;
  /// False: the connection was closed.
  [[nodiscard]] bool process(Connection& connection, ReceiveBuffer::Received received);
  /// The same of a link, whose frames are looked at run by run: each counts its hop.
  [[nodiscard]] bool process_link(Connection& connection, ReceiveBuffer::Received received);
  [[nodiscard]] bool process_runs(Connection& connection, ReceiveBuffer::Received received);
  [[nodiscard]] bool take_begun(Connection& connection, std::span<const std::byte> begun,
                                bool nothing_before, const proto::NextRun& found);
  /// Keeps the frame that was begun; where too much is kept, those go whose frames were begun
  /// before. False: nobody is left to go.
  [[nodiscard]] bool keep(Connection& connection, std::span<const std::byte> begun,
                          std::uint32_t needed);
  /// The connection that began its frame longest ago, and before this one; nullptr: none.
  [[nodiscard]] Connection* begun_before(const Connection& connection) const;
  /// May shorten `view` to the frames that it handled.
  [[nodiscard]] bool handle_run(Connection& connection, proto::NextRun& found);
  void route(Connection& connection, const proto::NextRun& found);
  void stamp_arrival(const Connection& connection, const proto::RunView& view);

  ShardState& state_;
  Closer& closer_;
  HubFrames hub_frames_{state_, closer_};
  LinkReader link_reader_{state_, hub_frames_};
  std::uint64_t deliveries_end_ = 0;  ///< the router's count at which the share is used up
  Run mail_rest_;
};

}  // namespace gimnet::hub
