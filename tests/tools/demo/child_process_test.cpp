#include "tools/demo/child_process.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <unistd.h>

#include <csignal>

#include "tools/demo/own_network.hpp"

namespace gimnet::demo {
namespace {

using testing::HasSubstr;

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
