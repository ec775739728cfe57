#include "tools/demo/own_network.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>

namespace gimnet::demo {
namespace {

using testing::HasSubstr;

// Puts a shell script in the place of a program.
void plant(const TemporaryFolder& folder, const std::string& name, const std::string& script) {
  const std::string path = folder / name;
  std::ofstream(path) << "#!/bin/sh\n" << script << "\n";
  std::filesystem::permissions(path, std::filesystem::perms::owner_all);
}

TEST(ReadyLine, NamesBothAddresses) {
  const HubAddresses addresses =
      parse_ready_line("ready tcp://127.0.0.1:41233 unix:/tmp/x/hub.sock").value();
  EXPECT_EQ(addresses.tcp, "tcp://127.0.0.1:41233");
  EXPECT_EQ(addresses.unix_socket, "unix:/tmp/x/hub.sock");
}

TEST(ReadyLine, AnotherLineIsRefused) {
  for (const char* line :
       {"", "ready", "ready tcp://127.0.0.1:1", "steady tcp://127.0.0.1:1 unix:/x"}) {
    EXPECT_THAT(parse_ready_line(line).error().sentence, HasSubstr("instead of 'ready'")) << line;
  }
}

TEST(OwnNetwork, SaysThatTheHubIsMissing) {
  const TemporaryFolder programs = std::move(TemporaryFolder::make().value());
  EXPECT_THAT(OwnNetwork::start(DemoOptions{}, programs.path()).error().sentence,
              HasSubstr("cannot start the hub"));
}

TEST(OwnNetwork, PassesOnWhyTheHubDoesNotStart) {
  const TemporaryFolder programs = std::move(TemporaryFolder::make().value());
  plant(programs, "tcphub", "echo 'no room' >&2; exit 1");
  EXPECT_THAT(OwnNetwork::start(DemoOptions{}, programs.path()).error().sentence,
              HasSubstr("ended at once: no room"));
}

TEST(OwnNetwork, GivesTheRobotItsArgumentsAndNoticesItsEnd) {
  const TemporaryFolder programs = std::move(TemporaryFolder::make().value());
  plant(programs, "tcphub", "echo ready tcp://127.0.0.1:1 unix:/x; exec tail -f /dev/null");
  plant(programs, "gimnet-demo", "echo ready; echo \"$*\" >&2; exit 3");
  DemoOptions options;
  options.log = "a b.log";
  options.speed = 2.5;
  Result<OwnNetwork> network = OwnNetwork::start(options, programs.path());
  ASSERT_TRUE(network) << network.error().sentence;
  EXPECT_EQ(network->hub_url(), "tcp://127.0.0.1:1");
  std::optional<Error> trouble;
  while (!trouble) trouble = network->trouble();
  EXPECT_THAT(
      trouble->sentence,
      HasSubstr("the robot ended by itself with status 3: robot --hub unix:/x --robot robot "
                "--log a b.log --speed 2.5"));
}

TEST(OwnNetwork, FindsTheFolderOfThisProgram) {
  EXPECT_TRUE(std::filesystem::is_directory(folder_of_this_program()));
}

TEST(TemporaryFolder, GoesWithEverythingInIt) {
  std::string path;
  {
    Result<TemporaryFolder> folder = TemporaryFolder::make();
    ASSERT_TRUE(folder);
    path = folder->path();
    std::ofstream(*folder / "file") << "text";
    EXPECT_TRUE(std::filesystem::exists(path + "/file"));
    EXPECT_EQ(std::filesystem::status(path).permissions(), std::filesystem::perms::owner_all);
    const TemporaryFolder moved = std::move(*folder);
    EXPECT_EQ(moved.path(), path);
  }
  EXPECT_FALSE(std::filesystem::exists(path));
}

TEST(TemporaryFolder, SaysThatThereIsNoPlace) {
  ASSERT_EQ(::setenv("TMPDIR", "/nowhere", 1), 0);
  const Result<TemporaryFolder> folder = TemporaryFolder::make();
  ASSERT_EQ(::unsetenv("TMPDIR"), 0);
  ASSERT_FALSE(folder);
  EXPECT_THAT(folder.error().sentence, testing::HasSubstr("cannot make a folder in /nowhere"));
}

TEST(TemporaryFolder, ASocketStillFitsWhereTheGivenPlaceIsTooDeep) {
  ASSERT_EQ(::setenv("TMPDIR", ("/tmp/" + std::string(100, 'x')).c_str(), 1), 0);
  const Result<TemporaryFolder> folder = TemporaryFolder::make();
  ASSERT_EQ(::unsetenv("TMPDIR"), 0);
  ASSERT_TRUE(folder);
  EXPECT_LT((*folder / "hub.sock").size(), 107U);
}

constexpr std::int64_t kLong_ns = 10'000'000'000;

class ChildProcessTest : public testing::Test {
 protected:
  Result<ChildProcess> shell(const std::string& script) {
    return ChildProcess::start({"the shell", {"/bin/sh", "-c", script}, folder_ / "log"});
  }

  TemporaryFolder folder_ = std::move(TemporaryFolder::make().value());
};

TEST_F(ChildProcessTest, GivesItsLines) {
  Result<ChildProcess> child = shell("echo one; echo two; read never");
  ASSERT_TRUE(child);
  EXPECT_EQ(child->read_line(kLong_ns).value(), "one");
  EXPECT_EQ(child->read_line(kLong_ns).value(), "two");
  EXPECT_EQ(child->wait(kLong_ns), 1);
}

TEST_F(ChildProcessTest, TellsTheLastWordsOfAChildThatFails) {
  Result<ChildProcess> child = shell("echo 'cannot bind' >&2; exit 7");
  ASSERT_TRUE(child);
  const Result<std::string> line = child->read_line(kLong_ns);
  ASSERT_FALSE(line);
  EXPECT_THAT(line.error().sentence, HasSubstr("the shell ended at once: cannot bind"));
  EXPECT_THAT(child->ended()->sentence, HasSubstr("with status 7"));
}

TEST_F(ChildProcessTest, TellsTheSignalThatEndedAChild) {
  Result<ChildProcess> child = shell("kill -9 $$");
  ASSERT_TRUE(child);
  EXPECT_FALSE(child->read_line(kLong_ns));
  EXPECT_THAT(child->ended()->sentence, HasSubstr("the shell was ended by signal 9 (Killed)"));
}

TEST_F(ChildProcessTest, DoesNotWaitForeverForALine) {
  Result<ChildProcess> child = shell("exec tail -f /dev/null");
  ASSERT_TRUE(child);
  EXPECT_THAT(child->read_line(1'000'000).error().sentence, HasSubstr("not ready"));
  EXPECT_FALSE(child->ended());
}

TEST_F(ChildProcessTest, EndsAChildThatIsAskedTo) {
  Result<ChildProcess> child = shell("echo ready; exec tail -f /dev/null");
  ASSERT_TRUE(child);
  ASSERT_TRUE(child->read_line(kLong_ns));
  const pid_t id = child->id();
  EXPECT_EQ(::kill(id, 0), 0);
  child->end();
  EXPECT_EQ(::kill(id, 0), -1);
}

TEST_F(ChildProcessTest, HasAGroupOfItsOwn) {
  Result<ChildProcess> child = shell("echo ready; exec tail -f /dev/null");
  ASSERT_TRUE(child);
  ASSERT_TRUE(child->read_line(kLong_ns));
  EXPECT_EQ(::getpgid(child->id()), child->id());
}

TEST_F(ChildProcessTest, SaysWhichProgramIsMissing) {
  const Result<ChildProcess> child =
      ChildProcess::start({"the hub", {"/nowhere/tcphub"}, folder_ / "log"});
  ASSERT_FALSE(child);
  EXPECT_THAT(child.error().sentence, HasSubstr("cannot start the hub: /nowhere/tcphub"));
}

}  // namespace
}  // namespace gimnet::demo
