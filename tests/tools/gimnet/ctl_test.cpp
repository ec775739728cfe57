#include "tools/gimnet/ctl.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <variant>
#include <vector>

#include "tools/gimnet/command_line.hpp"

namespace gimnet::tool {
namespace {

using ::testing::HasSubstr;

std::variant<ToolOptions, CommandEnding> parse(std::vector<const char*> words) {
  words.insert(words.begin(), "gimnet");
  return parse_command_line(static_cast<int>(words.size()), words.data());
}

CtlOptions ctl(const std::vector<const char*>& words) {
  const auto parsed = parse(words);
  const auto* options = std::get_if<ToolOptions>(&parsed);
  EXPECT_NE(options, nullptr) << std::get<CommandEnding>(parsed).text;
  if (options == nullptr) return {};
  EXPECT_EQ(options->command, Command::ctl);
  return options->ctl;
}

TEST(CtlOptions, EveryActionIsUnderstood) {
  EXPECT_EQ(ctl({"ctl", "connections"}).action, CtlAction::connections);
  EXPECT_EQ(ctl({"ctl", "drain"}).action, CtlAction::drain);
  EXPECT_EQ(ctl({"ctl", "reload"}).action, CtlAction::reload);
  const CtlOptions kick = ctl({"ctl", "kick", "robot", "--reason", "it stands in the way"});
  EXPECT_EQ(kick.action, CtlAction::kick);
  EXPECT_EQ(kick.node, "robot");
  EXPECT_EQ(kick.reason, "it stands in the way");
  const CtlOptions reassign = ctl({"ctl", "reassign", "7.17", "7.100"});
  EXPECT_EQ(reassign.action, CtlAction::reassign);
  EXPECT_EQ(reassign.new_id, "7.100");
  EXPECT_EQ(ctl({"ctl", "log", "debug"}).level, "debug");
}

TEST(CtlOptions, ChangesOfLinksAreUnderstood) {
  const CtlOptions add = ctl({"ctl", "link", "add", "tcp://h:1", "--name", "lab", "--cost", "20"});
  EXPECT_EQ(add.action, CtlAction::link);
  EXPECT_EQ(add.change, "add");
  EXPECT_EQ(add.link, "tcp://h:1");
  EXPECT_EQ(add.name, "lab");
  EXPECT_EQ(add.cost, 20);
  EXPECT_EQ(ctl({"ctl", "link", "add", "tcp://h:1", "--proxy", "http://p:1"}).proxy, "http://p:1");
  EXPECT_FALSE(ctl({"ctl", "link", "add", "unix:/a"}).cost);
  EXPECT_EQ(ctl({"ctl", "link", "remove", "lab"}).link, "lab");
  EXPECT_EQ(ctl({"ctl", "link", "cost", "lab", "65535"}).cost, 65'535);
  EXPECT_EQ(ctl({"ctl", "link", "cost", "lab", "0"}).cost, 0);
}

TEST(CtlOptions, WrongChangesOfLinksAreTold) {
  const auto fault = [](const std::vector<const char*>& words) {
    const auto parsed = parse(words);
    EXPECT_TRUE(std::holds_alternative<CommandEnding>(parsed));
    const auto* ending = std::get_if<CommandEnding>(&parsed);
    if (ending == nullptr) return std::string{};
    EXPECT_EQ(ending->code, ExitCode::usage);
    return ending->text;
  };
  EXPECT_THAT(fault({"ctl", "link", "remove", "lab", "--proxy", "http://p:1"}),
              HasSubstr("--proxy is for a link that is added: leave it out"));
  EXPECT_THAT(fault({"ctl", "link"}), HasSubstr("change is missing: add, remove or cost; gimnet"));
  EXPECT_THAT(fault({"ctl", "links"}), HasSubstr("that is a command: gimnet links"));
  EXPECT_THAT(fault({"ctl", "link", "ad", "x"}),
              HasSubstr("'ad' is no value for change: add, remove or cost"));
  EXPECT_THAT(fault({"ctl", "link", "add"}), HasSubstr("link is missing: the URL to add"));
  EXPECT_THAT(fault({"ctl", "link", "cost", "lab"}), HasSubstr("cost is missing: 1 to 65535"));
  EXPECT_THAT(fault({"ctl", "link", "cost", "lab", "65536"}), HasSubstr("'65536' is no value"));
  EXPECT_THAT(fault({"ctl", "link", "add", "unix:/a", "--cost", "0"}),
              HasSubstr("'0' is no value for --cost: of add: 1 to 65535"));
  EXPECT_THAT(fault({"ctl", "link", "remove", "lab", "5"}), HasSubstr("has no cost"));
  EXPECT_THAT(fault({"ctl", "link", "remove", "lab", "--name", "x"}), HasSubstr("--name is for"));
}

TEST(CtlOptions, OptionsOfAllCommandsStandAnywhere) {
  const auto parsed = parse({"--hub", "unix:/a", "ctl", "connections", "--json"});
  const auto& options = std::get<ToolOptions>(parsed);
  EXPECT_TRUE(options.json);
  EXPECT_EQ(options.hub, "unix:/a");
}

TEST(CtlOptions, WhatIsMissingIsToldWithExitCode2) {
  for (const std::vector<const char*>& words : {std::vector<const char*>{"ctl"},
                                                {"ctl", "kick"},
                                                {"ctl", "reassign", "7.1"},
                                                {"ctl", "log"},
                                                {"ctl", "kik"}}) {
    const auto parsed = parse(words);
    ASSERT_TRUE(std::holds_alternative<CommandEnding>(parsed)) << words.size();
    EXPECT_EQ(std::get<CommandEnding>(parsed).code, ExitCode::usage);
  }
}

TEST(CtlOptions, HelpShowsExamples) {
  const auto parsed = parse({"ctl", "--help"});
  EXPECT_THAT(std::get<CommandEnding>(parsed).text, HasSubstr("ctl reassign"));
}

}  // namespace
}  // namespace gimnet::tool
