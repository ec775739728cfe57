#include "tools/gimnet/commands.hpp"
#include "tools/gimnet/printer.hpp"

namespace gimnet::tool {
namespace {

constexpr std::size_t kQueueMessages = 4096;

}  // namespace

ExitCode run_echo(Session& session) {
  const std::string& service = session.options().target;
  if (const auto ending = session.join({})) return *ending;
  const auto subscription = session.node().subscribe(service, {kQueueMessages, AtFullQueue::stop_reading});
  if (!subscription) return session.fail(subscription.failure());
  if (!subscription->exists()) say("nobody provides " + service + " yet; waiting for it");
  return print_messages(session, subscription->queue());
}

}  // namespace gimnet::tool
