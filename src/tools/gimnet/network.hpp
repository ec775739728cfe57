#pragma once

#include <string>
#include <vector>

#include "gimnet/gimi/records.hpp"
#include "tools/gimnet/exit_code.hpp"
#include "tools/gimnet/json_writer.hpp"
#include "tools/gimnet/table.hpp"

// The network of hubs as it is printed. Thread safety: pure functions.

namespace gimnet::tool {

/// For an answer of a hub. The own hub answers `not_found` for one that is silent for 5 s; before
/// that the time is over, which is the same for all commands.
inline constexpr Timeout kHubPatience{4'900};

class ToolSession;

/// A list of objects and a newline, or a table.
[[nodiscard]] std::string json_of(const std::vector<NetworkHub>& hubs);
[[nodiscard]] std::string text_of(const std::vector<NetworkHub>& hubs, Paint paint = Paint{});
void write(JsonWriter& json, const std::vector<LinkRecord>& links);
[[nodiscard]] std::string json_of(const std::vector<LinkRecord>& links);
[[nodiscard]] std::string text_of(const std::vector<LinkRecord>& links, Paint paint = Paint{});

/// The rest of a way, as one hub on it knows it.
struct RouteStep {
  std::uint32_t hub_id = 0;
  std::string name;
  std::uint32_t next_hop = 0;
  std::uint32_t distance = 0;
  std::uint32_t cost = 0;  ///< 0 with a distance: not measured yet
};
[[nodiscard]] std::string json_of(const std::vector<RouteStep>& way);
[[nodiscard]] std::string text_of(const std::vector<RouteStep>& way);

/// Two hubs that are linked, with the higher of the costs that both tell.
struct GraphEdge {
  std::uint32_t a = 0;
  std::uint32_t b = 0;     ///< larger than a
  std::uint32_t cost = 0;  ///< 0: not measured yet
  bool agreed = false;     ///< both tell of it; else it carries nothing
};
/// Ascending.
[[nodiscard]] std::vector<GraphEdge> edges_of(const std::vector<NetworkHub>& hubs);
[[nodiscard]] std::string graph_json(const std::vector<NetworkHub>& hubs);
/// In the language of Graphviz.
[[nodiscard]] std::string graph_dot(const std::vector<NetworkHub>& hubs);
/// A line for each hub: `7 lab -- 8 (10), 9 (60)`.
[[nodiscard]] std::string graph_ascii(const std::vector<NetworkHub>& hubs);

[[nodiscard]] ExitCode run_hubs(ToolSession& session);
[[nodiscard]] ExitCode run_links(ToolSession& session);
[[nodiscard]] ExitCode run_routes(ToolSession& session);
[[nodiscard]] ExitCode run_graph(ToolSession& session);

}  // namespace gimnet::tool
