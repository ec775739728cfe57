#include "tools/gimnet/commands.hpp"
#include "tools/gimnet/printer.hpp"

namespace gimnet::tool {
namespace {

/// Messages that wait in this process for the reader of its output.
constexpr std::size_t kQueueMessages = 4096;

}  // namespace

ExitCode run_recv(Session& session) {
  const Options& options = session.options();
  NodeOptions how;
  how.name = options.name;
  how.message_bytes_max = options.bytes_max;
  if (const auto ending = session.join(how)) return *ending;
  const Queue queue =
      session.node().queue(options.key, {kQueueMessages, AtFullQueue::stop_reading});
  say("receiving as " + options.name + " (" + session.node().peer().text() + ")");
  return print_messages(session, [&](Timeout timeout) { return queue.receive(timeout); });
}

}  // namespace gimnet::tool
