#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

namespace CLI {
class App;
}

namespace gimnet::tool {

enum class CtlAction : std::uint8_t { connections, routes, kick, reassign, drain, reload, log };

/// The words that name the actions.
inline constexpr std::array<std::string_view, 7> kCtlActions{
    "connections", "routes", "kick", "reassign", "drain", "reload", "log"};

/// The task of `gimnet ctl`. Thread safety: immutable once read.
struct CtlOptions {
  CtlAction action = CtlAction::connections;
  std::string node;    ///< kick, reassign: name or id
  std::string new_id;  ///< reassign
  std::string reason;  ///< kick
  std::string level;   ///< log
};

/// Declares `ctl` and its actions; `options` outlives the parsing.
void add_ctl(CLI::App& app, CtlOptions& options);

}  // namespace gimnet::tool
