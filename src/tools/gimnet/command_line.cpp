#include "tools/gimnet/command_line.hpp"

#include <CLI/CLI.hpp>
#include <array>
#include <map>
#include <span>
#include <string_view>
#include <utility>

#include "base/suggest.hpp"

namespace gimnet::tool {
namespace {

constexpr std::array<std::pair<std::string_view, Command>, 8> kCommands{{{"send", Command::send},
                                                                         {"recv", Command::recv},
                                                                         {"pub", Command::pub},
                                                                         {"echo", Command::echo},
                                                                         {"ping", Command::ping},
                                                                         {"nodes", Command::nodes},
                                                                         {"services", Command::services},
                                                                         {"status", Command::status}}};

constexpr const char* kAbout = R"(Talk to a GIMnet hub from the command line.

Examples:
  gimnet recv --name B --raw                print what is sent to B
  gimnet send B < lines                     send each line to B, and wait until B has them all
  gimnet pub robot/odom < lines             publish each line as robot/odom
  gimnet echo robot/odom -n 10              print ten messages of robot/odom
  gimnet ping B                             how far away is B?
  gimnet nodes; gimnet services; gimnet status --json

Data goes to standard output, words to standard error. Ends with 0 done, 1 failed, 2 wrong arguments, 3 cannot connect,
4 not found, 5 no answer or no data in time, 6 denied, 7 the hub has another version, 130 and 143 by signal.
)";

constexpr const char* kSendAbout = R"(Send messages to a node, and wait until it has acknowledged them all.

Examples:
  gimnet send B < lines                     a message for each line
  gimnet send 7.17 --file map.png           one message
  echo stop | gimnet send B --lane real_time

At most 64 messages wait for their acknowledgement. Ends with 0 when all are acknowledged, else with 1 and the reason.
)";

constexpr const char* kRecvAbout = R"(Print the messages that are sent to this node.

Examples:
  gimnet recv --name B                      one line a message, with its sender
  gimnet recv --name B -n 1000 --raw        the payload and a newline each, and end after 1,000
  gimnet recv --name B --json | jq .text

Overwrites nothing: when the reader of its output is slow, it stops reading from the hub.
)";

constexpr const char* kPubAbout = R"(Publish each line of standard input as a service.

Examples:
  gimnet pub robot/odom < lines             the node robot provides the service odom
  gimnet pub robot/odom --rate 40 --wait 1 < lines
  gimnet pub robot/pose --delivery latest < lines
)";

constexpr const char* kEchoAbout = R"(Print the messages of a service. It need not exist yet.

Examples:
  gimnet echo robot/odom
  gimnet echo robot/odom -n 10 --raw
  gimnet echo robot/odom --json | jq .age_us
)";

constexpr const char* kPingAbout = R"(Measure the way to a node and back. Its library answers by itself.

Examples:
  gimnet ping B
  gimnet ping 7.17 -c 1000 -i 0.001 --json
)";

constexpr const char* kNodesAbout = R"(List the nodes.

Examples:
  gimnet nodes
  gimnet nodes 'robot/**'
  gimnet --json nodes | jq '.[].name'
)";

constexpr const char* kServicesAbout = R"(List the services.

Examples:
  gimnet services
  gimnet services 'robot/*' --json
)";

constexpr const char* kStatusAbout = R"(Show what the hub counted.

Examples:
  gimnet status
  gimnet status --json | jq .ledger
)";

void add_key(CLI::App& command, Options& options) {
  command.add_option("--type", options.key.type, "message type, default 0");
  command.add_option("--instance", options.key.instance, "instance of the type, default 0");
}

void add_lane(CLI::App& command, Options& options) {
  static const std::map<std::string, Lane> kLanes{
      {"real_time", Lane::real_time}, {"normal", Lane::normal}, {"bulk", Lane::bulk}, {"background", Lane::background}};
  command.add_option("--lane", options.lane, "real_time, normal, bulk or background")
      ->transform(CLI::CheckedTransformer(kLanes).description(""));
}

void add_printing(CLI::App& command, Options& options) {
  command.add_option("-n,--count", options.count, "end after that many messages");
  command.add_flag("--raw", options.raw, "print each payload as it is, and a newline");
  add_key(command, options);
}

void add_send(CLI::App& app, Options& options) {
  CLI::App& send = *app.add_subcommand("send", kSendAbout);
  send.add_option("node", options.target, "name or id of the receiver")->required();
  send.add_option("--file", options.file, "send this file as one message");
  send.add_option("--name", options.name, "name of this node, default none");
  add_lane(send, options);
  add_key(send, options);
}

void add_recv(CLI::App& app, Options& options) {
  CLI::App& recv = *app.add_subcommand("recv", kRecvAbout);
  recv.add_option("--name", options.name, "name of this node, to which others send")->required();
  recv.add_option("--max-size", options.bytes_max, "largest message taken, in bytes, default 64 MiB")
      ->check(CLI::Range(std::size_t{1}, std::size_t{1} << 30));
  add_printing(recv, options);
}

void add_pub(CLI::App& app, Options& options) {
  static const std::map<std::string, Delivery> kDeliveries{{"stream", Delivery::stream}, {"latest", Delivery::latest}};
  CLI::App& pub = *app.add_subcommand("pub", kPubAbout);
  pub.add_option("service", options.target, "full name: node/service")->required();
  pub.add_option("--name", options.name, "name of this node, default: the service's name up to its last /");
  pub.add_option("--delivery", options.delivery, "stream: all messages; latest: only the newest waits")
      ->transform(CLI::CheckedTransformer(kDeliveries).description(""));
  pub.add_option("--rate", options.rate_hz, "lines a second, default as fast as possible")
      ->check(CLI::Range(0.001, 1e6));
  pub.add_option("--wait", options.subscribers, "wait until that many have subscribed");
  add_lane(pub, options);
  add_key(pub, options);
}

void add_ping(CLI::App& app, Options& options) {
  CLI::App& ping = *app.add_subcommand("ping", kPingAbout);
  ping.add_option("node", options.target, "name or id")->required();
  ping.add_option("-c,--count", options.pings, "how many, default 10")->check(CLI::Range(1, 1'000'000'000));
  ping.add_option("-i,--interval", options.interval_s, "seconds between two, default 0.1")
      ->check(CLI::Range(0.0, 3600.0));
  ping.add_option("-W,--timeout", options.timeout_s, "seconds after which one is lost, default 1")
      ->check(CLI::Range(0.001, 3600.0));
  add_lane(ping, options);
}

void add_commands(CLI::App& app, Options& options) {
  app.add_option("--hub", options.hub, "tcp://host:port or unix:/path, default GIMNET_HUB, else this machine's hub");
  app.add_flag("--json", options.json, "print JSON");
  app.add_option("--shard", options.shard, "")->group("");
  app.set_version_flag("--version", "gimnet " GIMNET_VERSION);
  add_send(app, options);
  add_recv(app, options);
  add_pub(app, options);
  CLI::App& echo = *app.add_subcommand("echo", kEchoAbout);
  echo.add_option("service", options.target, "full name: node/service")->required();
  add_printing(echo, options);
  add_ping(app, options);
  CLI::App& nodes = *app.add_subcommand("nodes", kNodesAbout);
  nodes.add_option("pattern", options.target, "`*` is one part of a name, `**` any number");
  CLI::App& services = *app.add_subcommand("services", kServicesAbout);
  services.add_option("pattern", options.target, "`*` is one part of a name, `**` any number");
  app.add_subcommand("status", kStatusAbout);
  for (CLI::App* command : app.get_subcommands({})) command->fallthrough();
}

/// The first word that is neither an option nor the value of one that stands before commands.
std::string_view command_word(std::span<const char* const> arguments) {
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    const std::string_view word = arguments[i];
    if (word == "--hub" || word == "--shard") {
      ++i;
    } else if (!word.starts_with('-')) {
      return word;
    }
  }
  return {};
}

CommandLineEnding wrong(const std::string& sentence, std::string_view help) {
  return {ExitCode::usage, "gimnet: " + sentence + "\nSee gimnet " + std::string(help) + "--help.\n"};
}

std::variant<Options, CommandLineEnding> unknown_command(std::string_view word) {
  std::array<std::string_view, kCommands.size()> names;
  for (std::size_t i = 0; i < names.size(); ++i) names[i] = kCommands[i].first;
  return wrong("there is no command '" + std::string(word) + "'" + did_you_mean(word, names), "");
}

/// What CLI11 cannot know.
std::string contradiction(const Options& options) {
  if (options.json && options.raw) return "--json and --raw contradict each other: give one of them";
  if (options.command == Command::pub) {
    const auto slash = options.target.rfind('/');
    if (slash == std::string::npos || slash == 0 || slash + 1 == options.target.size()) {
      return "'" + options.target + "' is no full name of a service: write NODE/SERVICE";
    }
    const std::string node = options.target.substr(0, slash);
    if (!options.name.empty() && options.name != node) {
      return "the service " + options.target + " belongs to the node " + node + ", not to " + options.name +
             ": leave --name out";
    }
  }
  return {};
}

}  // namespace

std::variant<Options, CommandLineEnding> parse_command_line(int argc, const char* const* argv) {
  Options options;
  CLI::App app(kAbout, "gimnet");
  add_commands(app, options);
  const std::span arguments(argv, static_cast<std::size_t>(argc));
  const std::string_view word = command_word(arguments.subspan(arguments.empty() ? 0 : 1));
  const auto* known = kCommands.begin();
  while (known != kCommands.end() && known->first != word) ++known;
  if (!word.empty() && known == kCommands.end()) return unknown_command(word);
  const std::string help = word.empty() ? "" : std::string(word) + " ";
  try {
    app.parse(argc, argv);
  } catch (const CLI::CallForHelp&) {
    const auto chosen = app.get_subcommands();
    return CommandLineEnding{ExitCode::done, (chosen.empty() ? &app : chosen.front())->help()};
  } catch (const CLI::CallForVersion& version) {
    return CommandLineEnding{ExitCode::done, std::string(version.what()) + "\n"};
  } catch (const CLI::ParseError& error) {
    return wrong(error.what(), help);
  }
  if (word.empty()) return CommandLineEnding{ExitCode::usage, app.help()};
  options.command = known->second;
  if (const std::string sentence = contradiction(options); !sentence.empty()) return wrong(sentence, help);
  return options;
}

}  // namespace gimnet::tool
