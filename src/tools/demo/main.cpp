#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "base/standard_streams.hpp"
#include "tools/demo/carmen_log.hpp"
#include "tools/demo/labs.hpp"
#include "tools/demo/log_player.hpp"
#include "tools/demo/node_port.hpp"
#include "tools/demo/options.hpp"
#include "tools/demo/own_network.hpp"
#include "tools/demo/robot.hpp"
#include "tools/demo/simulated_robot.hpp"
#include "tools/demo/stop_signal.hpp"
#include "tools/demo/viewer.hpp"
#include "tools/gimnet/exit_code.hpp"

namespace gimnet::demo {
namespace {

using tool::ExitCode;

constexpr Extent kPicture{80, 24};
/// Without a terminal there is nobody to end the laboratories.
constexpr double kLabsSeconds = 20.0;

// fmt::print() throws where nobody reads any more (a closed terminal, `| head`); that must not keep
// the children alive.
void say(const std::string& text) {
  (void)std::fwrite(text.data(), 1, text.size(), stderr);
  (void)std::fflush(stderr);
}

void complain(const Error& error) { say(fmt::format("gimnet-demo: {}\n", error.sentence)); }

// Says which lines of a log are left out; a recording that is cut or damaged in one place still
// plays.
void say_skipped(const RobotLog& log) {
  if (!log.cut.empty()) say(fmt::format("gimnet-demo: {}\n", log.cut));
  if (log.skipped == 0) return;
  say(fmt::format("gimnet-demo: skipped {} {} of the log that cannot be read; the first is {}\n",
                  log.skipped, log.skipped == 1 ? "line" : "lines", log.first_skipped));
}

Result<Robot::SourceMaker> source_maker(const DemoOptions& options) {
  if (!options.log.empty()) {
    Result<RobotLog> log = load_robot_log(options.log);
    if (!log) return log.error();
    say_skipped(*log);
    const std::string name = std::filesystem::path(options.log).filename().string();
    return Robot::SourceMaker(
        [log = std::move(*log), name, speed = options.speed](std::int64_t now_ns) {
          return std::make_unique<LogPlayer>(log, LogPlayer::Start{name, speed, now_ns});
        });
  }
  Result<WorldMap> map =
      options.map.empty() ? Result<WorldMap>(WorldMap::hall()) : WorldMap::load(options.map);
  if (!map) return map.error();
  return Robot::SourceMaker([map = std::move(*map)](std::int64_t now_ns) {
    return std::make_unique<SimulatedRobot>(map, now_ns);
  });
}

// The style of the screen: by choice of the user, or of the environment. A terminal of which that
// does not tell the encoding reads UTF-8.
TerminalStyle style_for(const DemoOptions& options, const Terminal* terminal) {
  TerminalStyle style;
  style.colours = terminal == nullptr ? ColourDepth::kNone : colours_of_environment();
  style.utf8 = options.glyphs == Glyphs::kAuto ? utf8_of_environment().value_or(terminal != nullptr)
                                               : options.glyphs == Glyphs::kUtf8;
  return style;
}

// A demo that was told to run for a time, or has no keyboard, drives by itself.
bool drives_itself(const DemoOptions& options, const Terminal* terminal) {
  return options.seconds.has_value() || terminal == nullptr;
}

// Checks what the robot's process would only find later, where the sentence would be harder to
// find.
std::optional<Error> unusable_input(const DemoOptions& options) {
  if (options.role != DemoRole::kAll) return std::nullopt;
  const Result<Robot::SourceMaker> maker = source_maker(options);
  return maker ? std::nullopt : std::optional(maker.error());
}

// Writes to standard output. False: it cannot be written, which standard error was told. A reader
// that went away has enough, and is no failure.
[[nodiscard]] bool show(const std::string& text) {
  const std::string why = write_standard_output(text);
  if (!why.empty()) complain(Error{fmt::format("cannot write to standard output: {}", why)});
  return why.empty();
}

[[nodiscard]] bool show_summary(const Viewer& viewer, const TerminalStyle& style,
                                bool interactive) {
  const std::string picture = interactive ? "" : viewer.last_picture(kPicture) + "\n";
  return show(picture + summary_text(viewer.monitor(), viewer.record(), style.utf8));
}

// Runs the robot's process until it is told to end.
ExitCode run_robot(const DemoOptions& options) {
  Result<Robot::SourceMaker> maker = source_maker(options);
  if (!maker) {
    complain(maker.error());
    return ExitCode::usage;
  }
  Result<std::unique_ptr<NodePort>> port = connect_robot({options.hub_url, options.robot});
  if (!port) {
    complain(port.error());
    return ExitCode::no_connection;
  }
  // The robot runs whether the line could be written or not.
  (void)show("ready\n");
  Robot robot(**port, std::move(*maker));
  while (stop_signal() == 0) {
    if (const std::optional<Error> error = robot.step()) {
      complain(*error);
      return ExitCode::failed;
    }
  }
  return ExitCode::done;
}

// Runs the viewer's process, with an own hub and robot unless the role is kView; prints the summary
// at the end.
ExitCode run_viewer(const DemoOptions& options) {
  if (const std::optional<Error> error = unusable_input(options)) {
    complain(*error);
    return ExitCode::usage;
  }
  std::optional<OwnNetwork> network;
  ViewerOptions viewing;
  viewing.hub_url = options.hub_url;
  viewing.own_robot = options.role == DemoRole::kAll;
  if (viewing.own_robot) {
    Result<OwnNetwork> started = OwnNetwork::start(options, folder_of_this_program());
    if (!started) {
      complain(started.error());
      return ExitCode::no_connection;
    }
    network.emplace(std::move(*started));
    viewing.hub_url = network->hub_url();
    viewing.trouble = [&network](std::int64_t wait_ns) { return network->trouble(wait_ns); };
  }
  Result<std::unique_ptr<NodePort>> port = connect_viewer({viewing.hub_url, options.robot});
  if (!port) {
    complain(port.error());
    return ExitCode::no_connection;
  }

  std::unique_ptr<Terminal> terminal = Terminal::open({STDIN_FILENO, STDOUT_FILENO});
  const bool interactive = terminal != nullptr;
  viewing.seconds = options.seconds;
  viewing.autopilot = drives_itself(options, terminal.get());
  viewing.style = style_for(options, terminal.get());
  if (!interactive) viewing.on_progress = [](const std::string& line) { say(line + "\n"); };
  const TerminalStyle style = viewing.style;
  Viewer viewer(**port, terminal.get(), std::move(viewing));
  const std::optional<Error> error = viewer.run();
  terminal.reset();
  if (error) complain(*error);
  if (error && !viewer.monitor().info()) return ExitCode::failed;
  if (!show_summary(viewer, style, interactive)) return ExitCode::failed;
  return complaints_about(viewer.monitor(), viewer.record()).empty() ? ExitCode::done
                                                                     : ExitCode::failed;
}

// Runs the two laboratories; prints the summary at the end.
ExitCode run_laboratories(const DemoOptions& options) {
  std::unique_ptr<Terminal> terminal = Terminal::open({STDIN_FILENO, STDOUT_FILENO});
  LabsOptions labs{folder_of_this_program(),
                   options.seconds,
                   terminal.get(),
                   style_for(options, terminal.get()),
                   {}};
  if (terminal == nullptr) {
    if (!labs.seconds) labs.seconds = kLabsSeconds;
    labs.on_progress = [](const std::string& line) { say(line + "\n"); };
  }
  const Result<LabsRecord> record = run_labs(labs);
  terminal.reset();
  if (!record) {
    complain(record.error());
    return ExitCode::no_connection;
  }
  if (!show(summary_text(*record))) return ExitCode::failed;
  return complaints_about(*record).empty() ? ExitCode::done : ExitCode::failed;
}

}  // namespace
}  // namespace gimnet::demo

int main(int count, char** words) {
  using namespace gimnet::demo;
  gimnet::hold_standard_descriptors();
  gimnet::have_failed_writes_told();
  const std::span<const char* const> all(words, static_cast<std::size_t>(count));
  const gimnet::Result<DemoOptions> options = parse_options(all.empty() ? all : all.subspan(1));
  if (!options) {
    (void)std::fprintf(stderr, "gimnet-demo: %s\n", options.error().sentence.c_str());
    return static_cast<int>(ExitCode::usage);
  }
  if (options->help) {
    return static_cast<int>(show(std::string(usage_text())) ? ExitCode::done : ExitCode::failed);
  }
  // The viewer takes its time to let everything arrive, and then ends the others.
  constexpr unsigned kRobotPatience_s = 1;
  constexpr unsigned kViewerPatience_s = 20;
  remember_stop_signals(options->role == DemoRole::kRobot ? kRobotPatience_s : kViewerPatience_s);
  if (options->labs) return static_cast<int>(run_laboratories(*options));
  return static_cast<int>(options->role == DemoRole::kRobot ? run_robot(*options)
                                                            : run_viewer(*options));
}
