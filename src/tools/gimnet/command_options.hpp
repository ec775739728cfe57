#pragma once

#include <array>
#include <memory>
#include <string_view>
#include <utility>

#include "tools/gimnet/options.hpp"

namespace CLI {
class FormatterBase;
}

namespace gimnet::tool {

/// The layout of help: commands in a line each, and options without the types and ranges that
/// their descriptions say in words. Thread safety: immutable.
[[nodiscard]] std::shared_ptr<CLI::FormatterBase> help_format();

}  // namespace gimnet::tool

namespace CLI {

class App;
class Validator;

}  // namespace CLI

// The beginnings of `gimnet --help` and `gimnet COMMAND --help`: the purpose, and examples.

namespace gimnet::tool::help {

inline constexpr const char* kAbout = R"(Talk to a GIMnet hub from the command line.

Examples:
  gimnet recv --name B --raw                print what is sent to B
  gimnet send B < lines                     send each line to B, and wait until B has them all
  gimnet pub robot/odom < lines             publish each line as robot/odom
  gimnet echo robot/odom -n 10              print ten messages of robot/odom
  gimnet request calc/add '1 2'             ask a service, and print its answer
  gimnet hz 'robot/*'                       how often do its services send, and how evenly?
  gimnet ping B                             how far away is B?
  gimnet watch                              who comes and goes?
  gimnet nodes; gimnet services; gimnet status --json
  gimnet hubs; gimnet links; gimnet graph   the network of hubs
  gimnet impair LISTEN TARGET --delay 80ms  relay as a bad network does
  gimnet ctl connections                    administer the hub: kick, reassign, drain, reload, log

Data goes to standard output, words to standard error. Ends with 0 done, 1 failed, 2 wrong arguments, 3 cannot connect,
4 not found, 5 no answer or no data in time, 6 denied, 7 the hub has another version, 129, 130 and 143 by signal.
)";

/// The end of each command's help.
inline constexpr const char* kEverywhere =
    "With every command: --hub URL, --proxy URL, --json, --color WORD; `gimnet --help` explains "
    "them.";

inline constexpr const char* kSendAbout =
    R"(Send messages to a node, or to a service that accepts data, and wait until all are acknowledged.

Examples:
  gimnet send B < lines                     a message for each line
  gimnet send robot/drive < lines           the same to the service drive of the node robot
  gimnet send 7.17 --file map.png           one message
  echo stop | gimnet send B --lane real_time

At most 64 messages wait for their acknowledgement. Ends with 0 when all are acknowledged; stops at the first loss and says
why: ends with 4 if nobody is there, otherwise with 1.
)";

inline constexpr const char* kRecvAbout = R"(Print the messages that are sent to this node.

Examples:
  gimnet recv --name B                      one line a message, with its sender
  gimnet recv --name B -n 1000 --raw        the payload and a newline each, and end after 1,000
  gimnet recv --name B --json | jq .text

Overwrites nothing: when the reader of its output is slow, it stops reading from the hub.
)";

inline constexpr const char* kPubAbout = R"(Publish each line of standard input as a service.

Examples:
  gimnet pub robot/odom < lines             the node robot provides the service odom
  gimnet pub robot/odom --rate 40 --wait 1 < lines
  gimnet pub robot/pose --delivery latest < lines
  gimnet pub robot/camera --delivery sync:2 < lines
  gimnet pub robot/map --retain --stay < lines
                                            who comes later, while it stays, gets the last line
)";

inline constexpr const char* kEchoAbout =
    R"(Print the messages of services. A service need not exist yet.

Examples:
  gimnet echo robot/odom
  gimnet echo 'robot/*' --seconds 10        all services of robot, those that come meanwhile too
  gimnet echo robot/odom -n 10 --raw
  gimnet echo robot/odom --rate 2           the newest, twice a second
  gimnet echo robot/odom --json | jq .age_us

By full name nothing is missed of a service that begins later; by pattern what is published before the hub has told of
it: `gimnet pub --wait 1` waits for that.
)";

inline constexpr const char* kRequestAbout =
    R"(Ask a service that answers requests, and print its answer.

Examples:
  gimnet request calc/add '1 2'             a request of that text
  gimnet request map/part --file area.bin --raw > part.bin
  gimnet request calc/add '1 2' --timeout 0.5 --json | jq .text

Without a text or a file the request is empty. Ends with 1 if the other program answers with an error, whose words it
prints, 4 if nobody answers that service, 5 if there was no answer in time.
)";

inline constexpr const char* kAnswerAbout = R"(Answer the requests to a service with what they say.

Examples:
  gimnet answer B/mirror --echo             the node B answers mirror, until Ctrl-C
  gimnet answer B/mirror --echo -n 10       and ends after ten requests
)";

inline constexpr const char* kHzAbout = R"(Measure how often services send, and how evenly.

Examples:
  gimnet hz robot/odom
  gimnet hz '**' --seconds 10               all services, those that come meanwhile too
  gimnet hz robot/odom --window 1 --json | jq .rate_hz

Once a second: messages a second, the shortest, longest and mean gap between two and its standard deviation over the
last --window seconds, and how many did not come. At the end the same over all of it.
)";

inline constexpr const char* kBwAbout =
    R"(Measure how many bytes services send, and how large their messages are.

Examples:
  gimnet bw robot/camera
  gimnet bw '**' --seconds 10 --json

Payload bytes, as the publisher gave them; once a second over the last --window seconds, at the end over all of it.
)";

inline constexpr const char* kPingAbout =
    R"(Measure the way to a node and back. Its library answers by itself.

Examples:
  gimnet ping B
  gimnet ping 7.17 -c 1000 -i 0.001 --json
)";

inline constexpr const char* kTraceAbout =
    R"(Measure where a message spends its time: in each hub on the way back from a node, and on the links between them.

Examples:
  gimnet trace robot
  gimnet trace 7.17 -c 100 -i 0.01 --json | jq '.hops[].delay_us'

A message tells of 8 hubs at most. Clocks of hubs differ: those of their links say by how much, and how exactly.
)";

inline constexpr const char* kNodesAbout = R"(List the nodes.

Examples:
  gimnet nodes
  gimnet nodes 'robot/**'                   only those whose name matches
  gimnet nodes --all                        those of gimnet, too
  gimnet --json nodes | jq '.[].name'
)";

inline constexpr const char* kServicesAbout = R"(List the services.

Examples:
  gimnet services
  gimnet services 'robot/*' --json
)";

inline constexpr const char* kWatchAbout =
    R"(Tell which nodes and services are there, and who comes and goes from then on.

Examples:
  gimnet watch
  gimnet watch 'robot/**' --changes         only what changes
  gimnet watch robot -n 1 --seconds 10      wait for robot: ends with 0 when it is there, else with 5
  gimnet watch --json | jq .change
)";

inline constexpr const char* kStatusAbout = R"(Show what the hub counted.

Examples:
  gimnet status
  gimnet status --json | jq .ledger
  gimnet status --hub-id 2                  what another hub of the network counted
  gimnet status --all --json | jq .exact    ledger and links of every hub, and whether the counts of the links agree
)";

inline constexpr const char* kHubsAbout = R"(List the hubs of the network, and the way to each.

Examples:
  gimnet hubs
  gimnet hubs --json | jq '.[] | select(.reachable | not)'
)";

inline constexpr const char* kLinksAbout = R"(List the links of the hub to other hubs.

Examples:
  gimnet links
  gimnet links --hub-id 2 --json            those of another hub of the network
)";

inline constexpr const char* kRoutesAbout =
    R"(List the hubs on the way to a node: next hop, distance and cost, as each of them knows it.

Examples:
  gimnet routes robot
  gimnet routes 7.17 --json
)";

inline constexpr const char* kGraphAbout = R"(Draw the hubs and their links.

Examples:
  gimnet graph                              a line for each hub
  gimnet graph --dot | dot -Tsvg > network.svg
  gimnet graph --json
)";

}  // namespace gimnet::tool::help

namespace gimnet::tool {

/// All commands, by the words that name them.
inline constexpr std::array<std::pair<std::string_view, Command>, 20> kCommands{
    {{"send", Command::send},     {"recv", Command::recv},       {"pub", Command::pub},
     {"echo", Command::echo},     {"request", Command::request}, {"answer", Command::answer},
     {"hz", Command::hz},         {"bw", Command::bw},           {"ping", Command::ping},
     {"trace", Command::trace},   {"nodes", Command::nodes},     {"services", Command::services},
     {"watch", Command::watch},   {"status", Command::status},   {"hubs", Command::hubs},
     {"links", Command::links},   {"routes", Command::routes},   {"graph", Command::graph},
     {"impair", Command::impair}, {"ctl", Command::ctl}}};

/// Declares every command and option; parsing writes to `options`, which must outlive `app`. Each
/// option's description says its unit, range and default: it is what a wrong value is answered
/// with.
void add_commands(CLI::App& app, ToolOptions& options);

/// An empty word is a mistake of a script, not a default.
[[nodiscard]] const CLI::Validator& not_empty();

}  // namespace gimnet::tool
