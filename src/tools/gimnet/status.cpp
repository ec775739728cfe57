#include "tools/gimnet/commands.hpp"
#include "tools/gimnet/hub_status.hpp"

namespace gimnet::tool {

ExitCode run_status(Session& session) {
  if (const auto ending = session.join_to_look()) return *ending;
  const auto hub = session.node().hub();
  if (!hub) return session.fail(hub.failure());
  const auto connections = session.node().hub_connections();
  if (!connections) return session.fail(connections.failure());
  const auto shards = session.node().hub_counters();
  if (!shards) return session.fail(shards.failure());
  const HubStatus status{*hub, *shards, *connections};
  session.output().write(session.options().json ? json_of(status)
                                                : text_of(status, session.paint()));
  return session.finish();
}

}  // namespace gimnet::tool
