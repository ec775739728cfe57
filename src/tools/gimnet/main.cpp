#include <cstdio>
#include <exception>
#include <variant>

#include "base/standard_streams.hpp"
#include "tools/gimnet/command_line.hpp"
#include "tools/gimnet/network.hpp"
#include "tools/gimnet/session.hpp"

namespace {

using namespace gimnet::tool;

ExitCode run_command(ToolSession& session) {
  switch (session.options().command) {
    case Command::send:
      return run_send(session);
    case Command::recv:
      return run_recv(session);
    case Command::pub:
      return run_pub(session);
    case Command::echo:
      return run_echo(session);
    case Command::request:
      return run_request(session);
    case Command::answer:
      return run_answer(session);
    case Command::hz:
      return run_hz(session);
    case Command::bw:
      return run_bw(session);
    case Command::ping:
      return run_ping(session);
    case Command::trace:
      return run_trace(session);
    case Command::nodes:
      return run_nodes(session);
    case Command::services:
      return run_services(session);
    case Command::watch:
      return run_watch(session);
    case Command::status:
      return run_status(session);
    case Command::hubs:
      return run_hubs(session);
    case Command::links:
      return run_links(session);
    case Command::routes:
      return run_routes(session);
    case Command::graph:
      return run_graph(session);
    case Command::ctl:
      return run_ctl(session);
    case Command::impair:
      break;
  }
  return ExitCode::usage;
}

ExitCode run(const ToolOptions& options) {
  StopSignal stop;
  if (options.command == Command::impair) return run_impair(options.impair, stop);
  ToolSession session(options, stop);
  const ExitCode code = run_command(session);
  session.output().flush();
  stop.leave(static_cast<int>(code));
  return code;
}

/// Help goes to standard output, what is wrong to standard error.
ExitCode show(const CommandEnding& ending) {
  if (ending.code != ExitCode::done) {
    std::fputs(ending.text.c_str(), stderr);
    return ending.code;
  }
  Output output;
  output.write(ending.text);
  return output.finish() ? ExitCode::done : ExitCode::failed;
}

}  // namespace

int main(int argc, char** argv) {
  gimnet::hold_standard_descriptors();
  gimnet::have_failed_writes_told();
  try {
    const auto parsed = parse_command_line(argc, argv);
    if (const auto* ending = std::get_if<CommandEnding>(&parsed)) {
      return static_cast<int>(show(*ending));
    }
    return static_cast<int>(run(std::get<ToolOptions>(parsed)));
  } catch (const std::exception& error) {
    std::fprintf(stderr, "gimnet: cannot go on: %s\n", error.what());
    return static_cast<int>(ExitCode::failed);
  }
}
