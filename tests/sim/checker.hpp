#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace gimnet::sim {

/// The properties that are checked. Each has a planted bug that it must find
/// (tests/planted/bugs.toml).
enum class Checker : std::uint8_t {
  names,  ///< a name has one owner, who keeps it as long as the protocol says
  ids,  ///< no id of a node or group is given out while its former holder may come back or be sent
        ///< to
  tokens,         ///< a session goes to the one who shows its token, and to nobody else
  right_session,  ///< no frame reaches another session than the one that it was for
  node_table,     ///< the table of nodes says what the sessions say
  group_table,    ///< the table of groups says what the subscriptions say
  order,          ///< tables are published before the answer leaves
  answers,        ///< each request is answered, once, with what is true, or its connection ended
  events,  ///< subscribers and providers are told what changed, in time, with the right counts
  told,    ///< a subscriber knows of a group before anything of it comes, also where a connection
           ///< broke
  limits,  ///< the limits hold, and nothing is refused below them
  grace,   ///< a session lasts while it is connected and through its grace time, and no longer
  seam,    ///< the commands to a shard make sense to it
  pace,  ///< each subscriber gets what its terms allow, no more and no later, in order; the shards
         ///< know these
  credit,    ///< a window is never exceeded, and nothing that is lost narrows it for good
  retained,  ///< a new subscriber begins with the last message of a retained service
  drain,  ///< a hub that drains lets nobody in, has everybody told to go, and ends when they have
          ///< gone
  convergence,  ///< when the faults stop everybody is served
};
inline constexpr std::array<std::string_view, 18> kCheckerNames = {
    "names", "ids",     "tokens", "right_session", "node_table", "group_table",
    "order", "answers", "events", "told",          "limits",     "grace",
    "seam",  "pace",    "credit", "retained",      "drain",      "convergence"};
[[nodiscard]] inline std::string_view name_of(Checker checker) {
  return kCheckerNames[static_cast<std::size_t>(checker)];
}

/// Thrown by a checker: the world is broken and stops.
struct Broken {
  Checker checker{};
  std::string sentence;
};

inline void require(bool holds, Checker checker, const char* sentence) {
  if (!holds) throw Broken{checker, sentence};
}
[[noreturn]] inline void broken(Checker checker, std::string sentence) {
  throw Broken{checker, std::move(sentence)};
}

}  // namespace gimnet::sim
