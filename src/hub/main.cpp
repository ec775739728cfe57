#include <sys/resource.h>
#include <unistd.h>

#include <cstdio>
#include <exception>
#include <optional>
#include <string>
#include <variant>

#include "base/standard_streams.hpp"
#include "hub/config/options.hpp"
#include "hub/hub.hpp"

namespace {

using namespace gimnet;

/// Every connection is a descriptor: as many as this user may have.
void raise_descriptor_limit() {
  rlimit limit{};
  if (::getrlimit(RLIMIT_NOFILE, &limit) != 0) return;
  limit.rlim_cur = limit.rlim_max;
  static_cast<void>(::setrlimit(RLIMIT_NOFILE, &limit));
}

/// Answers go to standard output, complaints to standard error.
int show(const hub::CommandLineEnding& ending) {
  if (ending.exit_code != 0) {
    std::fputs(ending.text.c_str(), stderr);
    return ending.exit_code;
  }
  const std::string why = write_standard_output(ending.text);
  if (why.empty()) return 0;
  std::fprintf(stderr, "tcphub: cannot write to standard output: %s\n", why.c_str());
  return 1;
}

/// Nodes do not wait for somebody who reads this.
void tell_ready(const hub::Hub& hub) {
  const std::string ready = "ready " + hub.addresses() + "\n";
  if (const std::string why = write_standard_output(ready, WhenFull::fail); !why.empty())
    log_warning("the ready line cannot be written to standard output: " + why);
}

int run(const hub::CommandLine& line) {
  const hub::HubOptions& options = line.configuration.options;
  set_log_level(options.log_level);
  set_log_rates({options.limits.log_lines_per_s, options.limits.peer_log_lines_per_s});
  for (const std::string& warning : line.warnings) log_warning(warning);
  raise_descriptor_limit();
  std::optional<hub::Hub::Succession> former;
  do {
    const auto hub = hub::Hub::start(options, line.sources, former);
    if (!hub) {
      std::fprintf(stderr, "tcphub: %s\n", hub.error().sentence.c_str());
      return 1;
    }
    if (!former) tell_ready(**hub);
    former = (*hub)->run();
  } while (former);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  hold_standard_descriptors();
  have_failed_writes_told();
  try {
    const auto parsed = hub::parse_command_line(argc, argv, ::environ);
    if (const auto* ending = std::get_if<hub::CommandLineEnding>(&parsed)) return show(*ending);
    return run(std::get<hub::CommandLine>(parsed));
  } catch (const std::exception& error) {
    // Start-up only: out of memory or descriptors before anything was served.
    std::fprintf(stderr, "tcphub: cannot run: %s\n", error.what());
    return 1;
  }
}
