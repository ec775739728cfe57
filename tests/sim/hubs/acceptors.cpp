#include <string>

#include "base/ids.hpp"
#include "tests/sim/hubs/world.hpp"

// Looks at a world that was left alone: services that accept, and those who send there.

namespace gimnet::sim::hubs {
namespace {

/// All is told after 1 s and the way at the latest.
constexpr std::uint64_t kToldMs = 1'200;
constexpr std::uint64_t kBreakMs = 50;
/// A node that is back offers its service by WELCOME, or not at all.
constexpr std::uint64_t kOffersMs = 100;

}  // namespace

/// The operators follow all services that accept. Then each node loses its connection once.
void Settled::check_acceptors() {
  const milliseconds way{kToldMs + kSlowestMs * distance_.size()};
  for (SimNode& person : world_.operators_) {
    if (!person.is_up()) continue;
    for (const SimNode& node : world_.nodes_)
      if (node.is_up() && !node.name().empty()) person.follow(node.name());
  }
  world_.run_until(world_.now() + way);
  compare_acceptors("first");
  for (SimNode& node : world_.nodes_)
    if (node.is_up() && node.accepts()) node.lose_connection(world_.now(), kBreakMs);
  world_.run_until(world_.now() + milliseconds{kBreakMs + kOffersMs} + way);
  compare_acceptors("after a break");
}

/// One that was not offered again is away until its hub forgets it.
void Settled::compare_acceptors(const char* when) {
  for (const SimNode& person : world_.operators_) {
    for (const SimNode& node : world_.nodes_) {
      const int links = distance_[person.plan().hub][node.at()];
      if (!person.is_up() || !node.is_up() || links < 0) continue;
      const proto::ns::ServiceState* const told = person.followed(node.name());
      if (node.name().empty() || told == nullptr) continue;
      const bool has_it = told->provider == node.id();
      if (has_it && told->away) world_.census_.note(Event::service_away);
      if (has_it ? told->away != node.accepts() : !node.accepts()) continue;
      broken(Checker::acceptors, std::string{when} + " hub " + std::to_string(person.plan().hub) +
                                     " says of the service of " + node.name() + " that " +
                                     (has_it ? "its node is away, or not" : "nobody accepts it"));
    }
  }
}

}  // namespace gimnet::sim::hubs
