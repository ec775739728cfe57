#include "hub/config/sources.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>

#include "hub/config/toml_file.hpp"
#include "tests/hub/control/support/folder.hpp"

namespace gimnet::hub {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

class SourcesTest : public ::testing::Test {
 protected:
  void write(const std::string& name, const std::string& text) {
    std::ofstream(folder_.path(name)) << text;
  }
  void make_conf_d() { ASSERT_EQ(::mkdir(folder_.path("conf.d").c_str(), 0700), 0); }
  ReadConfiguration read() { return read_configuration(sources_); }
  void environment(std::vector<const char*> variables) {
    variables.push_back(nullptr);
    warnings_ = read_environment(sources_, variables.data());
  }

  TestFolder folder_;
  ConfigSources sources_{folder_.path("hub.toml"), {}, {}};
  std::vector<std::string> warnings_;
};

TEST_F(SourcesTest, AStrongerSourceWinsOverAWeakerOne) {
  make_conf_d();
  write("hub.toml",
        "shards = 1\nhub_id = 1\nhub_name = 'file'\nplacement = 'hint'\n[limits]\nnodes = 1\n");
  write("conf.d/1.toml", "shards = 2\nhub_id = 2\nhub_name = 'first'\n");
  write("conf.d/2.toml", "shards = 3\nhub_id = 3\n");
  environment({"TCPHUB_SHARDS=4", "TCPHUB_HUB_ID=4", "PATH=x"});
  Given flag;
  flag.key = "shards";
  flag.label = "--shards";
  flag.origin = "flag --shards";
  flag.value.text = "5";
  sources_.flags.push_back(flag);
  const ReadConfiguration all = read();
  EXPECT_THAT(all.faults, IsEmpty());
  EXPECT_EQ(all.configuration.options.shards, 5u);
  EXPECT_EQ(all.configuration.options.id, HubId{4});
  EXPECT_EQ(all.configuration.options.name, "first");
  EXPECT_EQ(all.configuration.options.placement, Placement::hint);
  EXPECT_EQ(all.configuration.options.limits.nodes, 1u);
  EXPECT_THAT(all.files, ElementsAre(folder_.path("hub.toml"), folder_.path("conf.d/1.toml"),
                                     folder_.path("conf.d/2.toml")));
  const auto& origins = all.configuration.origins;
  EXPECT_EQ(origins.at("shards"), "flag --shards");
  EXPECT_EQ(origins.at("hub_id"), "environment TCPHUB_HUB_ID");
  EXPECT_EQ(origins.at("hub_name"), folder_.path("conf.d/1.toml") + ":3");
  EXPECT_EQ(origins.at("limits.nodes"), folder_.path("hub.toml") + ":6");
}

TEST_F(SourcesTest, WhatIsOverruledHasToBeRightAllTheSame) {
  write("hub.toml", "shards = 99\n");
  environment({"TCPHUB_SHARDS=4"});
  EXPECT_THAT(read().faults, SizeIs(1));
}

TEST_F(SourcesTest, EveryKeyHasAVariable) {
  write("hub.toml", "");
  environment({"TCPHUB_LISTEN=unix:/a, unix:/b", "TCPHUB_SHARDS=2", "TCPHUB_HUB_ID=7",
               "TCPHUB_HUB_NAME=hall", "TCPHUB_STATE_DIR=/d", "TCPHUB_PLACEMENT=hint",
               "TCPHUB_SPIN=true", "TCPHUB_INSECURE=true", "TCPHUB_LOG_LEVEL=debug",
               "TCPHUB_LIMITS_BUDGET_BYTES=64M", "TCPHUB_LINK=unix:/c tcp://127.0.0.1:1",
               "TCPHUB_LINKS_ACCEPT_LINKS=true", "TCPHUB_LINKS_KEEP_ALIVE_MS=400",
               "TCPHUB_LINKS_SILENT_MS=4000", "TCPHUB_LINKS_ALLOW=2,3"});
  EXPECT_THAT(warnings_, IsEmpty());
  const ReadConfiguration all = read();
  EXPECT_THAT(all.faults, IsEmpty());
  EXPECT_THAT(all.configuration.options.listen, SizeIs(2));
  EXPECT_TRUE(all.configuration.options.spin);
  EXPECT_TRUE(all.configuration.options.insecure);
  EXPECT_EQ(all.configuration.options.limits.budget_bytes, 64ull << 20);
  EXPECT_THAT(all.configuration.options.links.dial, SizeIs(2));
  EXPECT_EQ(all.configuration.options.links.accepted,
            (LinkTerms{400, 4'000, {HubId{2}, HubId{3}}}));
  EXPECT_EQ(all.configuration.origins.size(), settings().size() + 1);
}

TEST_F(SourcesTest, AWrongVariableIsNamed) {
  write("hub.toml", "");
  environment({"TCPHUB_SHARDS=0", "TCPHUB_SHARD=2"});
  ASSERT_THAT(warnings_, SizeIs(1));
  EXPECT_THAT(
      warnings_[0],
      HasSubstr("TCPHUB_SHARD is no key of the configuration; did you mean TCPHUB_SHARDS?"));
  const ReadConfiguration all = read();
  ASSERT_THAT(all.faults, SizeIs(1));
  EXPECT_EQ(all.faults[0].line(),
            "tcphub: TCPHUB_SHARDS cannot be '0': give a whole number from 1 to 16");
}

TEST_F(SourcesTest, AWrongLimitOfTheEnvironmentNamesItsVariable) {
  write("hub.toml", "");
  environment({"TCPHUB_LIMITS_NODES=x"});
  const ReadConfiguration all = read();
  ASSERT_THAT(all.faults, SizeIs(1));
  EXPECT_THAT(all.faults[0].line(),
              HasSubstr("tcphub: TCPHUB_LIMITS_NODES: limit nodes cannot be 'x': "));
}

TEST_F(SourcesTest, EveryFaultIsTold) {
  constexpr std::size_t kLines = 500;
  make_conf_d();
  std::string text;
  for (std::size_t i = 0; i < 2 * kLines; ++i) text += "unknown_" + std::to_string(i) + " = 1\n";
  write("hub.toml", text);
  write("conf.d/a.toml", text);
  const ReadConfiguration all = read();
  EXPECT_THAT(all.faults, SizeIs(4 * kLines));
  for (std::size_t line = 1; line <= 2 * kLines; ++line) {
    EXPECT_THAT(all.faults[line - 1].place, HasSubstr("hub.toml:" + std::to_string(line) + ":"));
  }
}

// A file as wrong as it can be takes no longer than one that is right.
TEST_F(SourcesTest, AFileThatIsWrongAllOverIsReadToItsEnd) {
  std::string list = "listen = [1";
  while (list.size() + 3 < kConfigBytesMax) list += ",1";
  write("hub.toml", list + "]");
  EXPECT_THAT(read().faults, SizeIs((list.size() - 9) / 2));
}

TEST_F(SourcesTest, TheVariableNamesTheFileUnlessAFlagDoes) {
  sources_.file.clear();
  environment({"TCPHUB_CONFIG=/some/file"});
  EXPECT_EQ(sources_.file, "/some/file");
  environment({"TCPHUB_CONFIG=/another"});
  EXPECT_EQ(sources_.file, "/some/file");
}

TEST_F(SourcesTest, AVariableThatIsEmptyIsNoPlace) {
  write("hub.toml", "state_dir = ''\n");
  environment({"TCPHUB_CONFIG="});
  EXPECT_THAT(read().faults, IsEmpty()) << "a flag named the file";
  sources_.file.clear();
  environment({"TCPHUB_STATE_DIR=", "TCPHUB_CONFIG="});
  std::vector<std::string> lines;
  for (const ConfigFault& fault : read().faults) lines.push_back(fault.line());
  EXPECT_THAT(lines,
              ElementsAre("tcphub: TCPHUB_CONFIG is empty: give it a TOML file's path, or unset it",
                          "tcphub: TCPHUB_STATE_DIR is empty: give it a folder, or leave it out"));
}

TEST_F(SourcesTest, AFileThatIsNamedHasToBeThere) {
  ASSERT_THAT(read().faults, SizeIs(1));
  EXPECT_THAT(read().faults[0].line(),
              HasSubstr("hub.toml: cannot read this file: No such file or directory"));
  ASSERT_EQ(::mkdir(folder_.path("hub.toml").c_str(), 0700), 0);
  EXPECT_THAT(read().faults[0].line(), HasSubstr("Is a directory; give the path"));
}

TEST_F(SourcesTest, AFileInThePlaceOfTheFolderIsTold) {
  write("hub.toml", "hub_id = 9\n");
  write("conf.d", "hub_id = 8\n");
  const ReadConfiguration configuration = read();
  ASSERT_THAT(configuration.faults, SizeIs(1));
  EXPECT_EQ(configuration.faults[0].line(), folder_.path("conf.d") +
                                                ": this is not a folder, of which the *.toml would "
                                                "be read; make it one, or give it another name");
}

TEST_F(SourcesTest, WithoutDescriptorsNothingIsReadAndThatIsSaid) {
  write("hub.toml", "hub_id = 9\n");
  make_conf_d();
  write("conf.d/more.toml", "shards = 3\n");
  EXPECT_THAT(read().faults, IsEmpty());
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &before), 0);
  rlimit none = before;
  none.rlim_cur = 0;
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &none), 0);
  const ReadConfiguration nothing = read();
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &before), 0);
  ASSERT_THAT(nothing.faults, SizeIs(2));
  EXPECT_THAT(nothing.faults[0].line(),
              HasSubstr("hub.toml: cannot read this file: Too many open files; raise the limit"));
  EXPECT_THAT(nothing.faults[1].line(),
              HasSubstr("conf.d: cannot read this folder: Too many open files; "));
}

TEST_F(SourcesTest, TheUsersFileIsFoundAndNoneIsNeeded) {
  sources_.file.clear();
  ::setenv("XDG_CONFIG_HOME", folder_.path("").c_str(), 1);
  EXPECT_THAT(default_config_files(),
              ElementsAre(folder_.path("/gimnet/tcphub.toml"), "/etc/gimnet/tcphub.toml"));
  EXPECT_THAT(read().faults, IsEmpty());
  ASSERT_EQ(::mkdir(folder_.path("gimnet").c_str(), 0700), 0);
  write("gimnet/tcphub.toml", "hub_id = 9\n");
  EXPECT_EQ(read().configuration.options.id, HubId{9});
  ::unsetenv("XDG_CONFIG_HOME");
}

TEST_F(SourcesTest, PartsInADefaultPlaceWantAFileBesideThem) {
  sources_.file.clear();
  ::setenv("XDG_CONFIG_HOME", folder_.path("").c_str(), 1);
  ASSERT_EQ(::mkdir(folder_.path("gimnet").c_str(), 0700), 0);
  ASSERT_EQ(::mkdir(folder_.path("gimnet/conf.d").c_str(), 0700), 0);
  write("gimnet/conf.d/a.toml", "hub_id = 77\n");
  ASSERT_THAT(read().faults, SizeIs(1)) << "the parts are not left out unnoticed";
  EXPECT_THAT(read().faults[0].line(), HasSubstr("tcphub.toml: cannot read this file: No such file "
                                                 "or directory; make it, it may be empty"));
  write("gimnet/tcphub.toml", "");
  EXPECT_EQ(read().configuration.options.id, HubId{77});
  EXPECT_EQ(read().file, folder_.path("/gimnet/tcphub.toml"));
  ::unsetenv("XDG_CONFIG_HOME");
}

TEST_F(SourcesTest, HiddenFilesAreNoParts) {
  make_conf_d();
  write("hub.toml", "");
  ASSERT_EQ(::symlink("somebody@here.4711", folder_.path("conf.d/.#20.toml").c_str()), 0);
  write("conf.d/.10.toml", "no TOML");
  write("conf.d/10.toml", "shards = 3\n");
  EXPECT_THAT(read().faults, IsEmpty());
  EXPECT_THAT(read().files, SizeIs(2));
  ASSERT_EQ(::symlink("nowhere", folder_.path("conf.d/20.toml").c_str()), 0);
  EXPECT_THAT(read().faults, SizeIs(1)) << "who is not hidden must be there";
}

TEST_F(SourcesTest, OnlyARegularFileIsRead) {
  const auto fault_of = [this](const std::string& path) {
    sources_.file = path;
    const Faults faults = read().faults;
    return faults.empty() ? "" : faults.front().sentence;
  };
  EXPECT_EQ(fault_of("/dev/null"), "") << "the usual word for no file";
  ASSERT_EQ(::mkfifo(folder_.path("pipe").c_str(), 0600), 0);
  for (const std::string& path : {folder_.path("pipe"), std::string{"/dev/zero"}})
    EXPECT_EQ(fault_of(path),
              "cannot read this file: it is a pipe or a device; put a regular file in its place");
  const int socket = ::socket(AF_UNIX, SOCK_STREAM, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string path = folder_.path("socket");
  path.copy(address.sun_path, sizeof address.sun_path - 1);
  ASSERT_EQ(::bind(socket, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  EXPECT_THAT(fault_of(path), HasSubstr("; give the path of a TOML file"));
  ::close(socket);
}

TEST_F(SourcesTest, AFileThatIsTooLongIsTold) {
  write("hub.toml", std::string(kConfigBytesMax, '#'));
  EXPECT_THAT(read().faults, IsEmpty());
  write("hub.toml", std::string(3 * kConfigBytesMax, '#'));
  ASSERT_THAT(read().faults, SizeIs(1));
  EXPECT_THAT(read().faults[0].line(), HasSubstr("the file is over 1048576 bytes"));
}

TEST_F(SourcesTest, FaultsComeInTheOrderOfTheFile) {
  write("hub.toml", "shards = 99\nx = 1\nhub_id = 0\n");
  std::vector<std::string> lines;
  for (const ConfigFault& fault : read().faults)
    lines.push_back(fault.line().substr(folder_.path("hub.toml").size(), 3));
  EXPECT_THAT(lines, ElementsAre(":1:", ":2:", ":3:"));
}

TEST_F(SourcesTest, OnlySoManyFilesAreRead) {
  make_conf_d();
  write("hub.toml", "");
  for (std::size_t i = 0; i < kConfigFilesMax; ++i)
    write("conf.d/" + std::to_string(i) + ".toml", "");
  write("conf.d/readme", "no TOML");
  EXPECT_THAT(read().faults, IsEmpty());
  EXPECT_THAT(read().files, SizeIs(kConfigFilesMax + 1));
  write("conf.d/one_more.toml", "");
  ASSERT_THAT(read().faults, SizeIs(1));
  EXPECT_THAT(read().faults[0].line(), HasSubstr("at most 256"));
}

}  // namespace
}  // namespace gimnet::hub
