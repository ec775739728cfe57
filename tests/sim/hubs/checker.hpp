#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

namespace gimnet::sim::hubs {

/// The checkers. Each checker has a planted bug that it must find.
enum class Checker : std::uint8_t {
  never_back,    ///< no frame goes back to the hub that it came from
  hops,          ///< each frame says how many links it crossed, and crosses at most 31
  one_link,      ///< a frame for one node is on at most one link at a time
  right_node,    ///< a frame reaches the session that it was for, or nobody, and once at most
  bounded,       ///< records, links and queues are bounded
  answered,      ///< each request to another hub is answered, once
  joined,        ///< when the faults are over each link stands
  equal_tables,  ///< connected hubs know the same hubs, and have equal digests
  no_loop,       ///< the next hops lead to each hub, and nothing is dropped for its hops
  reachable,     ///< frames between all pairs arrive
  moves,         ///< a node that goes to another hub has its name there at once
  one_owner,     ///< of connected hubs one has a name, and all say so
  parents,       ///< a group of another hub comes from the next hop towards that hub
  subscribers,   ///< a new subscriber at any hub gets the last message, and those that follow, and
                 ///< counts at the provider
  acceptors,     ///< all hubs tell whether a service that accepts is away
  resumes,       ///< nobody stays paused or held
  ledgers,       ///< each hub's ledger is exact, and those of both ends of a link agree
};
inline constexpr std::array<std::string_view, 17> kCheckerNames = {
    "never_back", "hops",         "one_link",  "right_node", "bounded", "answered",
    "joined",     "equal_tables", "no_loop",   "reachable",  "moves",   "one_owner",
    "parents",    "subscribers",  "acceptors", "resumes",    "ledgers"};

/// Thrown by a checker: the world is broken and stops.
struct Broken {
  Checker checker{};
  std::string what;
};

[[noreturn]] inline void broken(Checker checker, std::string what) {
  throw Broken{checker, std::move(what)};
}

}  // namespace gimnet::sim::hubs
