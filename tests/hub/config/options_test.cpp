#include "hub/config/options.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "tests/hub/control/support/folder.hpp"

namespace gimnet::hub {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

std::variant<CommandLine, CommandLineEnding> parse(std::vector<const char*> arguments,
                                                   std::vector<const char*> environment = {}) {
  arguments.insert(arguments.begin(), "tcphub");
  environment.push_back(nullptr);
  return parse_command_line(static_cast<int>(arguments.size()), arguments.data(),
                            environment.data());
}

HubOptions options(const std::vector<const char*>& arguments) {
  const auto parsed = parse(arguments);
  const auto* ending = std::get_if<CommandLineEnding>(&parsed);
  EXPECT_EQ(ending, nullptr) << ending->text;
  return ending == nullptr ? std::get<CommandLine>(parsed).configuration.options : HubOptions{};
}

CommandLineEnding ending(const std::vector<const char*>& arguments) {
  const auto parsed = parse(arguments);
  const auto* found = std::get_if<CommandLineEnding>(&parsed);
  EXPECT_NE(found, nullptr);
  return found == nullptr ? CommandLineEnding{} : *found;
}

std::string error(const std::vector<const char*>& arguments) {
  const CommandLineEnding found = ending(arguments);
  EXPECT_EQ(found.exit_code, 2);
  EXPECT_THAT(found.text, ::testing::StartsWith("tcphub: "));
  return found.text;
}

TEST(Options, DefaultsAreUseful) {
  const HubOptions defaults = options({});
  EXPECT_TRUE(defaults.listen.empty());
  EXPECT_EQ(defaults.shards, default_shards());
  EXPECT_EQ(defaults.id, HubId{1});
  EXPECT_EQ(defaults.shown_name(), "hub-1");
  EXPECT_FALSE(defaults.id_configured);
  EXPECT_FALSE(defaults.links.accept);
  EXPECT_TRUE(defaults.links.dial.empty());
  EXPECT_EQ(defaults.placement, Placement::spread);
  EXPECT_FALSE(defaults.insecure);
  EXPECT_FALSE(defaults.spin);
}

TEST(Options, ShardsSpinOnlyWhereAskedTo) { EXPECT_TRUE(options({"--spin"}).spin); }

TEST(Options, ReadsEverything) {
  const HubOptions read = options({"--listen",    "tcp://127.0.0.1:0",
                                   "--listen",    "unix:/some/path",
                                   "--shards",    "2",
                                   "--hub-id",    "7",
                                   "--hub-name",  "hall",
                                   "--state-dir", "/some/dir",
                                   "--limit",     "nodes=10",
                                   "--limit",     "control_bytes=1M",
                                   "--placement", "hint",
                                   "--log-level", "debug"});
  ASSERT_EQ(read.listen.size(), 2u);
  EXPECT_EQ(read.listen[0].text(), "tcp://127.0.0.1:0");
  EXPECT_EQ(read.listen[1].text(), "unix:/some/path");
  EXPECT_EQ(read.shards, 2u);
  EXPECT_EQ(read.id, HubId{7});
  EXPECT_TRUE(read.id_configured);
  EXPECT_EQ(read.name, "hall");
  EXPECT_EQ(read.state_dir, "/some/dir");
  EXPECT_EQ(read.limits.nodes, 10u);
  EXPECT_EQ(read.limits.control_bytes, 1ull << 20);
  EXPECT_EQ(read.placement, Placement::hint);
  EXPECT_EQ(read.log_level, LogLevel::debug);
}

TEST(Options, UnderstandsEqualsSigns) {
  EXPECT_EQ(options({"--hub-id=9", "--limit=nodes=5"}).limits.nodes, 5u);
}

TEST(Options, AnOpenAddressNeedsTheWord) {
  EXPECT_EQ(
      error({"--listen", "tcp://0.0.0.0:7450"}),
      "tcphub: cannot listen on tcp://0.0.0.0:7450: other machines could reach it, and nothing "
      "that is sent is "
      "encrypted; where all of them are trusted give --insecure, otherwise listen on 127.0.0.1\n");
  EXPECT_EQ(options({"--listen", "tcp://0.0.0.0:7450", "--insecure"}).listen.size(), 1u);
  EXPECT_EQ(options({"--insecure", "--listen", "tcp://[::]:7450"}).listen.size(), 1u);
}

TEST(Options, RangesAreKept) {
  EXPECT_EQ(options({"--shards", "16"}).shards, 16u);
  EXPECT_THAT(error({"--shards", "17"}), AllOf(HasSubstr("--shards"), HasSubstr("1 to 16")));
  EXPECT_THAT(error({"--shards", "0"}), HasSubstr("1 to 16"));
  EXPECT_EQ(options({"--hub-id", "4094"}).id, HubId{4094});
  EXPECT_THAT(error({"--hub-id", "4095"}), HasSubstr("1 to 4094"));
  EXPECT_THAT(error({"--hub-id", "0"}), HasSubstr("1 to 4094"));
  EXPECT_THAT(error({"--hub-id", "7x"}), HasSubstr("'7x'"));
}

TEST(Options, ErrorsSayWhatWasMeant) {
  EXPECT_THAT(error({"--lisen", "tcp://127.0.0.1:1"}),
              AllOf(HasSubstr("'--lisen'"), HasSubstr("--listen?")));
  EXPECT_THAT(error({"--limit", "nods=1"}), HasSubstr("did you mean nodes?"));
  EXPECT_EQ(error({"--limit", "nodes=2", "--limit", "watches=2", "--limit", "nodes=2"}),
            "tcphub: --limit nodes is given twice: give it once\n");
  EXPECT_THAT(error({"--placement", "hnt"}), HasSubstr("did you mean hint?"));
  EXPECT_THAT(error({"--log-level", "inof"}), HasSubstr("did you mean info?"));
  EXPECT_THAT(error({"robot"}), HasSubstr("'robot'"));
  EXPECT_THAT(error({"--hub-name", "my hub"}), HasSubstr("--hub-name"));
  EXPECT_THAT(error({"--listen", "tcp://127.0.0.1:1", "--listen", "tcp://127.0.0.1:1"}),
              HasSubstr("twice"));
}

TEST(Options, WhatFollowsTwoDashesIsNoOption) {
  EXPECT_TRUE(options({"--spin", "--"}).spin);
  EXPECT_EQ(error({"--", "--spin"}),
            "tcphub: there is no argument '--spin' behind -- (tcphub --help shows all)\n");
  EXPECT_EQ(error({"--", "--"}),
            "tcphub: there is no argument '--' behind -- (tcphub --help shows all)\n");
  EXPECT_THAT(error({"spni", "--"}), HasSubstr("there is no argument 'spni'"));
  EXPECT_THAT(error({"--port", "7460"}), HasSubstr("'--port'; did you mean --listen?"));
  EXPECT_THAT(error({"--name=lab"}), HasSubstr("'--name'; did you mean --hub-name?"));
}

TEST(Options, SaysWhatAnOptionTakes) {
  EXPECT_EQ(error({"--shards"}),
            "tcphub: --shards needs a value: threads that carry data, 1 to 16; tcphub --help shows "
            "what there is\n");
  for (const char* name : {"--listen", "--hub-id", "--hub-name", "--state-dir", "--limit",
                           "--placement", "--log-level", "--config"}) {
    EXPECT_THAT(error({"--spin", name}),
                HasSubstr(std::string("tcphub: ") + name + " needs a value: "))
        << name;
    EXPECT_THAT(error({name, "--spin"}),
                HasSubstr(std::string(name) + " needs a value, and '--spin' looks like"));
  }
  EXPECT_THAT(error({"--shards", "1", "--shards", "2"}),
              HasSubstr("--shards is given 2 times: give it once"));
}

TEST(Options, NumbersAreDecimal) {
  for (const char* word : {"0x2", " 2", "2 ", "+2", "2.0", "1e1", ""}) {
    EXPECT_THAT(error({"--shards", word}), HasSubstr("give a whole number from 1 to 16")) << word;
    EXPECT_THAT(error({"--hub-id", word}), HasSubstr("give a whole number from 1 to 4094")) << word;
    const std::string nodes = std::string("nodes=") + word;
    EXPECT_THAT(error({"--limit", nodes.c_str()}), HasSubstr("limit nodes cannot be")) << word;
  }
  EXPECT_EQ(options({"--shards", "010"}).shards, 10u);
  EXPECT_EQ(options({"--limit", "nodes=010"}).limits.nodes, 10u);
}

TEST(Options, LimitsMustFitEachOther) {
  EXPECT_THAT(error({"--limit", "silent_ms=1000"}), HasSubstr("keep_alive_ms"));
  EXPECT_EQ(options({"--limit", "silent_ms=1001"}).limits.silent_ms, 1'001u);
}

TEST(Options, HelpAndVersionEndWell) {
  EXPECT_EQ(ending({"--help"}).exit_code, 0);
  EXPECT_THAT(ending({"--help"}).text, HasSubstr("--listen"));
  EXPECT_THAT(ending({"--version"}).text, HasSubstr("tcphub "));
  const CommandLineEnding limits = ending({"--help-limits"});
  EXPECT_EQ(limits.exit_code, 0);
  for (const LimitInfo& limit : limit_table()) {
    // The whole word: one name may be a part of another.
    const auto shown = limits.text.find("\n  " + std::string{limit.name} + " ");
    EXPECT_EQ(shown != std::string::npos, limit.setting) << limit.name;
  }
}

TEST(Options, EveryLimitIsReachedByItsFlag) {
  for (const LimitInfo& limit : limit_table()) {
    if (limit.name == "keep_alive_ms" || limit.name == "silent_ms") continue;  // they have to agree
    const std::string given = std::string{limit.name} + "=" + std::to_string(limit.most);
    EXPECT_EQ(options({"--limit", given.c_str()}).limits.*limit.field, limit.most) << limit.name;
  }
}

TEST(Options, FlagsAreStrongerThanTheEnvironment) {
  const auto parsed = parse({"--shards", "3"}, {"TCPHUB_SHARDS=2", "TCPHUB_HUB_ID=5"});
  const auto& line = std::get<CommandLine>(parsed);
  EXPECT_EQ(line.configuration.options.shards, 3u);
  EXPECT_EQ(line.configuration.options.id, HubId{5});
}

TEST(Options, AFlagMaySayFalseAndIsStrongerThanAFile) {
  const TestFolder folder;
  const std::string path = folder.path("hub.toml");
  std::ofstream(path) << "insecure = true\nspin = true\nlisten = 'tcp://0.0.0.0:0'\n";
  EXPECT_TRUE(options({"--config", path.c_str()}).insecure);
  EXPECT_EQ(ending({"--check-config", "--config", path.c_str(), "--insecure=false"}).exit_code, 2);
  const auto parsed =
      parse({"--config", path.c_str(), "--insecure=false", "--spin=false", "--listen", "unix:/s"},
            {"TCPHUB_INSECURE=true"});
  const auto& line = std::get<CommandLine>(parsed);
  EXPECT_FALSE(line.configuration.options.insecure);
  EXPECT_FALSE(line.configuration.options.spin);
  EXPECT_EQ(line.configuration.origins.at("spin"), "flag --spin");
  EXPECT_FALSE(line.sources.flags.empty());
  EXPECT_TRUE(options({"--insecure=true", "--spin=true", "--listen", "tcp://0.0.0.0:0"}).insecure);
  EXPECT_FALSE(options({"--spin=false"}).spin);
}

TEST(Options, EveryFlagIsTrueOrFalse) {
  for (const std::string flag : {"--insecure", "--spin", "--help", "--help-limits",
                                 "--check-config", "--print-config", "--version"}) {
    for (const std::string value : {"", "2", "no", "False"}) {
      const std::string word = flag + "=" + value;
      EXPECT_EQ(error({word.c_str()}), "tcphub: " + flag + " cannot be '" + value + "': write " +
                                           flag + " alone, " + flag + "=true or " + flag +
                                           "=false\n");
    }
    EXPECT_EQ(options({(flag + "=false").c_str()}).shards, default_shards())
        << flag << " asks for nothing";
  }
  EXPECT_EQ(ending({"--help=true"}).exit_code, 0);
  EXPECT_THAT(ending({"-h"}).text, HasSubstr("--listen"));
}

TEST(Options, AnEmptyValueIsNotTheNextWord) {
  EXPECT_EQ(error({"--state-dir=", "--check-config"}),
            "tcphub: --state-dir is empty: give it a value, or leave it out\n");
}

TEST(Options, AnEmptyPlaceIsNotTheDefaultOne) {
  EXPECT_EQ(error({"--config", ""}),
            "tcphub: --config is empty: give it the path of a TOML file, or leave it out\n");
  EXPECT_EQ(error({"--state-dir", ""}),
            "tcphub: --state-dir is empty: give it a folder, or leave it out\n");
}

TEST(Options, ChecksTheConfigurationAndEnds) {
  const TestFolder folder;
  const std::string path = folder.path("hub.toml");
  std::ofstream(path) << "shards = 2\n";
  EXPECT_EQ(ending({"--check-config", "--config", path.c_str()}).exit_code, 0);
  EXPECT_THAT(ending({"--check-config", "--config", path.c_str()}).text, HasSubstr(path));
  std::ofstream(path) << "shards = 99\nhub_id = 'x'\n";
  const CommandLineEnding wrong = ending({"--check-config", "--config", path.c_str()});
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_EQ(wrong.text, path + ":1:10: shards cannot be '99': give a whole number from 1 to 16\n" +
                            path +
                            ":2:10: hub_id is a whole number, not a text: write hub_id = 1\n");
}

TEST(Options, PrintsTheConfigurationAndEnds) {
  const CommandLineEnding printed = ending({"--print-config", "--hub-id", "9"});
  EXPECT_EQ(printed.exit_code, 0);
  EXPECT_THAT(printed.text,
              AllOf(HasSubstr("hub_id = 9  # flag --hub-id\n"), HasSubstr("[limits]\n")));
}

}  // namespace
}  // namespace gimnet::hub
