#include "tools/gimnet/command_line.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <initializer_list>
#include <string>
#include <vector>

#include "tools/gimnet/command_options.hpp"

namespace gimnet::tool {
namespace {

std::variant<ToolOptions, CommandEnding> parse(std::initializer_list<const char*> words) {
  std::vector<const char*> arguments{"gimnet"};
  arguments.insert(arguments.end(), words);
  return parse_command_line(static_cast<int>(arguments.size()), arguments.data());
}
ToolOptions options(std::initializer_list<const char*> words) {
  const auto parsed = parse(words);
  if (const auto* ending = std::get_if<CommandEnding>(&parsed)) {
    ADD_FAILURE() << ending->text;
    return {};
  }
  return std::get<ToolOptions>(parsed);
}
std::string refusal(std::initializer_list<const char*> words) {
  const auto parsed = parse(words);
  const auto* ending = std::get_if<CommandEnding>(&parsed);
  if (ending == nullptr || ending->code != ExitCode::usage) return "not refused";
  return ending->text;
}

std::string shown(std::initializer_list<const char*> words) {
  const auto parsed = parse(words);
  const auto* ending = std::get_if<CommandEnding>(&parsed);
  if (ending == nullptr || ending->code != ExitCode::done) return "not shown";
  return ending->text;
}

TEST(CommandLine, HelpIsACommandToo) {
  EXPECT_EQ(shown({"help"}), shown({"--help"}));
  EXPECT_EQ(shown({"help", "--help"}), shown({"--help"}));
  EXPECT_EQ(shown({"help", "ping"}), shown({"ping", "--help"}));
  EXPECT_EQ(shown({"--hub", "x", "help", "ctl", "kick"}), shown({"ctl", "kick", "--help"}));
  EXPECT_NE(shown({"help", "ping"}), shown({"help"}));
  EXPECT_NE(refusal({"help", "pnig"}).find("did you mean ping?"), std::string::npos);
}

TEST(CommandLine, TakesCommonOptionsBeforeAndAfterTheCommand) {
  for (const ToolOptions& read :
       {options({"--hub", "tcp://h:1", "--json", "--shard", "1", "nodes"}),
        options({"nodes", "--hub", "tcp://h:1", "--json", "--shard", "1"})}) {
    EXPECT_EQ(read.command, Command::nodes);
    EXPECT_EQ(read.hub, "tcp://h:1");
    EXPECT_TRUE(read.json);
    EXPECT_EQ(read.shard, 1);
  }
}

TEST(CommandLine, ReadsEachCommand) {
  EXPECT_EQ(options({"send", "B", "--lane", "bulk", "--type", "5", "--instance", "6"}).lane,
            Lane::bulk);
  EXPECT_EQ(options({"send", "B", "--type", "5", "--instance", "6"}).key, (MessageKey{5, 6}));
  EXPECT_EQ(options({"recv", "--name", "B", "-n", "1000", "--raw"}).count, 1000u);
  EXPECT_EQ(options({"pub", "robot/odom", "--delivery", "latest", "--rate", "2.5"}).delivery,
            Delivery::latest);
  EXPECT_EQ(options({"pub", "a/b", "--wait", "3"}).subscribers, 3u);
  const ToolOptions sync = options({"pub", "a/b", "--delivery", "sync:3", "--retain"});
  EXPECT_EQ(sync.delivery, Delivery::sync);
  EXPECT_EQ(sync.window, 3u);
  EXPECT_TRUE(sync.retain);
  EXPECT_EQ(options({"pub", "a/b", "--delivery", "sync"}).window, 1u);
  const ToolOptions paced =
      options({"echo", "a/*", "--window", "2", "--depth", "4", "--rate", "0.5"});
  EXPECT_EQ(paced.wish.window, 2u);
  EXPECT_EQ(paced.wish.depth, 4u);
  EXPECT_EQ(paced.wish.rate_hz, 0.5);
  for (const char* wrong : {"sync:", "sync:0", "sync:x", "sync:2x", "fast"}) {
    EXPECT_NE(
        refusal({"pub", "a/b", "--delivery", wrong}).find("is no value for --delivery: stream"),
        std::string::npos);
  }
  EXPECT_EQ(options({"echo", "robot/odom", "-n", "2"}).target, "robot/odom");
  EXPECT_EQ(options({"ping", "B", "-c", "1000", "-i", "0.001"}).pings, 1000u);
  EXPECT_EQ(options({"services", "robot/*"}).target, "robot/*");
  EXPECT_EQ(options({"status"}).command, Command::status);
}

TEST(CommandLine, AFlagIsTrueOrFalse) {
  EXPECT_FALSE(options({"--json=false", "nodes"}).json);
  EXPECT_TRUE(options({"nodes", "--json=true"}).json);
  EXPECT_FALSE(options({"pub", "a/b", "--retain=false", "--stay"}).retain);
  EXPECT_EQ(refusal({"nodes", "--json=2"}),
            "gimnet: --json cannot be '2': write --json alone, --json=true or --json=false\n"
            "`gimnet nodes --help` shows how it is called.\n");
  EXPECT_NE(refusal({"--json=", "nodes"}).find("--json cannot be ''"), std::string::npos);
  EXPECT_NE(refusal({"pub", "a/b", "--retain=no"}).find("--retain cannot be 'no'"),
            std::string::npos);
  EXPECT_NE(refusal({"ctl", "kick", "a", "--json=1"}).find("--json cannot be '1'"),
            std::string::npos);
  EXPECT_NE(refusal({"--help=false"}).find("--help takes no value"), std::string::npos);
  EXPECT_NE(refusal({"nodes", "--version=false"}).find("--version takes no value"),
            std::string::npos);
}

TEST(CommandLine, AnEmptyValueIsNotTheNextWord) {
  EXPECT_NE(refusal({"recv", "--name=", "--json"}).find("--name is empty: give it a value"),
            std::string::npos);
  EXPECT_NE(refusal({"--hub=", "nodes"}).find("--hub is empty"), std::string::npos);
  EXPECT_EQ(options({"ctl", "kick", "a", "--reason=--json=1"}).ctl.reason, "--json=1");
  EXPECT_EQ(options({"ctl", "kick", "a", "--reason", "-hot-"}).ctl.reason, "-hot-");
}

TEST(CommandLine, AnotherOptionIsNoValue) {
  EXPECT_EQ(refusal({"recv", "--name", "--raw"}),
            "gimnet: --name needs a value, and '--raw' looks like an option; if it is meant, write "
            "--name=--raw\n"
            "`gimnet recv --help` shows how it is called.\n");
  EXPECT_NE(refusal({"ping", "B", "-c", "-i", "1"}).find("-c needs a value, and '-i'"),
            std::string::npos);
  EXPECT_NE(refusal({"--hub", "--json", "nodes"}).find("--hub needs a value, and '--json'"),
            std::string::npos);
  EXPECT_EQ(options({"recv", "--name=--raw"}).name, "--raw");
}

TEST(CommandLine, SuggestsWhatANewcomerMeant) {
  const auto said = [](std::initializer_list<const char*> words, const char* part) {
    const std::string text = refusal(words);
    EXPECT_NE(text.find(part), std::string::npos) << text;
  };
  said({"version"}, "did you mean --version?");
  said({"--hbu", "x", "status"}, "there is no option --hbu for gimnet; did you mean --hub?");
  said({"--colour", "never", "status"},
       "there is no option --colour for gimnet; did you mean --color?");
  said({"--colour=never", "statsu"},
       "there is no option --colour for gimnet; did you mean --color?");
  said({"--json", "--hub", "x", "statsu"}, "there is no command 'statsu'; did you mean status?");
  said({"recv", "B"}, "'B' is one word too many for gimnet recv; did you mean --name B?");
  said({"hz", "*"},
       "'*' matches no service: full names are NODE/SERVICE, so write NODE/*, or ** for all");
  said({"echo", "robot*"}, "'robot*' matches no service");
  said({"pub", "*"}, "'*' is no full name of a service: write NODE/SERVICE");
  said({"sub", "a/b"}, "there is no command 'sub'; did you mean echo?");
  said({"topic", "list"}, "there is no command 'topic'; did you mean services?");
  said({"monitor"}, "there is no command 'monitor'; did you mean watch?");
  said({"pub", "a/b", "hello"},
       "'hello' is one word too many for gimnet pub: messages are lines of its standard input");
  said({"send", "B", "hello"},
       "'hello' is one word too many for gimnet send: messages are lines of its standard input");
  said({"request", "calc/add", "1", "2"},
       "'2' is one word too many for gimnet request: put a text of several words in quotes");
  said({"request", "calc/add", "1 2", "--file", "f"}, "a text and --file contradict each other");
  for (const char* const pattern : {"a/#", "a/+/b", "a.>"}) {
    for (const char* const command : {"echo", "hz", "bw", "watch", "nodes", "services"}) {
      said({command, pattern},
           "has a character that no name has; in patterns `*` is one part, `**` any number");
    }
  }
  said({"ctl", "list"}, "did you mean link?");
  EXPECT_EQ(options({"hz", "**"}).target, "**");
}

TEST(CommandLine, NodesMayBeCalledAsCommandsAre) {
  for (const auto& [word, command] : kCommands) {
    const std::string name(word);
    const std::string service = name + "/" + name;
    EXPECT_EQ(options({"nodes", name.c_str()}).target, name);
    EXPECT_EQ(options({"--json", "services", name.c_str(), "--hub", "tcp://h:1"}).target, name);
    EXPECT_EQ(options({"ping", name.c_str(), "-c", "1"}).target, name);
    EXPECT_EQ(options({"send", name.c_str(), "--name", name.c_str()}).target, name);
    EXPECT_EQ(options({"recv", "--name", name.c_str()}).name, name);
    EXPECT_EQ(options({"watch", "-n", "1", name.c_str()}).target, name);
    EXPECT_EQ(options({"echo", service.c_str()}).target, service);
    EXPECT_EQ(options({"ctl", "kick", name.c_str()}).ctl.node, name);
  }
  EXPECT_EQ(options({"ctl", "kick", "drain"}).ctl.action, CtlAction::kick);
}

TEST(CommandLine, WhatFollowsTwoDashesIsNoOption) {
  EXPECT_EQ(options({"ping", "-c2", "--", "-robot"}).target, "-robot");
  EXPECT_EQ(options({"ping", "-c2", "--", "-robot"}).pings, 2u);
  EXPECT_EQ(options({"--json", "send", "--lane", "bulk", "--", "--odd"}).target, "--odd");
  EXPECT_EQ(options({"nodes", "--", "--all"}).target, "--all");
  EXPECT_FALSE(options({"nodes", "--", "--all"}).all);
  EXPECT_EQ(options({"pub", "--", "-robot/odom"}).target, "-robot/odom");
  EXPECT_EQ(options({"echo", "--", "--/odom"}).target, "--/odom");
  EXPECT_EQ(options({"ping", "--", "--"}).target, "--");
  EXPECT_EQ(options({"ctl", "kick", "--", "-robot"}).ctl.node, "-robot");
  EXPECT_EQ(options({"--", "ping", "B"}).target, "B");
  EXPECT_EQ(options({"ping", "B", "--"}).target, "B");
  EXPECT_EQ(options({"recv", "--name", "B", "--"}).name, "B");
  EXPECT_NE(refusal({"ping", "--"}).find("node is missing"), std::string::npos);
  EXPECT_NE(
      refusal({"ping", "--", "-robot", "-c2"}).find("'-c2' is one word too many for gimnet ping"),
      std::string::npos);
  EXPECT_NE(
      refusal({"ping", "-robot", "--", "B"}).find("there is no option -robot for gimnet ping"),
      std::string::npos);
  EXPECT_NE(refusal({"--", "statsu"}).find("there is no command 'statsu'; did you mean status?"),
            std::string::npos);
}

TEST(CommandLine, ASecondCommandIsOneWordTooMany) {
  EXPECT_NE(refusal({"ping", "B", "status", "-c", "1"})
                .find("'status' is one word too many for gimnet ping"),
            std::string::npos);
  EXPECT_NE(
      refusal({"--json", "status", "nodes"}).find("'nodes' is one word too many for gimnet status"),
      std::string::npos);
  EXPECT_NE(refusal({"ctl", "drain", "reload"})
                .find("'reload' is one word too many for gimnet ctl drain"),
            std::string::npos);
}

TEST(CommandLine, SaysThatAnOptionIsGivenTwice) {
  EXPECT_NE(refusal({"--hub", "tcp://a:1", "nodes", "--hub", "tcp://b:1"})
                .find("--hub is given 2 times: give it once"),
            std::string::npos);
}

TEST(CommandLine, WithoutACommandItSaysThatAndNamesThem) {
  const std::string text = refusal({});
  EXPECT_TRUE(text.starts_with("gimnet: the command is missing; these are there:\n")) << text;
  EXPECT_TRUE(text.ends_with(
      "`gimnet --help` shows examples and options, `gimnet COMMAND --help` those of one.\n"))
      << text;
  for (const auto& [word, command] : kCommands) {
    EXPECT_NE(text.find("\n  " + std::string(word) + " "), std::string::npos) << text;
  }
  EXPECT_LE(std::ranges::count(text, '\n'), 23) << "with a prompt it fits a terminal of 24 lines";
}

TEST(CommandLine, SuggestsTheCommandThatWasMeant) {
  EXPECT_NE(refusal({"sned", "B"}).find("did you mean send?"), std::string::npos);
  EXPECT_NE(refusal({"--hub", "tcp://h:1", "ehco"}).find("did you mean echo?"), std::string::npos);
}

TEST(CommandLine, SuggestsTheOptionThatWasMeant) {
  EXPECT_EQ(refusal({"nodes", "--al"}),
            "gimnet: there is no option --al for gimnet nodes; did you mean --all?\n"
            "`gimnet nodes --help` shows how it is called.\n");
  EXPECT_NE(refusal({"recv", "--nmae=B"}).find("--nmae for gimnet recv; did you mean --name?"),
            std::string::npos);
  EXPECT_NE(refusal({"status", "--jsn"}).find("did you mean --json?"), std::string::npos);
  EXPECT_NE(refusal({"nodes", "a", "b"}).find("'b' is one word too many for gimnet nodes"),
            std::string::npos);
}

TEST(CommandLine, SaysWhatAnOptionTakes) {
  EXPECT_NE(refusal({"pub", "a/b", "--rate", "10Hz"})
                .find("'10Hz' is no value for --rate: lines a second, 0.001 to"),
            std::string::npos);
  EXPECT_NE(
      refusal({"ping", "B", "-W", "10ms"}).find("'10ms' is no value for -W,--timeout: seconds"),
      std::string::npos);
  EXPECT_NE(refusal({"send", "B", "--file"}).find("--file needs a value: send this file"),
            std::string::npos);
  EXPECT_NE(refusal({"send"}).find("node is missing: name or id"), std::string::npos);
  EXPECT_NE(refusal({"recv"}).find("--name is missing: name of this node"), std::string::npos);
  EXPECT_NE(refusal({"echo", "a/b", "-n", "0"}).find("'0' is no value for -n,--count"),
            std::string::npos);
}

TEST(CommandLine, SaysWhatAHiddenOptionTakes) {
  EXPECT_EQ(options({"--shard", "255", "nodes"}).shard, 255u);
  EXPECT_NE(refusal({"--shard", "256", "nodes"})
                .find("gimnet: '256' is no value for --shard: the hub's shard on which to live, 0 "
                      "to 255\n"),
            std::string::npos);
  EXPECT_NE(refusal({"nodes", "--shard", "1", "--shard", "2"})
                .find("gimnet: --shard is given 2 times: give it once"),
            std::string::npos);
  EXPECT_NE(refusal({"nodes", "--shard"}).find("gimnet: --shard needs a value: the hub's shard"),
            std::string::npos);
}

TEST(CommandLine, ReadsTheBoundsOfWhatGoesOn) {
  for (const char* command : {"echo", "hz", "bw", "watch"}) {
    const ToolOptions read = options({command, "robot/*", "-n", "5", "--seconds", "2.5"});
    EXPECT_EQ(read.count, 5u);
    EXPECT_EQ(read.seconds, 2.5);
    EXPECT_EQ(read.target, "robot/*");
  }
  EXPECT_EQ(options({"hz", "a/b", "--window", "0.5"}).window_s, 0.5);
  EXPECT_NE(refusal({"bw", "a/b", "--seconds", "0"}), "not refused");
  EXPECT_TRUE(options({"nodes", "--all"}).all);
  EXPECT_EQ(options({"nodes", "--color", "never"}).colour, Colour::never);
}

TEST(CommandLine, RefusesContradictions) {
  EXPECT_NE(refusal({"recv", "--name", "B", "--json", "--raw"}).find("--raw"), std::string::npos);
  EXPECT_NE(refusal({"pub", "odom"}).find("NODE/SERVICE"), std::string::npos);
  EXPECT_NE(refusal({"pub", "robot/"}).find("NODE/SERVICE"), std::string::npos);
  EXPECT_NE(refusal({"pub", "robot/odom", "--name", "rob"}).find("rob"), std::string::npos);
}

TEST(CommandLine, RefusesValuesOutOfRange) {
  EXPECT_NE(refusal({"ping", "B", "-c", "0"}).find("-c"), std::string::npos);
  EXPECT_NE(refusal({"send", "B", "--lane", "fast"}).find("--lane"), std::string::npos);
  EXPECT_NE(refusal({"recv", "--name", "B", "--max-size", "1073741825"}).find("--max-size"),
            std::string::npos);
  EXPECT_NE(refusal({"send"}), "not refused");
  EXPECT_EQ(options({"pub", "a/b", "--wait", "1000000"}).subscribers, 1'000'000u);
  for (const char* wrong : {"1000001", "-1", "18446744073709551616"}) {
    EXPECT_NE(
        refusal({"pub", "a/b", "--wait", wrong}).find("is no value for --wait: wait until so many"),
        std::string::npos);
  }
}

TEST(CommandLine, ANumberIsNoNumberIfItSaysSo) {
  for (const char* nan : {"nan", "NaN", "-nan"}) {
    EXPECT_NE(refusal({"echo", "a/b", "--seconds", nan}).find("is no value for --seconds"),
              std::string::npos)
        << nan;
    EXPECT_NE(refusal({"echo", "a/b", "--rate", nan}).find("is no value for --rate"),
              std::string::npos)
        << nan;
    EXPECT_NE(refusal({"ping", "B", "-i", nan}).find("is no value for -i"), std::string::npos)
        << nan;
    EXPECT_NE(refusal({"hz", "a/b", "--window", nan}).find("is no value for --window"),
              std::string::npos)
        << nan;
  }
}

TEST(CommandLine, NumbersAreDecimal) {
  for (const char* word : {"0x10", " 5", "5 ", "+5", "0b1", "1'0", "1,5", "5k", ""}) {
    EXPECT_NE(refusal({"pub", "a/b", "--rate", word}), "not refused") << word;
    EXPECT_NE(refusal({"pub", "a/b", "--wait", word}), "not refused") << word;
    EXPECT_NE(refusal({"pub", "a/b", "--type", word}), "not refused") << word;
    EXPECT_NE(refusal({"recv", "--name", "B", "-n", word}), "not refused") << word;
    EXPECT_NE(refusal({"recv", "--name", "B", "--max-size", word}), "not refused") << word;
    EXPECT_NE(refusal({"ping", "B", "-c", word}), "not refused") << word;
    EXPECT_NE(refusal({"--shard", word, "nodes"}), "not refused") << word;
  }
  EXPECT_NE(refusal({"send", "B", "--instance", "1.5"}).find("'1.5' is no value for --instance"),
            std::string::npos);
  EXPECT_EQ(options({"send", "B", "--type", "010", "--instance", "4294967295"}).key,
            (MessageKey{10, UINT32_MAX}));
  EXPECT_NE(refusal({"send", "B", "--type", "4294967296"}).find("is no value for --type"),
            std::string::npos);
  EXPECT_EQ(options({"ping", "B", "-c", "010", "-i", "010.5"}).pings, 10u);
  EXPECT_EQ(options({"ping", "B", "-i", "010.5"}).interval_s, 10.5);
  EXPECT_EQ(options({"pub", "a/b", "--rate", "1e3"}).rate_hz, 1e3);
}

TEST(CommandLine, RefusesWindowsThatNoHubTakes) {
  EXPECT_EQ(options({"echo", "a/b", "--window", "1000000", "--depth", "4096"}).wish.depth, 4096u);
  EXPECT_NE(refusal({"echo", "a/b", "--window", "0"}).find("is no value for --window"),
            std::string::npos);
  EXPECT_NE(refusal({"echo", "a/b", "--window", "1000001"}).find("is no value for --window"),
            std::string::npos);
  EXPECT_NE(refusal({"echo", "a/b", "--depth", "0"}).find("is no value for --depth"),
            std::string::npos);
  EXPECT_NE(refusal({"echo", "a/b", "--depth", "4097"}).find("is no value for --depth"),
            std::string::npos);
  EXPECT_EQ(options({"pub", "a/b", "--delivery", "sync:1000000"}).window, 1'000'000u);
  EXPECT_NE(refusal({"pub", "a/b", "--delivery", "sync:1000001"}).find("1 to 1000000"),
            std::string::npos);
  EXPECT_TRUE(options({"pub", "a/b", "--retain", "--stay"}).stay);
}

TEST(CommandLine, HelpEndsWell) {
  const auto parsed = parse({"send", "--help"});
  const auto* ending = std::get_if<CommandEnding>(&parsed);
  ASSERT_NE(ending, nullptr);
  EXPECT_EQ(ending->code, ExitCode::done);
  EXPECT_NE(ending->text.find("Examples:"), std::string::npos);
  EXPECT_NE(ending->text.find("Usage: gimnet send"), std::string::npos) << ending->text;
}

}  // namespace
}  // namespace gimnet::tool
