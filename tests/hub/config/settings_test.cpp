#include "hub/config/settings.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "hub/config/toml_file.hpp"

namespace gimnet::hub {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

struct Read {
  Configuration configuration;
  Faults faults;
};

Read read(const std::string& text) {
  Read result;
  TomlFile file = read_toml(text, "f");
  result.faults = file.faults;
  for (const Given& given : file.keys) apply(result.configuration, given, result.faults);
  complete(result.configuration, result.faults);
  return result;
}

/// The only thing that is wrong with `text`.
std::string fault(const std::string& text) {
  const Read result = read(text);
  EXPECT_THAT(result.faults, SizeIs(1)) << text;
  return result.faults.empty() ? "" : result.faults.front().line();
}

TEST(Settings, EveryKeyIsRead) {
  const Read result = read(
      "listen = ['tcp://127.0.0.1:0', 'unix:/some/path']\nshards = 2\nhub_id = 7\nhub_name = "
      "'hall'\n"
      "state_dir = '/some/dir'\nplacement = 'hint'\nspin = true\ninsecure = true\nlog_level = "
      "'debug'\n[limits]\nnodes "
      "= 10\n"
      "budget_bytes = '64M'\n");
  EXPECT_THAT(result.faults, IsEmpty());
  const HubOptions& options = result.configuration.options;
  ASSERT_THAT(options.listen, SizeIs(2));
  EXPECT_EQ(options.listen[1].text(), "unix:/some/path");
  EXPECT_EQ(options.shards, 2u);
  EXPECT_EQ(options.id, HubId{7});
  EXPECT_EQ(options.name, "hall");
  EXPECT_EQ(options.state_dir, "/some/dir");
  EXPECT_EQ(options.placement, Placement::hint);
  EXPECT_TRUE(options.spin);
  EXPECT_TRUE(options.insecure);
  EXPECT_EQ(options.log_level, LogLevel::debug);
  EXPECT_EQ(options.limits.nodes, 10u);
  EXPECT_EQ(options.limits.budget_bytes, 64ull << 20);
}

TEST(Settings, EveryLimitThatIsASettingIsAKeyWithItsLeastAndItsMost) {
  for (const LimitInfo& limit : limit_table()) {
    const std::string name{limit.name};
    if (!limit.setting) {
      EXPECT_THAT(fault("[limits]\n" + name + " = " + std::to_string(limit.most)),
                  HasSubstr("there is no limit '" + name + "'"));
      continue;
    }
    if (name == "keep_alive_ms" || name == "silent_ms")
      continue;  // they have to agree with each other
    for (const std::uint64_t value : {limit.least, limit.most}) {
      const Read result = read("[limits]\n" + name + " = " + std::to_string(value));
      EXPECT_THAT(result.faults, IsEmpty()) << name;
      EXPECT_EQ(result.configuration.options.limits.*limit.field, value) << name;
    }
    EXPECT_THAT(fault("[limits]\n" + name + " = " + std::to_string(limit.most + 1)),
                ::testing::AllOf(
                    HasSubstr("f:2:" + std::to_string(name.size() + 4) + ": limit " + name),
                    HasSubstr(std::to_string(limit.least) + " to " + std::to_string(limit.most))));
  }
}

TEST(Settings, TheWrongTypeIsToldWithTheRightOne) {
  EXPECT_EQ(fault("shards = '2'"),
            "f:1:10: shards is a whole number, not a text: write shards = 2");
  EXPECT_THAT(fault("shards = 'many'"), HasSubstr("write shards = 1"));
  EXPECT_THAT(fault("shards = 99.5"), HasSubstr("a fraction: write shards = 16"));
  EXPECT_THAT(fault("[limits]\nresume_bytes = true"), HasSubstr("write resume_bytes = 1048576"))
      << "its default";
  EXPECT_THAT(fault("[limits]\nresume_bytes = 5000.4"), HasSubstr("write resume_bytes = 5000"));
  EXPECT_THAT(fault("[limits]\nresume_bytes = 0.5"), HasSubstr("write resume_bytes = 4096"));
  EXPECT_THAT(fault("[limits]\nresume_bytes = nan"), HasSubstr("write resume_bytes = 1048576"));
  EXPECT_EQ(fault("insecure = 'yes'"),
            "f:1:12: insecure is true or false, not a text: write insecure = true");
  EXPECT_EQ(fault("hub_name = 5"),
            "f:1:12: hub_name is a text, not a whole number: write hub_name = \"hall\"");
  EXPECT_THAT(fault("listen = 7450"), HasSubstr("write listen = [\"tcp://127.0.0.1:7450\"]"));
  EXPECT_THAT(fault("listen = ['tcp://127.0.0.1:1', 7]"),
              HasSubstr("f:1:32: an address of listen is a text"));
  EXPECT_THAT(fault("state_dir = []"), HasSubstr("a text, not a list"));
  EXPECT_THAT(fault("placement = 1.5"), HasSubstr("not a fraction"));
  EXPECT_THAT(fault("log_level = 2020-01-01"), HasSubstr("not a date or time"));
  EXPECT_THAT(fault("limits = 5"), HasSubstr("limits is a table"));
  EXPECT_THAT(fault("[limits]\nnodes = true"),
              HasSubstr("limits.nodes is a whole number, not true or false"));
}

TEST(Settings, TheWrongRangeIsToldWithTheRightOne) {
  EXPECT_EQ(fault("shards = 17"),
            "f:1:10: shards cannot be '17': give a whole number from 1 to 16");
  EXPECT_THAT(fault("shards = -1"), HasSubstr("1 to 16"));
  EXPECT_THAT(fault("hub_id = 4095"), HasSubstr("1 to 4094"));
  EXPECT_THAT(fault("hub_name = 'my hub'"), HasSubstr("hub_name cannot be 'my hub'"));
  EXPECT_THAT(fault("[limits]\nnodes = 0"), HasSubstr("1 to 1000000 nodes"));
}

TEST(Settings, TheWrongUnitIsToldWithTheRightNumber) {
  EXPECT_EQ(
      fault("[limits]\ngrace_ms = '30s'"),
      "f:2:12: limit grace_ms cannot be '30s': it is in ms and takes no other unit: write 30000");
  EXPECT_THAT(fault("[limits]\ngrace_ms = '2 min'"), HasSubstr("write 120000"));
  EXPECT_THAT(fault("[limits]\nbudget_bytes = '256MB'"), HasSubstr("write 268435456"));
  EXPECT_THAT(fault("[limits]\ngrace_ms = '1k'"), HasSubstr("grace_ms cannot be '1k'"));
}

TEST(Settings, AnUnknownKeyIsToldWithTheNearestOne) {
  EXPECT_EQ(
      fault("shrads = 1"),
      "f:1:1: there is no key 'shrads'; did you mean shards? (tcphub --print-config shows all)");
  EXPECT_THAT(fault("[limits]\nnods = 1"),
              HasSubstr("f:2:1: there is no limit 'nods'; did you mean nodes?"));
  EXPECT_THAT(fault("nodes = 1"), HasSubstr("write it below [limits]"));
  EXPECT_THAT(fault("[limts]\nnodes = 1"), HasSubstr("did you mean limits?"));
  EXPECT_THAT(fault("log_level = 'inof'"), HasSubstr("did you mean info?"));
  EXPECT_THAT(fault("placement = 'hnt'"), HasSubstr("did you mean hint?"));
}

TEST(Settings, AnOpenAddressNeedsTheWord) {
  EXPECT_EQ(fault("listen = ['tcp://127.0.0.1:1', 'tcp://0.0.0.0:7450']"),
            "f:1:32: cannot listen on tcp://0.0.0.0:7450: other machines could reach it, and "
            "nothing that is sent "
            "is encrypted; where all of them are trusted give insecure = true, otherwise listen on "
            "127.0.0.1");
  EXPECT_THAT(read("listen = 'tcp://0.0.0.0:7450'\ninsecure = true").faults, IsEmpty());
  EXPECT_THAT(fault("listen = []"), HasSubstr("leave it out"));
  EXPECT_THAT(fault("listen = ['unix:/a', 'unix:/a']"), HasSubstr("given twice"));
}

TEST(Settings, LimitsMustFitEachOther) {
  EXPECT_THAT(fault("[limits]\nsilent_ms = 1000"),
              HasSubstr("f:2:13: limit silent_ms (1000) must be larger"));
  EXPECT_THAT(fault("[limits]\nkeep_alive_ms = 3000"),
              HasSubstr("f:2:17: limit silent_ms (3000) must be larger"));
  EXPECT_THAT(read("[limits]\nsilent_ms = 1001").faults, IsEmpty());
}

TEST(Settings, ALaterValueReplacesAnEarlierOne) {
  Read result = read("listen = ['unix:/a', 'unix:/b']\nshards = 2");
  for (const Given& given : read_toml("listen = ['unix:/c']", "g").keys) {
    apply(result.configuration, given, result.faults);
  }
  ASSERT_THAT(result.configuration.options.listen, SizeIs(1));
  EXPECT_EQ(result.configuration.origins["listen"], "g:1");
  EXPECT_EQ(result.configuration.origins["shards"], "f:2");
}

TEST(Settings, WhatIsPrintedIsReadBackEqual) {
  const Read first =
      read("listen = ['unix:/a \"b\"']\nshards = 2\nstate_dir = 'c'\n[limits]\nnodes = 7\n");
  const std::string text = print(first.configuration);
  EXPECT_THAT(text, HasSubstr("shards = 2  # f:2\n"));
  EXPECT_THAT(text, HasSubstr("nodes = 7  # f:5\n"));
  EXPECT_THAT(text, HasSubstr("hub_id = 1  # default\n"));
  const Read again = read(text);
  EXPECT_THAT(again.faults, IsEmpty());
  for (const Setting& setting : settings()) {
    EXPECT_EQ(setting.show(again.configuration.options), setting.show(first.configuration.options))
        << setting.key;
  }
  for (const LimitInfo& limit : limit_table()) {
    EXPECT_EQ(again.configuration.options.limits.*limit.field,
              first.configuration.options.limits.*limit.field);
  }
}

TEST(Settings, DefaultShardsAreBounded) {
  EXPECT_GE(default_shards(), 1u);
  EXPECT_LE(default_shards(), 8u);
}

}  // namespace
}  // namespace gimnet::hub
