#include "tools/gimnet/ctl_options.hpp"

#include <CLI/CLI.hpp>

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

CLI::App& add(CLI::App& ctl, CtlOptions& options, const char* name, const char* about, CtlAction action) {
  CLI::App& command = *ctl.add_subcommand(name, about);
  command.callback([&options, action] { options.action = action; });
  command.fallthrough();
  return command;
}

}  // namespace

void add_ctl(CLI::App& app, CtlOptions& options) {
  CLI::App& ctl = *app.add_subcommand("ctl", kCtlAbout);
  ctl.require_subcommand(1);
  add(ctl, options, "connections", "Lists who is connected where", CtlAction::connections);
  add(ctl, options, "routes", "Lists the hubs that this one knows", CtlAction::routes);
  CLI::App& kick = add(ctl, options, "kick", "Ends the session of a node, for good", CtlAction::kick);
  kick.add_option("node", options.node, "name or id")->required();
  kick.add_option("--reason", options.reason, "told to the node and to the log");
  CLI::App& reassign = add(ctl, options, "reassign", "Gives a node another id", CtlAction::reassign);
  reassign.add_option("node", options.node, "name or id")->required();
  reassign.add_option("new_id", options.new_id, "a free id of the same hub: HUB.NUMBER or NUMBER")->required();
  add(ctl, options, "drain", "Ends the hub once what waits is written", CtlAction::drain);
  add(ctl, options, "reload", "Has the hub read its configuration again", CtlAction::reload);
  CLI::App& log = add(ctl, options, "log", "Sets the hub's log level until the next reload", CtlAction::log);
  log.add_option("level", options.level, "error, warning, info, debug or off")->required();
}

}  // namespace gimnet::tool
