#pragma once

#include <cstdint>
#include <thread>

#include "hub/shard/allocator.hpp"
#include "hub/shard/attacher.hpp"
#include "hub/shard/closer.hpp"
#include "hub/shard/connection_reader.hpp"
#include "hub/shard/flusher.hpp"
#include "hub/shard/keeper.hpp"
#include "hub/shard/shard_state.hpp"

namespace gimnet::hub {

/// One io thread: its connections, their queues, and the turn that serves them. A turn takes
/// commands and mail, reads every ready connection up to its share, routes all of it, then writes
/// each connection once. Every step is bounded. Thread safety: send() from the conductor; start()
/// and join() from who made it; the rest is the shard's own thread.
class IoShard {
 public:
  /// The thread's way to wait for work.
  struct Options {
    bool spin = false;  ///< never sleep: less latency for a whole CPU
  };
  IoShard(ShardIndex index, const HubShared& shared, Options options);
  ~IoShard();
  IoShard(const IoShard&) = delete;
  IoShard& operator=(const IoShard&) = delete;

  void start();
  /// After a StopCommand.
  void join();
  /// Lets go what this shard holds of others: before any of them goes, when no shard's thread runs
  /// any more.
  void let_go();

  /// Conductor: hands a command over; order is kept.
  void send(ShardCommand command);

  /// One turn, for tests that drive a shard without its thread: `ready` are connections of a
  /// transport that no poller knows. now_ms is monotonic.
  void turn(std::span<const Ready> ready, std::uint64_t now_ms);
  [[nodiscard]] ShardState& state() { return state_; }
  /// Something was read, or handed over, and can be routed on in the next turn.
  [[nodiscard]] bool has_rest() const;

 private:
  /// Mailbox entries and commands that one turn takes.
  static constexpr std::size_t kMailPerTurn = 1024;
  static constexpr std::size_t kCommandsPerTurn = 256;
  /// So much is read before it is written: more would leave the cache.
  static constexpr std::uint64_t kReadBytesPerFlush = 256 * 1024;

  void run();
  [[nodiscard]] std::span<const Ready> wait();
  /// When there is something to do again whatever comes: Poller::kNow, Poller::kNever, or a
  /// monotonic time.
  [[nodiscard]] std::uint64_t wake_at_ms();
  /// After prepare_to_sleep(): is there something that nobody will wake this thread for any more?
  [[nodiscard]] bool has_work();
  [[nodiscard]] bool room_came();
  void take_commands();
  void take_mail();
  void serve(std::span<const Ready> ready);
  void go_on();
  void read_waiting();
  void flush();
  void finish_turn();
  void execute(ShardCommand& command);
  /// A request of somebody else, or its answer, on its way over a link.
  void pass_on(Connection& connection, std::span<const std::byte> frame);
  /// Hands a control frame to the connection, or closes it if too many wait.
  void say(Connection& connection, std::span<const std::byte> frame);
  void tell(TellCommand& command);
  void say_event(Connection& connection, std::span<const std::byte> frame);
  void tell_again(const TellAgainCommand& command);
  void begin_pace(const PaceCommand& command);

  ShardState state_;
  Closer closer_;
  Flusher flusher_;
  ConnectionReader reader_;
  Attacher attacher_;
  Keeper keeper_;
  MpscQueue<ShardCommand> commands_;
  const Options options_;
  std::vector<std::uint64_t> going_on_;  ///< who had a rest when this turn began
  bool stopped_ = false;
  bool flush_again_ = false;
  bool room_came_ =
      false;  ///< in a mailbox, since connections that wait for room were last looked at
  AllocationMeter meter_;  ///< of the thread that takes the turns
  std::thread thread_;
};

}  // namespace gimnet::hub
