#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "base/result.hpp"
#include "tools/demo/driver.hpp"
#include "tools/demo/monitor.hpp"
#include "tools/demo/node_port.hpp"
#include "tools/demo/screen.hpp"
#include "tools/demo/summary.hpp"
#include "tools/demo/terminal.hpp"

namespace gimnet::demo {

/// The viewer's options.
struct ViewerOptions {
  /// Ends after so many seconds from the first odometry or scan.
  std::optional<double> seconds;
  /// A course drives from the beginning.
  bool autopilot = false;
  /// The robot is this demo's own: it began with this viewer, and it is told to finish.
  bool own_robot = true;
  std::string hub_url;
  TerminalStyle style;
  /// Is it to end now? May be empty.
  std::function<bool()> over;
  /// Answers what happened to the other processes, and waits for it at most so long; may be empty.
  std::function<std::optional<Error>(std::int64_t wait_ns)> trouble;
  /// Losses of messages and commands for which it answers true are as they should be; may be empty.
  StreamRecord::Excuse excuse;
  /// Gets what was heard so far, after each look at the network; may be empty.
  std::function<void(const Monitor&, std::int64_t now_ns)> on_look;
  /// The laboratories as they are now; empty: there are none.
  std::function<LabsView(std::int64_t now_ns)> labs;
  /// Takes a line now and then where there is no terminal; may be empty.
  std::function<void(const std::string&)> on_progress;
};

/// The viewer and driver: listens, draws, steers, until the time is over, the user quits, or a
/// signal comes; then makes sure that everything has arrived. Thread safety: one thread. Ownership:
/// none of port and terminal.
class Viewer {
 public:
  static constexpr std::int64_t kFramePeriod_ns = 80'000'000;
  static constexpr std::int64_t kCountersPeriod_ns = 1'000'000'000;
  /// The last messages may take this long.
  static constexpr std::int64_t kFinish_ns = 3'000'000'000;
  /// A broken connection waits this long to be explained by the end of a process.
  static constexpr std::int64_t kWhy_ns = 10'000'000'000;
  /// The robot must be heard within this time.
  static constexpr std::int64_t kFirstSign_ns = 15'000'000'000;

  /// `terminal` may be null.
  Viewer(NodePort& port, Terminal* terminal, ViewerOptions options);

  /// Runs to the end. Errors: the connection or another process ended, or the robot was never
  /// heard.
  [[nodiscard]] std::optional<Error> run();

  [[nodiscard]] const Monitor& monitor() const { return monitor_; }
  [[nodiscard]] RunRecord record() const;
  /// The last picture, for a plain terminal or a file.
  [[nodiscard]] std::string last_picture(Extent extent) const;

 private:
  [[nodiscard]] std::optional<Error> step(std::int64_t wait_ns);
  [[nodiscard]] std::optional<Error> watch();
  [[nodiscard]] std::optional<Error> finish();
  [[nodiscard]] bool time_is_over() const;
  [[nodiscard]] bool everything_arrived() const;
  void take(const NodePort::Event& event);
  void take_keys(std::int64_t now_ns);
  void press(Keystroke key, std::int64_t now_ns);
  void draw(std::int64_t now_ns);
  void report_progress(std::int64_t now_ns);
  [[nodiscard]] ScreenState screen_state(std::int64_t now_ns) const;

  NodePort& port_;
  Terminal* terminal_;
  ViewerOptions options_;
  Monitor monitor_;
  Driver driver_;
  AnsiWriter writer_;
  MapChoice map_;
  bool help_ = false;
  bool quit_ = false;
  bool finished_ = false;
  std::string broken_;
  std::int64_t first_heard_ns_ = 0;
  std::int64_t ended_ns_ = 0;
  std::int64_t next_frame_ns_ = 0;
  std::int64_t next_counters_ns_ = 0;
  std::int64_t next_progress_ns_ = 0;
  std::uint64_t commands_ = 0;
  std::uint64_t commands_excused_ = 0;
};

}  // namespace gimnet::demo
