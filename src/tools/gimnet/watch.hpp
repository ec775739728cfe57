#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "gimnet/gimi.hpp"
#include "tools/gimnet/table.hpp"

namespace gimnet::tool {

/// A look by this tool, which nobody looks for.
[[nodiscard]] bool is_tool(const NodeRecord& node);

/// Leaves out the comings and goings of this tool's own looks. Thread safety: one thread. Memory:
/// an id for each that is there.
class ToolFilter {
 public:
  /// Is the event of one of them?
  [[nodiscard]] bool hides(const WatchEvent& event);

 private:
  std::set<std::uint32_t> hidden_;  ///< the last event of a node tells no more than its id
};

/// To which hubs of the network there is a way. Thread safety: one thread. Memory: a record for
/// each hub.
class HubWays {
 public:
  /// Those to which a way came or went since the last call, among them new ones and those that are
  /// no longer listed; the first call tells of none.
  [[nodiscard]] std::vector<NetworkHub> take(const std::vector<NetworkHub>& hubs);
  /// As ToolSession::standing_of(), by the last call of take().
  [[nodiscard]] std::string_view standing_of(const NodeRecord& node) const;

 private:
  std::optional<std::map<std::uint32_t, NetworkHub>> known_;  ///< nothing: not asked yet
};

/// The last words of a watch about each node and service, so that a line can say what changed.
/// Thread safety: one thread. Memory: a record for each that is there.
class WatchMemory {
 public:
  /// To be told each event. Of one that is `changed`: what was different before, such as ", before:
  /// metadata x"; "" if nothing is known.
  [[nodiscard]] std::string take(const WatchEvent& event);

 private:
  std::map<std::uint32_t, NodeRecord> nodes_;
  std::map<std::string, ServiceRecord> services_;
};

/// Is it part of what was there before, not a change?
[[nodiscard]] bool is_snapshot(Change change);

/// An object and a newline. `now_ns`: wall_now_ns() when it came.
[[nodiscard]] std::string json_line(const WatchEvent& event, std::int64_t now_ns,
                                    const HubWays& ways = {});
/// A line for people, in local time; "" for what they need not see. `before`: of WatchMemory.
[[nodiscard]] std::string text_line(const WatchEvent& event, std::int64_t now_ns,
                                    Paint paint = Paint{}, const HubWays& ways = {},
                                    std::string_view before = {});
/// The same of a hub to which a way came or went.
[[nodiscard]] std::string json_line(const NetworkHub& hub, std::int64_t now_ns);
[[nodiscard]] std::string text_line(const NetworkHub& hub, std::int64_t now_ns,
                                    Paint paint = Paint{});

}  // namespace gimnet::tool
