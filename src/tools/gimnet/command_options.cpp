#include "tools/gimnet/command_options.hpp"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <cstdint>
#include <map>
#include <sstream>
#include <string>
#include <string_view>
#include <type_traits>

#include "base/ids.hpp"

namespace gimnet::tool {
namespace {

class HelpFormat final : public CLI::Formatter {
 public:
  std::string make_subcommand(const CLI::App* command) const override {
    const std::string about = command->get_description();
    std::ostringstream line;
    CLI::detail::format_help(line, command->get_display_name(true),
                             about.substr(0, about.find('\n')), get_column_width());
    return line.str();
  }

  std::string make_option_opts(const CLI::Option* option) const override {
    const std::string type = option->get_type_name();  // "UINT:UINT in [1 - 64]"; "" of a flag
    // An argument that the command line takes in a certain place says its own name.
    if (type.empty() || option->get_positional()) return "";
    const bool whole = type.starts_with("UINT") || type.starts_with("INT");
    const char* what = whole ? " N" : type.starts_with("FLOAT") ? " X" : " WORD";
    return option->get_required() ? std::string(what) + " (required)" : what;
  }
};

}  // namespace

std::shared_ptr<CLI::FormatterBase> help_format() { return std::make_shared<HelpFormat>(); }

namespace {

/// A decimal number from `least` to `most`, of a whole type without a point. CLI11 by itself takes
/// "nan", "0x10" and " 5", and "010" for 8: what it is left to read is written anew.
template <class Number>
CLI::Validator within(Number least, Number most) {
  return CLI::Validator(
      [least, most](std::string& word) {
        Number number{};
        const char* const end = word.data() + word.size();
        const auto [read, error] = std::from_chars(word.data(), end, number);
        const bool fits = error == std::errc{} && read == end && number >= least && number <= most;
        if (!fits) return std::string("no number within the bounds");
        if constexpr (std::is_integral_v<Number>) word = std::to_string(number);
        return std::string();
      },
      "");
}

void add_key(CLI::App& command, ToolOptions& options) {
  command
      .add_option("--type", options.key.type,
                  "message type, a whole number up to 4294967295, default 0")
      ->transform(within(std::uint32_t{0}, UINT32_MAX));
  command
      .add_option("--instance", options.key.instance,
                  "instance of the type, a whole number up to 4294967295, default 0")
      ->transform(within(std::uint32_t{0}, UINT32_MAX));
}

// The most that any hub can be told to take (docs/operations.md); what this one takes it says
// itself.
constexpr std::uint32_t kSyncWindowMax = 1'000'000;
constexpr std::uint32_t kDepthMax = 4'096;

void add_lane(CLI::App& command, ToolOptions& options) {
  static const std::map<std::string, Lane> kLanes{{"real_time", Lane::real_time},
                                                  {"normal", Lane::normal},
                                                  {"bulk", Lane::bulk},
                                                  {"background", Lane::background}};
  command.add_option("--lane", options.lane, "real_time, normal, bulk or background")
      ->transform(CLI::CheckedTransformer(kLanes).description(""));
}

void add_bounds(CLI::App& command, ToolOptions& options) {
  command
      .add_option("-n,--count", options.count, "end after that many messages or events, 1 or more")
      ->transform(within(std::uint64_t{1}, std::uint64_t{1} << 62));
  command
      .add_option("--seconds", options.seconds, "end after that many seconds, 0.001 to 1000000000")
      ->transform(within(0.001, 1e9));
}

void add_printing(CLI::App& command, ToolOptions& options) {
  add_bounds(command, options);
  command.add_flag("--raw", options.raw, "print each payload as it is, and a newline");
  add_key(command, options);
}

void add_send(CLI::App& app, ToolOptions& options) {
  CLI::App& send = *app.add_subcommand("send", help::kSendAbout);
  send.add_option("node", options.target, "name or id of the receiver, or node/service")
      ->required()
      ->check(not_empty());
  send.add_option("--file", options.file, "send this file as one message")->check(not_empty());
  send.add_option("--name", options.name, "name of this node, default none")->check(not_empty());
  add_lane(send, options);
  add_key(send, options);
}

void add_recv(CLI::App& app, ToolOptions& options) {
  CLI::App& recv = *app.add_subcommand("recv", help::kRecvAbout);
  recv.add_option("--name", options.name, "name of this node, to which others send")
      ->required()
      ->check(not_empty());
  recv.add_option("--max-size", options.bytes_max,
                  "largest message taken, in bytes, 1 to 1073741824, default 67108864")
      ->transform(within(std::size_t{1}, std::size_t{1} << 30));
  add_printing(recv, options);
}

/// `stream`, `latest`, `sync` or `sync:N`.
void read_delivery(const std::string& word, ToolOptions& options) {
  constexpr std::string_view kSync = "sync:";
  if (word == "stream" || word == "latest" || word == "sync") {
    options.delivery = word == "stream"   ? Delivery::stream
                       : word == "latest" ? Delivery::latest
                                          : Delivery::sync;
    return;
  }
  options.delivery = Delivery::sync;
  const char* end = word.data() + word.size();
  const char* begin = word.data() + std::min(kSync.size(), word.size());
  const auto [read, error] = std::from_chars(begin, end, options.window);
  if (word.starts_with(kSync) && error == std::errc{} && read == end && options.window != 0 &&
      options.window <= kSyncWindowMax)
    return;
  throw CLI::ValidationError(
      "--delivery", "'" + word + "' is none of stream, latest, sync and sync:N, with N from 1 to " +
                        std::to_string(kSyncWindowMax));
}

void add_pub(CLI::App& app, ToolOptions& options) {
  CLI::App& pub = *app.add_subcommand("pub", help::kPubAbout);
  pub.add_option("service", options.target, "full name: node/service")
      ->required()
      ->check(not_empty());
  pub.add_option("--name", options.name,
                 "name of this node, default: the service's name up to its last /")
      ->check(not_empty());
  pub.add_option_function<std::string>(
      "--delivery", [&options](const std::string& word) { read_delivery(word, options); },
      "stream: all messages; latest: only the newest waits; sync:N: at most N, 1 to 1000000, that "
      "a subscriber has not "
      "taken; sync: as sync:1");
  pub.add_flag("--retain", options.retain,
               "the hub keeps the last line and gives it to each new subscriber first");
  pub.add_flag("--stay", options.stay,
               "go on after the input has ended, until Ctrl-C: the service stays");
  pub.add_option("--rate", options.rate_hz,
                 "lines a second, 0.001 to 1000000, default as fast as possible")
      ->transform(within(0.001, 1e6));
  pub.add_option("--wait", options.subscribers,
                 "wait until so many have subscribed, 0 to 1000000, default 0")
      ->transform(within(std::size_t{0}, std::size_t{1'000'000}));
  add_lane(pub, options);
  add_key(pub, options);
}

void add_echo(CLI::App& app, ToolOptions& options) {
  CLI::App& echo = *app.add_subcommand("echo", help::kEchoAbout);
  echo.add_option("service", options.target,
                  "full name, node/service, or a pattern: `*` one part, `**` any number")
      ->required()
      ->check(not_empty());
  echo.add_option("--window", options.wish.window,
                  "untaken messages at most, from 1; of delivery sync:N fewer than N")
      ->transform(within(std::uint32_t{1}, kSyncWindowMax));
  echo.add_option(
          "--depth", options.wish.depth,
          "newest messages that the hub holds meanwhile, 1 to 4096, of most hubs to 64, default 1")
      ->transform(within(std::uint32_t{1}, kDepthMax));
  echo.add_option("--rate", options.wish.rate_hz,
                  "messages a second at most, 0.001 to 1000, default all")
      ->transform(within(0.001, 1e3));
  add_printing(echo, options);
}

void add_requests(CLI::App& app, ToolOptions& options) {
  CLI::App& request = *app.add_subcommand("request", help::kRequestAbout);
  request.add_option("service", options.target, "full name: node/service")
      ->required()
      ->check(not_empty());
  request.add_option("text", options.text, "what to ask, default nothing");
  request.add_option("--file", options.file, "ask with the content of this file")
      ->check(not_empty());
  request
      .add_option("--timeout", options.timeout_s,
                  "seconds to wait for the answer, 0.001 to 3600, default 1")
      ->transform(within(0.001, 3600.0));
  request.add_flag("--raw", options.raw, "print the answer as it is, and a newline");
  add_lane(request, options);
  CLI::App& answer = *app.add_subcommand("answer", help::kAnswerAbout);
  answer.add_option("service", options.target, "full name: node/service")
      ->required()
      ->check(not_empty());
  answer.add_flag("--echo", options.echo_back, "answer with what was asked")->required();
  answer.add_option("-n,--count", options.count, "end after that many requests, 1 or more")
      ->transform(within(std::uint64_t{1}, std::uint64_t{1} << 62));
}

void add_meter(CLI::App& app, const char* name, const char* about, ToolOptions& options) {
  CLI::App& meter = *app.add_subcommand(name, about);
  meter
      .add_option("service", options.target,
                  "full name, node/service, or a pattern: `*` one part, `**` any number")
      ->required()
      ->check(not_empty());
  meter
      .add_option("--window", options.window_s,
                  "seconds that a line speaks of, 0.001 to 3600, default 5")
      ->transform(within(0.001, 3600.0));
  add_bounds(meter, options);
}

void add_pings(CLI::App& app, const char* name, const char* about, ToolOptions& options) {
  CLI::App& ping = *app.add_subcommand(name, about);
  ping.add_option("node", options.target, "name or id")->required()->check(not_empty());
  ping.add_option("-c,--count", options.pings, "how many, 1 to 1000000000, default 10")
      ->transform(within(std::uint64_t{1}, std::uint64_t{1'000'000'000}));
  ping.add_option("-i,--interval", options.interval_s,
                  "seconds between two, 0 to 3600, default 0.1")
      ->transform(within(0.0, 3600.0));
  ping.add_option("-W,--timeout", options.timeout_s,
                  "seconds after which one is lost, 0.001 to 3600, default 1")
      ->transform(within(0.001, 3600.0));
  add_lane(ping, options);
}

void add_lists(CLI::App& app, ToolOptions& options) {
  CLI::App& nodes = *app.add_subcommand("nodes", help::kNodesAbout);
  nodes.add_option("pattern", options.target,
                   "`*` is one part of a name, `**` any number; or an id, 7.17");
  nodes.add_flag("--all", options.all, "those of gimnet itself, too");
  CLI::App& services = *app.add_subcommand("services", help::kServicesAbout);
  services.add_option("pattern", options.target, "`*` is one part of a name, `**` any number");
  CLI::App& watch = *app.add_subcommand("watch", help::kWatchAbout);
  watch.add_option("pattern", options.target, "`*` is one part of a name, `**` any number");
  watch.add_flag("--all", options.all, "those of gimnet itself, too");
  watch.add_flag("--changes", options.changes, "only what changes, not what is there already");
  add_bounds(watch, options);
}

void add_hub_id(CLI::App& command, ToolOptions& options) {
  command
      .add_option("--hub-id", options.hub_id,
                  "the hub of the network to ask, 1 to 4094, default the one that it connects to")
      ->transform(within(std::uint32_t{1}, std::uint32_t{kHubIdMax}));
}

void add_network(CLI::App& app, ToolOptions& options) {
  CLI::App& status = *app.add_subcommand("status", help::kStatusAbout);
  status.add_flag("--all", options.all, "ledger and links of each hub of the network");
  add_hub_id(status, options);
  add_hub_id(*app.add_subcommand("hubs", help::kHubsAbout), options);
  add_hub_id(*app.add_subcommand("links", help::kLinksAbout), options);
  CLI::App& routes = *app.add_subcommand("routes", help::kRoutesAbout);
  routes.add_option("node", options.target, "name or id")->required()->check(not_empty());
  add_hub_id(routes, options);
  CLI::App& graph = *app.add_subcommand("graph", help::kGraphAbout);
  graph.add_flag("--ascii", options.ascii, "a line for each hub; the default");
  graph.add_flag("--dot", options.dot, "in the language of Graphviz");
  add_hub_id(graph, options);
}

}  // namespace

const CLI::Validator& not_empty() {
  static const CLI::Validator kNotEmpty(
      [](std::string& word) { return word.empty() ? "empty" : std::string(); }, "");
  return kNotEmpty;
}

void add_commands(CLI::App& app, ToolOptions& options) {
  static const std::map<std::string, Colour> kColours{
      {"auto", Colour::automatic}, {"always", Colour::always}, {"never", Colour::never}};
  app.formatter(help_format());  // before the commands, which take it over
  app.add_option("--hub", options.hub,
                 "tcp://host:port or unix:/path, or several with commas, default GIMNET_HUB, else "
                 "this machine's hub")
      ->check(not_empty());
  app.add_option("--proxy", options.proxy,
                 "http://[user:password@]host:port to reach a tcp:// hub through, default "
                 "GIMNET_PROXY")
      ->check(not_empty());
  app.add_flag("--json", options.json,
               "print JSON: one document, or an object a line where there is no end");
  app.add_option("--color", options.colour,
                 "auto (on a terminal, unless NO_COLOR is set), always or never")
      ->transform(CLI::CheckedTransformer(kColours).description(""));
  app.add_option("--shard", options.shard, "the hub's shard on which to live, 0 to 255")
      ->group("")
      ->transform(within(0U, 255U));
  app.set_version_flag("--version", "gimnet " GIMNET_VERSION);
  add_send(app, options);
  add_recv(app, options);
  add_pub(app, options);
  add_echo(app, options);
  add_requests(app, options);
  add_meter(app, "hz", help::kHzAbout, options);
  add_meter(app, "bw", help::kBwAbout, options);
  add_pings(app, "ping", help::kPingAbout, options);
  add_pings(app, "trace", help::kTraceAbout, options);
  add_lists(app, options);
  add_network(app, options);
  add_impair(app, options.impair);
  add_ctl(app, options.ctl);
  app.require_subcommand(
      0, 1);  // the name of a second one is an argument: nodes may be called as commands are
  for (CLI::App* command : app.get_subcommands({})) {
    command->fallthrough();
    command->footer(help::kEverywhere);
  }
}

}  // namespace gimnet::tool
