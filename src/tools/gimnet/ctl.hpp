#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace CLI {
class App;
}

namespace gimnet::tool {

enum class CtlAction : std::uint8_t { connections, kick, reassign, drain, reload, log, link };

/// The words that name the actions.
inline constexpr std::array<std::string_view, 7> kCtlActions{
    "connections", "kick", "reassign", "drain", "reload", "log", "link"};

/// The task of `gimnet ctl`. Thread safety: immutable once read.
struct CtlOptions {
  CtlAction action = CtlAction::connections;
  std::string node;                     ///< kick, reassign: name or id
  std::string new_id;                   ///< reassign
  std::string reason;                   ///< kick
  std::string level;                    ///< log
  std::string change;                   ///< link: add, remove or cost
  std::string link;                     ///< link: the URL to add, or a name
  std::string name;                     ///< link add
  std::string proxy;                    ///< link add
  std::optional<std::uint16_t> cost{};  ///< link add and link cost; 0: measured
};

/// The fault in the words of `gimnet ctl link`, or "".
[[nodiscard]] std::string link_fault(const CtlOptions& options);

/// Declares `ctl` and its actions; `options` outlives the parsing.
void add_ctl(CLI::App& app, CtlOptions& options);

}  // namespace gimnet::tool
