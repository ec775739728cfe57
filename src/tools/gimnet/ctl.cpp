#include "tools/gimnet/ctl.hpp"

#include <CLI/CLI.hpp>
#include <charconv>
#include <optional>
#include <string>

#include "base/ids.hpp"
#include "tools/gimnet/command_options.hpp"
#include "tools/gimnet/hub_status.hpp"
#include "tools/gimnet/json_writer.hpp"
#include "tools/gimnet/session.hpp"
#include "tools/gimnet/table.hpp"

namespace gimnet::tool {
namespace {

constexpr const char* kCtlAbout = R"(Administer a hub.

Examples:
  gimnet ctl connections --json             who is connected where, and what waits for them
  gimnet --hub unix:/run/tcphub.sock ctl kick robot --reason "it stands in the way"
  gimnet --hub unix:/run/tcphub.sock ctl reassign 1.17 1.100
  gimnet --hub unix:/run/tcphub.sock ctl reload
  gimnet --hub unix:/run/tcphub.sock ctl log debug
  gimnet --hub unix:/run/tcphub.sock ctl link add tcp://127.0.0.1:7451 --name lab

Everybody may read. Changing needs the hub's Unix socket, as root or as the user that runs it.
)";

constexpr const char* kConnectionsAbout = R"(List who is connected where, and what waits for them.

Examples:
  gimnet ctl connections
  gimnet ctl connections --json | jq '.[] | select(.queued_bytes > 0)'
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

constexpr const char* kLinkAbout =
    R"(Add a link that the hub dials, remove one, or fix what its way costs. The hub forgets that when it ends.

Examples:
  gimnet --hub unix:/run/tcphub.sock ctl link add tcp://127.0.0.1:7451 --name lab --cost 20
  gimnet --hub unix:/run/tcphub.sock ctl link remove lab
  gimnet --hub unix:/run/tcphub.sock ctl link cost lab 50
  gimnet --hub unix:/run/tcphub.sock ctl link cost lab 0        measured again
)";

void add_link(CLI::App& link, CtlOptions& options) {
  link.add_option("change", options.change, "add, remove or cost; gimnet links lists links")
      ->required()
      ->check(CLI::IsMember({"add", "remove", "cost"}).description(""));
  link.add_option("link", options.link, "the URL to add, or the name of a link")
      ->required()
      ->check(not_empty());
  link.add_option("cost", options.cost, "of cost: 1 to 65535, or 0 for what is measured")
      ->check(CLI::Range(0, 65'535).description(""));
  link.add_option("--name", options.name, "of add: what people call it, default the URL")
      ->check(not_empty());
  link.add_option("--proxy", options.proxy,
                  "of add: http://[user:password@]host:port, which the hub is to dial through")
      ->check(not_empty());
  link.add_option("--cost", options.cost, "of add: 1 to 65535, default what is measured")
      ->check(CLI::Range(1, 65'535).description(""));
}

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
  add_link(add(ctl, options, kLinkAbout, CtlAction::link), options);
}

std::string link_fault(const CtlOptions& options) {
  if (options.action != CtlAction::link) return {};
  if (options.change == "cost" && !options.cost)
    return "cost is missing: 1 to 65535, or 0 for what is measured";
  if (options.change == "remove" && options.cost)
    return "a link that is removed has no cost: leave it out";
  for (const auto& [word, given] :
       {std::pair("--name", options.name), {"--proxy", options.proxy}}) {
    if (options.change != "add" && !given.empty())
      return std::string(word) + " is for a link that is added: leave it out";
  }
  return {};
}

namespace {

std::string json_of(const std::vector<HubChange>& changes) {
  JsonWriter json;
  json.begin_array();
  for (const HubChange& change : changes) {
    json.begin_object()
        .member("key", change.key)
        .member("from", change.from)
        .member("to", change.to);
    json.member("needs_restart", change.needs_restart).end_object();
  }
  return json.end_array().str() + "\n";
}

std::string text_of(const std::vector<HubChange>& changes) {
  if (changes.empty()) return "nothing changed\n";
  std::string text;
  for (const HubChange& change : changes) {
    text += change.key + ": " + change.from + " -> " + change.to +
            (change.needs_restart ? " (needs a restart)" : "") + "\n";
  }
  return text;
}

/// `7.17`, or `17` for the hub that `node` lives on.
std::optional<Peer> parse_new_id(const std::string& text, Peer node) {
  if (const auto id = Peer::parse(text)) return id;
  std::uint32_t index = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), index);
  if (error != std::errc{} || end != text.data() + text.size() || index > kIndexMask)
    return std::nullopt;
  return Peer{make_id<NodeId>(hub_of(NodeId{node.id}), index).value()};
}

/// The end of a command that only changes something.
ExitCode done(ToolSession& session, const Outcome<void>& outcome, const std::string& text) {
  if (!outcome) return session.fail(outcome.failure());
  if (session.options().json) {
    session.output().write("{\"done\":true}\n");
  } else {
    session.output().write(text + "\n");
  }
  return session.finish();
}

ExitCode connections(ToolSession& session) {
  const auto found = session.node().hub_connections();
  if (!found) return session.fail(found.failure());
  session.output().write(session.options().json ? tool::json_of(*found)
                                                : tool::text_of(*found, session.paint()));
  return session.finish();
}

ExitCode kick(ToolSession& session) {
  const CtlOptions& ctl = session.options().ctl;
  const auto peer = session.find(ctl.node);
  if (!peer) return session.code();
  const auto remark = session.node().kick(*peer, ctl.reason);
  if (!remark) return session.fail(remark.failure());
  if (!remark->empty()) say(*remark);
  return done(session, {}, "kicked " + peer->text());
}

ExitCode reassign(ToolSession& session) {
  const CtlOptions& ctl = session.options().ctl;
  const auto peer = session.find(ctl.node);
  if (!peer) return session.code();
  const auto new_id = parse_new_id(ctl.new_id, *peer);
  if (!new_id) {
    say("'" + ctl.new_id + "' is no id: write HUB.NUMBER, for example " + peer->text());
    return ExitCode::usage;
  }
  return done(session, session.node().reassign(*peer, *new_id),
              peer->text() + " is " + new_id->text() + " now");
}

ExitCode reload(ToolSession& session) {
  const auto changes = session.node().reload_hub();
  if (!changes) {
    // The configuration is wrong, not the command line.
    const bool wrong = changes.failure().status == Status::bad_argument;
    const ExitCode code = session.fail(changes.failure());
    return wrong && code == ExitCode::usage ? ExitCode::failed : code;
  }
  session.output().write(session.options().json ? json_of(*changes) : text_of(*changes));
  return session.finish();
}

ExitCode log(ToolSession& session) {
  const std::string& level = session.options().ctl.level;
  const auto before = session.node().set_hub_log_level(level);
  if (!before) {
    const ExitCode code = session.fail(before.failure());
    return before.failure().status == Status::bad_argument ? ExitCode::usage : code;
  }
  if (session.options().json) {
    JsonWriter json;
    session.output().write(json.begin_object()
                               .member("done", true)
                               .member("level", level)
                               .member("before", *before)
                               .end_object()
                               .str() +
                           "\n");
    return session.finish();
  }
  return done(session, {}, "log level " + level + ", before " + *before);
}

ExitCode link(ToolSession& session) {
  const CtlOptions& ctl = session.options().ctl;
  const std::uint16_t cost = ctl.cost.value_or(0);
  const Outcome<void> outcome =
      ctl.change == "add"      ? session.node().add_link(ctl.link, ctl.name, cost, ctl.proxy)
      : ctl.change == "remove" ? session.node().remove_link(ctl.link)
                               : session.node().set_link_cost(ctl.link, cost);
  const std::string removing =
      "removing " + ctl.link + ": it ends when it has carried what is under way";
  const std::string words = ctl.change == "add"      ? "dialling " + ctl.link
                            : ctl.change == "remove" ? removing
                            : cost == 0 ? "the cost of " + ctl.link + " is measured now"
                                        : ctl.link + " costs " + std::to_string(cost) + " now";
  return done(session, outcome, words);
}

bool only_reads(CtlAction action) { return action == CtlAction::connections; }

}  // namespace

ExitCode run_ctl(ToolSession& session) {
  const CtlAction action = session.options().ctl.action;
  NodeOptions how;
  how.administrator = !only_reads(action);
  // It asks once: coming back by itself would have it wait for a hub that it has just ended.
  how.reconnect = false;
  if (const auto ending = only_reads(action) ? session.join_to_look(how) : session.join(how)) {
    // At the default addresses too: the socket there is this user's own, who would have been let
    // in.
    if (*ending == ExitCode::denied && !session.hub().starts_with("unix:"))
      say("changing needs the hub's Unix socket: --hub unix:/PATH, as `tcphub` prints it");
    return *ending;
  }
  switch (action) {
    case CtlAction::connections:
      return connections(session);
    case CtlAction::link:
      return link(session);
    case CtlAction::kick:
      return kick(session);
    case CtlAction::reassign:
      return reassign(session);
    case CtlAction::drain:
      return done(session, session.node().drain_hub(), "draining");
    case CtlAction::reload:
      return reload(session);
    case CtlAction::log:
      return log(session);
  }
  return ExitCode::usage;
}

}  // namespace gimnet::tool
