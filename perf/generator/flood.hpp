#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "generator/engine.hpp"
#include "generator/publisher.hpp"

namespace gimnet::perf {

/// Publishes in a window, so that nobody is measured while it drops: at most 2 MiB are under way,
/// or 128 KiB a recipient where that is more; less where warm_up() found the subject too slow for
/// it. Of unbatched messages at most 64 a recipient are: where a subject that was not scheduled for
/// a moment finds many of them at once, its cost says nothing about one. Counts what was sent to
/// how many, and what became of it.
class Flood {
 public:
  /// `recipients_a_message`: copies that the subject makes of each message. `bytes_a_second` 0: no
  /// pace.
  Flood(Engine& engine, std::vector<Publisher> publishers, std::size_t recipients_a_message,
        double bytes_a_second = 0);

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
  const double bytes_a_second_;
  const std::size_t message_bytes_;
  std::size_t window_bytes_;
  const bool is_unbatched_;
  std::uint64_t messages_max_ = UINT64_MAX;  ///< under way, and in one write
  Clock::time_point begin_;
  std::uint64_t begun_bytes_ = 0;  ///< for the pace
  std::uint64_t expected_ = 0;     ///< deliveries
  std::uint64_t settled_ = 0;      ///< deliveries
  std::uint64_t missing_ = 0;      ///< deliveries given up
  Clock::time_point last_write_;
  std::chrono::nanoseconds longest_pause_{0};
};

}  // namespace gimnet::perf
