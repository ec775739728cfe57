#include "hub/config/sources.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>

#include "tests/hub/control/support/folder.hpp"

namespace gimnet::hub {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

class ReloaderTest : public ::testing::Test {
 protected:
  ReloaderTest() { write("[limits]\nnodes = 10\nframe_bytes = 65536\n"); }
  void write(const std::string& text) { std::ofstream(path_) << text; }
  Reloader started() { return {sources_, read_configuration(sources_).configuration.options}; }

  TestFolder folder_;
  std::string path_ = folder_.path("hub.toml");
  ConfigSources sources_{path_, {}, {}};
};

TEST_F(ReloaderTest, WhatDidNotChangeIsNotNamed) {
  Reloader reloader = started();
  const Reloading same = reloader.read_again();
  EXPECT_THAT(same.faults, IsEmpty());
  EXPECT_THAT(same.changes, IsEmpty());
  EXPECT_EQ(same.limits.nodes, 10u);
}

TEST_F(ReloaderTest, ChangesWhatMayChangeAndNamesWhatNeedsARestart) {
  Reloader reloader = started();
  write("shards = 3\nlog_level = 'debug'\n[limits]\nnodes = 20\nframe_bytes = 70000\n");
  Reloading changed = reloader.read_again();
  ASSERT_THAT(changed.changes, SizeIs(4));
  EXPECT_EQ(changed.changes[0].key, "shards");
  EXPECT_TRUE(changed.changes[0].needs_restart);
  EXPECT_EQ(changed.changes[1].key, "log_level");
  EXPECT_FALSE(changed.changes[1].needs_restart);
  EXPECT_EQ(changed.changes[2].key, "limits.frame_bytes");
  EXPECT_EQ(changed.changes[2].from, "65536");
  EXPECT_EQ(changed.changes[2].to, "70000");
  EXPECT_TRUE(changed.changes[2].needs_restart);
  EXPECT_EQ(changed.changes[3].key, "limits.nodes");
  EXPECT_EQ(changed.limits.nodes, 20u);
  EXPECT_EQ(changed.limits.frame_bytes, 65'536u);
  EXPECT_EQ(changed.log_level, LogLevel::debug);
  // Settings that need a restart go on to be named; those that changed are in force.
  changed = reloader.read_again();
  EXPECT_THAT(changed.changes, SizeIs(2));
  EXPECT_EQ(changed.limits.nodes, 20u);
}

TEST_F(ReloaderTest, ABadFileChangesNothing) {
  Reloader reloader = started();
  write("shards = 99\n[limits]\nnodes = 20\n");
  const Reloading bad = reloader.read_again();
  ASSERT_THAT(bad.faults, SizeIs(1));
  EXPECT_THAT(bad.faults[0], HasSubstr("hub.toml:1:10: shards"));
  write("[limits]\nnodes = 30\n");
  const Reloading good = reloader.read_again();
  ASSERT_THAT(good.changes, SizeIs(1));
  EXPECT_EQ(good.changes[0].from, "10");
}

TEST_F(ReloaderTest, OfManyFaultsSomeAreToldAndThatThereAreMore) {
  Reloader reloader = started();
  std::string text;
  for (std::size_t i = 0; i < kReloadFaultsMax; ++i) text += "x" + std::to_string(i) + " = 1\n";
  write(text);
  EXPECT_THAT(reloader.read_again().faults, SizeIs(kReloadFaultsMax));
  EXPECT_FALSE(reloader.read_again().more_faults);
  write(text + "y = 1\n");
  const Reloading bad = reloader.read_again();
  EXPECT_THAT(bad.faults, SizeIs(kReloadFaultsMax));
  EXPECT_TRUE(bad.more_faults);
}

TEST_F(ReloaderTest, AFileThatIsGoneIsAFaultAndNotTheDefaults) {
  Reloader reloader = started();
  std::filesystem::remove(path_);
  ASSERT_THAT(reloader.read_again().faults, SizeIs(1));
}

TEST_F(ReloaderTest, WhatIsNoRegularFileIsAFaultAndNothingIsWaitedFor) {
  Reloader reloader = started();
  std::filesystem::remove(path_);
  ASSERT_EQ(::mkfifo(path_.c_str(), 0600), 0);
  const Reloading pipe = reloader.read_again();
  ASSERT_THAT(pipe.faults, SizeIs(1));
  EXPECT_THAT(pipe.faults[0], HasSubstr("hub.toml: cannot read this file: it is a pipe"));
  std::filesystem::remove(path_);
  write("[limits]\nnodes = 30\n");
  EXPECT_THAT(reloader.read_again().changes, SizeIs(1)) << "a file again";
}

TEST_F(ReloaderTest, ALevelThatWasSetByRequestIsSetBack) {
  Reloader reloader = started();
  reloader.note_log_level(LogLevel::debug);
  const Reloading back = reloader.read_again();
  ASSERT_THAT(back.changes, SizeIs(1));
  EXPECT_EQ(back.changes[0].from, "\"debug\"");
  EXPECT_EQ(back.log_level, LogLevel::info);
}

TEST_F(ReloaderTest, FlagsStayStronger) {
  Given flag;
  flag.key = "limits.nodes";
  flag.label = "--limit";
  flag.value.text = "5";
  sources_.flags.push_back(flag);
  Reloader reloader = started();
  write("[limits]\nnodes = 20\n");
  EXPECT_EQ(reloader.read_again().limits.nodes, 5u);
}

}  // namespace
}  // namespace gimnet::hub
