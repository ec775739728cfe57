#include <cstdio>
#include <span>
#include <string>

#include "base/standard_streams.hpp"
#include "tools/demo/options.hpp"
#include "tools/demo/run.hpp"
#include "tools/demo/stop_signal.hpp"

int main(int count, char** words) {
  using namespace gimnet::demo;
  gimnet::hold_standard_descriptors();
  gimnet::have_failed_writes_told();
  const std::span<const char* const> all(words, static_cast<std::size_t>(count));
  const gimnet::Result<Options> options = parse_options(all.empty() ? all : all.subspan(1));
  if (!options) {
    (void)std::fprintf(stderr, "gimnet-demo: %s\n", options.error().sentence.c_str());
    return static_cast<int>(ExitCode::kUsage);
  }
  if (options->help) {
    return static_cast<int>(show(std::string(usage_text())) ? ExitCode::kGood : ExitCode::kLost);
  }
  // The viewer takes its time to let everything arrive, and then ends the others.
  constexpr unsigned kRobotPatience_s = 1;
  constexpr unsigned kViewerPatience_s = 20;
  remember_stop_signals(options->role == Role::kRobot ? kRobotPatience_s : kViewerPatience_s);
  return static_cast<int>(options->role == Role::kRobot ? run_robot(*options)
                                                        : run_viewer(*options));
}
