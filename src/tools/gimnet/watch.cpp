#include <utility>

#include "base/clock.hpp"
#include "tools/gimnet/bounds.hpp"
#include "tools/gimnet/commands.hpp"
#include "tools/gimnet/connection_watch.hpp"
#include "tools/gimnet/watch_report.hpp"

namespace gimnet::tool {
namespace {

/// There is nothing to print, and there may not be for long.
void say_that_it_waits(const Options& options) {
  say("nothing " + (options.target.empty() ? "is there" : "matches " + options.target) +
      " yet; waiting");
}

/// Prints what is to be seen. True: it was an event that the user asked for.
bool print(Session& session, ToolFilter& filter, const WatchEvent& event) {
  const Options& options = session.options();
  if (!options.all && filter.hides(event)) return false;
  if (options.changes && is_snapshot(event.change)) return false;
  const std::int64_t now_ns = wall_now_ns();
  session.output().write(options.json ? json_line(event, now_ns)
                                      : text_line(event, now_ns, session.paint()));
  return event.node.has_value() || event.service.has_value();
}

}  // namespace

ExitCode run_watch(Session& session) {
  if (const auto ending = session.join({})) return *ending;
  const auto watch = session.node().watch(session.options().target);
  if (!watch) return session.fail(watch.failure());
  const Bounds bounds(session.options());
  ConnectionWatch connection(session.node());
  ToolFilter filter;
  const Options& options = session.options();
  std::uint64_t events = 0;
  bool told = false;
  while (!bounds.enough(events) && !bounds.late() && session.output().ok()) {
    auto event = watch->receive(kNoWait);
    if (!event && event.is(Status::timeout)) {
      session.output().flush();
      event = watch->receive(bounds.wait(ConnectionWatch::kPeriod));
    }
    connection.look_now_and_then(steady_now_ns());
    if (!event && event.is(Status::timeout)) continue;
    if (!event) {
      connection.look_at_end();
      return session.fail(event.failure());
    }
    if (print(session, filter, *event)) ++events;
    if (event->change == Change::snapshot_ends && events == 0 && !options.changes &&
        !std::exchange(told, true)) {
      say_that_it_waits(options);
    }
    if (event->change != Change::ended) continue;
    session.output().flush();
    return session.fail({Status::refused, "the hub ended the watch: " + event->why});
  }
  return session.finish_stream(bounds, events);
}

}  // namespace gimnet::tool
