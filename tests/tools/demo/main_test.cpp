#include "tools/demo/options.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <vector>

#include "tests/client/nif/support/runtime_folder.hpp"
#include "tests/tools/demo/temporary_file.hpp"
#include "tools/demo/own_network.hpp"

namespace gimnet::demo {
namespace {

using testing::HasSubstr;
using testing::Not;

constexpr std::int64_t kPatience_ns = 60'000'000'000;

// The program's words, and its end.
struct Outcome {
  int status = -1;
  std::string out;
  std::string err;
};

// The demo as it is shipped, with its own hub and robot.
class RunTest : public testing::Test {
 protected:
  Result<ChildProcess> start(const std::vector<std::string>& arguments) {
    std::vector<std::string> words = {folder_of_this_program() + "/gimnet-demo"};
    words.insert(words.end(), arguments.begin(), arguments.end());
    return ChildProcess::start({"the demo", words, folder_ / "err"});
  }

  Outcome run(const std::vector<std::string>& arguments) {
    Result<ChildProcess> demo = start(arguments);
    if (!demo) return {-1, "", demo.error().sentence};
    return ended(*demo);
  }

  Outcome ended(ChildProcess& demo) {
    Outcome outcome;
    while (Result<std::string> line = demo.read_line(kPatience_ns)) outcome.out += *line + "\n";
    outcome.status = demo.wait(kPatience_ns).value_or(-1);
    outcome.err = said();
    return outcome;
  }

  // Its standard error so far.
  [[nodiscard]] std::string said() const {
    std::ifstream file(folder_ / "err");
    std::ostringstream text;
    text << file.rdbuf();
    return text.str();
  }

  [[nodiscard]] std::ptrdiff_t files_left() const {
    return std::distance(std::filesystem::directory_iterator(folder_.path()),
                         std::filesystem::directory_iterator());
  }

  // The files that the demo's nodes keep for their next life are not among its own.
  const nif::test::RuntimeFolder runtime_;
  TemporaryFolder folder_ = std::move(TemporaryFolder::make().value());
};

TEST_F(RunTest, DrivesACourseByItselfAndLosesNothing) {
  const Outcome outcome = run({"--seconds", "2", "--utf8"});
  EXPECT_EQ(outcome.status, 0) << outcome.out << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("simulation for 2."));
  EXPECT_THAT(outcome.out, HasSubstr("exact"));
  EXPECT_THAT(outcome.out, HasSubstr("Nothing was lost."));
  EXPECT_THAT(outcome.out, Not(HasSubstr("\x1b")));
  EXPECT_THAT(outcome.err, HasSubstr("odom"));
}

TEST_F(RunTest, PlaysALog) {
  std::string log;
  for (int step = 0; step < 200; ++step) {
    const std::string stamp = std::to_string(step * 0.02);
    log += "ODOM " + std::to_string(step * 0.01) + " 0 0 0 0 0 " + stamp + " host " + stamp + "\n";
    if (step % 10 == 0) log += "FLASER 3 1 2 1 0 0 0 0 0 0 " + stamp + " host " + stamp + "\n";
  }
  const TemporaryFile file(log, true);
  const Outcome outcome = run({"--log", file.path(), "--seconds", "1.5", "--speed", "2"});
  EXPECT_EQ(outcome.status, 0) << outcome.out << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("Nothing was lost."));
}

TEST_F(RunTest, PlaysALogOfWhichSomeLinesCannotBeRead) {
  std::string log = "garbage\n";
  for (int step = 0; step < 50; ++step) {
    const std::string stamp = std::to_string(step * 0.02);
    log += "ODOM " + std::to_string(step * 0.01) + " 0 0 0 0 0 " + stamp + " host " + stamp + "\n";
  }
  log += "ODOM 1 2 3 0";  // the recorder was killed
  const TemporaryFile file(log, false);
  const Outcome outcome = run({"--log", file.path(), "--seconds", "60"});
  EXPECT_EQ(outcome.status, 0) << outcome.out << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("Nothing was lost."));
  EXPECT_THAT(outcome.err,
              HasSubstr("skipped 2 lines of the log that cannot be read; the first is " +
                        file.path() + ":1: "));
}

TEST_F(RunTest, PlaysALogThatHoldsOnlyScans) {
  std::string log;
  for (int step = 0; step < 20; ++step) {
    const std::string stamp = std::to_string(step * 0.02);
    log += "FLASER 3 1 2 1 5 6 0 5 6 0 " + stamp + " host " + stamp + "\n";
  }
  const TemporaryFile file(log, false);
  const Outcome outcome = run({"--log", file.path(), "--seconds", "60"});
  EXPECT_EQ(outcome.status, 0) << outcome.out << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("Nothing was lost."));
}

TEST_F(RunTest, ASignalEndsItWithASummaryAndNothingIsLeft) {
  ASSERT_EQ(::setenv("TMPDIR", folder_.path().c_str(), 1), 0);
  Result<ChildProcess> demo = start({});
  ASSERT_TRUE(demo);
  // Something is heard once a line of progress is there.
  std::string err;
  while (err.find("odom") == std::string::npos) {
    ASSERT_FALSE(demo->ended());
    std::ifstream file(folder_ / "err");
    std::getline(file, err);
  }
  ASSERT_EQ(::unsetenv("TMPDIR"), 0);
  EXPECT_EQ(files_left(), 2);
  ASSERT_EQ(::kill(demo->id(), SIGINT), 0);
  const Outcome outcome = ended(*demo);
  EXPECT_EQ(files_left(), 1);
  EXPECT_EQ(outcome.status, 0) << outcome.out << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("Nothing was lost."));
}

TEST_F(RunTest, ClosesDownWhereNobodyReadsAnyMore) {
  ASSERT_EQ(::setenv("TMPDIR", folder_.path().c_str(), 1), 0);
  const std::string program = folder_of_this_program() + "/gimnet-demo";
  Result<ChildProcess> shell = ChildProcess::start(
      {"the shell",
       {"/bin/sh", "-c", "{ " + program + " --seconds 1; echo $? >&2; } | true"},
       folder_ / "err"});
  ASSERT_EQ(::unsetenv("TMPDIR"), 0);
  ASSERT_TRUE(shell);
  EXPECT_EQ(shell->wait(kPatience_ns), 0);
  EXPECT_THAT(said(), testing::EndsWith("\n0\n"));
  EXPECT_EQ(files_left(), 1);
}

TEST_F(RunTest, SaysThatItsSummaryCouldNotBeWritten) {
  const std::string program = folder_of_this_program() + "/gimnet-demo";
  for (const char* words : {" --seconds 0.5 >/dev/full", " --help >/dev/full", " --help >&-"}) {
    Result<ChildProcess> shell = ChildProcess::start(
        {"the shell", {"/bin/sh", "-c", program + words + "; echo $? >&2"}, folder_ / "err"});
    ASSERT_TRUE(shell);
    EXPECT_EQ(shell->wait(kPatience_ns), 0);
    EXPECT_THAT(said(), HasSubstr("gimnet-demo: cannot write to standard output: ")) << words;
    EXPECT_THAT(said(), testing::EndsWith("\n1\n")) << words;
  }
}

TEST_F(RunTest, SaysThatTheHubEndedAndWhatWasHeardBefore) {
  Result<ChildProcess> demo = start({"--seconds", "86400"});
  ASSERT_TRUE(demo);
  while (said().find("odom") == std::string::npos) ASSERT_FALSE(demo->ended());
  // Its first child is the hub.
  const std::string id = std::to_string(demo->id());
  std::ifstream children("/proc/" + id + "/task/" + id + "/children");
  pid_t hub = 0;
  ASSERT_TRUE(children >> hub);
  ASSERT_EQ(::kill(hub, SIGKILL), 0);
  const Outcome outcome = ended(*demo);
  EXPECT_NE(outcome.status, 0);
  EXPECT_THAT(outcome.err, HasSubstr("the hub was ended by signal 9"));
  EXPECT_THAT(outcome.out, HasSubstr("simulation for "));
  EXPECT_THAT(outcome.out, HasSubstr("Not as it should be:"));
}

TEST_F(RunTest, BadArgumentsAreExplained) {
  const Outcome outcome = run({"--sceonds", "2"});
  EXPECT_EQ(outcome.status, 2);
  EXPECT_THAT(outcome.err, HasSubstr("there is no argument '--sceonds'"));
  EXPECT_EQ(run({"--help"}).status, 0);
}

TEST_F(RunTest, AnUnusableLogIsRefusedBeforeAnythingStarts) {
  EXPECT_EQ(run({"--log", "/nowhere.log"}).status, 2);
  const TemporaryFile garbage("not a log\n");
  const Outcome outcome = run({"--log", garbage.path()});
  EXPECT_EQ(outcome.status, 2);
  EXPECT_THAT(outcome.err, HasSubstr(garbage.path() + ":1: the line begins with \"not\""));
}

TEST_F(RunTest, AViewerWithoutAHubSaysSo) {
  EXPECT_EQ(run({"view", "--hub", "unix:" + (folder_ / "none.sock")}).status, 3);
}

}  // namespace
}  // namespace gimnet::demo
