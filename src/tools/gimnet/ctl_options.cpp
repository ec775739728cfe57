#include "tools/gimnet/ctl_options.hpp"

#include <CLI/CLI.hpp>

#include "tools/gimnet/command_help.hpp"
#include "tools/gimnet/command_options.hpp"

namespace gimnet::tool {
namespace {

constexpr const char* kCtlAbout = R"(Administer a hub.

Examples:
  gimnet ctl connections --json             who is connected where, and what waits for them
  gimnet --hub unix:/run/tcphub.sock ctl kick robot --reason "it stands in the way"
  gimnet --hub unix:/run/tcphub.sock ctl reassign 1.17 1.100
  gimnet --hub unix:/run/tcphub.sock ctl reload
  gimnet --hub unix:/run/tcphub.sock ctl log debug

Everybody may read. Changing needs the hub's Unix socket, as root or as the user that runs it.
)";

constexpr const char* kConnectionsAbout = R"(List who is connected where, and what waits for them.

Examples:
  gimnet ctl connections
  gimnet ctl connections --json | jq '.[] | select(.queued_bytes > 0)'
)";

constexpr const char* kRoutesAbout = R"(List the hubs that this one knows.

Examples:
  gimnet ctl routes
)";

constexpr const char* kKickAbout =
    R"(End the session of a node. It is told so, and does not come back by itself; its token is worth nothing any more.

Examples:
  gimnet --hub unix:/run/tcphub.sock ctl kick robot --reason "it stands in the way"
  gimnet --hub unix:/run/tcphub.sock ctl kick 1.17
)";

constexpr const char* kReassignAbout =
    R"(Give a node another id of its hub. It goes on under it; what is sent to the old one is reported `renumbered`.

Examples:
  gimnet --hub unix:/run/tcphub.sock ctl reassign robot 1.100
)";

constexpr const char* kDrainAbout =
    R"(End the hub: it writes what waits, says goodbye to everybody, and ends.

Examples:
  gimnet --hub unix:/run/tcphub.sock ctl drain
)";

constexpr const char* kReloadAbout =
    R"(Have the hub read its configuration again, whole or not at all, and tell what changed.

Examples:
  gimnet --hub unix:/run/tcphub.sock ctl reload
)";

constexpr const char* kLogAbout = R"(Set the hub's log level until the next reload.

Examples:
  gimnet --hub unix:/run/tcphub.sock ctl log debug
)";

CLI::App& add(CLI::App& ctl, CtlOptions& options, const char* about, CtlAction action) {
  const std::string_view name = kCtlActions[static_cast<std::size_t>(action)];
  CLI::App& command = *ctl.add_subcommand(std::string(name), about);
  command.callback([&options, action] { options.action = action; });
  command.fallthrough();
  command.footer(help::kEverywhere);
  return command;
}

}  // namespace

void add_ctl(CLI::App& app, CtlOptions& options) {
  CLI::App& ctl = *app.add_subcommand("ctl", kCtlAbout);
  ctl.require_subcommand(1);
  add(ctl, options, kConnectionsAbout, CtlAction::connections);
  add(ctl, options, kRoutesAbout, CtlAction::routes);
  CLI::App& kick = add(ctl, options, kKickAbout, CtlAction::kick);
  kick.add_option("node", options.node, "name or id")->required()->check(not_empty());
  kick.add_option("--reason", options.reason, "told to the node and to the log, at most 256 bytes");
  CLI::App& reassign = add(ctl, options, kReassignAbout, CtlAction::reassign);
  reassign.add_option("node", options.node, "name or id")->required()->check(not_empty());
  reassign.add_option("new_id", options.new_id, "a free id of the same hub: HUB.NUMBER or NUMBER")
      ->required()
      ->check(not_empty());
  add(ctl, options, kDrainAbout, CtlAction::drain);
  add(ctl, options, kReloadAbout, CtlAction::reload);
  CLI::App& log = add(ctl, options, kLogAbout, CtlAction::log);
  log.add_option("level", options.level, "error, warning, info, debug or off")
      ->required()
      ->check(not_empty());
}

}  // namespace gimnet::tool
