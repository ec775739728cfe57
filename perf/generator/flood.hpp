#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "generator/engine.hpp"

namespace gimnet::perf {

enum class Writing {
  batched,   ///< 64 KiB with a system call, in whole messages
  unbatched  ///< a system call for each message
};

struct MessageShape {
  std::size_t payload_bytes = 16;
  std::uint8_t lane = 1;
};

/// Sends messages of one client to its targets in turns, as fast as it is asked to.
class Publisher {
 public:
  /// REQUIRES: `targets` is not empty; their streams are distinct.
  Publisher(Wire& wire, Client& from, const std::vector<Target>& targets, MessageShape shape,
            Writing writing);

  /// Begins at most one write. Returns the messages that were begun: 0 when the socket is full, the
  /// subject paused this client, or `messages_max` is less than one write. A write of more than
  /// `cut_to` messages is cut to that.
  std::size_t publish(std::uint64_t messages_max, std::uint64_t cut_to = UINT64_MAX);

  /// Bytes of one message on the wire.
  [[nodiscard]] std::size_t message_bytes() const { return block_.message_bytes(); }
  [[nodiscard]] std::size_t messages_a_write() const { return messages_a_write_; }
  [[nodiscard]] bool is_unbatched() const { return writing_ == Writing::unbatched; }
  [[nodiscard]] Client& client() { return from_; }

 private:
  Client& from_;
  const Writing writing_;
  MessageBlock block_;
  std::size_t messages_a_write_;
  std::size_t next_message_ = 0;  ///< of the block
};

/// Publishes in a window, so that nobody is measured while it drops: at most 2 MiB are under way,
/// or 128 KiB a recipient where that is more; less where warm_up() found the subject too slow for
/// it. Of unbatched messages at most 64 a recipient are: where a subject that was not scheduled for
/// a moment finds many of them at once, its cost says nothing about one. Counts what was sent to
/// how many, and what became of it.
class Flood {
 public:
  /// `recipients_a_message`: copies that the subject makes of each message.
  Flood(Engine& engine, std::vector<Publisher> publishers, std::size_t recipients_a_message);

  /// One turn: each publisher writes once if the window lets it, then every ready client is read
  /// once. Waits at most `patience` where nothing could be written. Returns messages settled.
  std::uint64_t turn(std::chrono::nanoseconds patience);
  /// Rounds that grow as long as the subject is quick to deliver them, then turns for `duration`;
  /// reads the rest.
  void warm_up(std::chrono::nanoseconds duration);
  /// Turns until `duration` is over.
  void run_for(std::chrono::nanoseconds duration);
  /// Reads until all is settled. What does not come in the engine's patience counts as lost.
  void drain();

  /// Deliveries that were asked for and are settled. Those of other messages that turn() settled
  /// are taken out.
  void forget_settled(std::uint64_t foreign) { settled_ -= foreign; }
  [[nodiscard]] std::uint64_t expected() const { return expected_; }
  [[nodiscard]] std::uint64_t missing() const { return missing_; }
  /// The longest time within run_for() without a write, since this was asked last.
  [[nodiscard]] std::chrono::nanoseconds take_longest_pause() {
    return std::exchange(longest_pause_, std::chrono::nanoseconds(0));
  }
  /// At most so many bytes are under way: for recipients whose queue drops what does not fit.
  void set_window(std::size_t bytes) { window_bytes_ = bytes; }

 private:
  bool publish();
  void settle(std::uint64_t count);
  /// Messages that may be under way.
  [[nodiscard]] std::uint64_t window() const;
  /// For which it has room.
  [[nodiscard]] std::uint64_t messages_allowed() const;

  Engine& engine_;
  std::vector<Publisher> publishers_;
  std::size_t recipients_a_message_;
  const std::size_t message_bytes_;
  std::size_t window_bytes_;
  const bool is_unbatched_;
  std::uint64_t messages_max_ = UINT64_MAX;  ///< under way, and in one write
  std::uint64_t expected_ = 0;               ///< deliveries
  std::uint64_t settled_ = 0;                ///< deliveries
  std::uint64_t missing_ = 0;                ///< deliveries given up
  Clock::time_point last_write_;
  std::chrono::nanoseconds longest_pause_{0};
};

}  // namespace gimnet::perf
