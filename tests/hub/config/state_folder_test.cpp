#include "hub/config/state_folder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "base/log.hpp"
#include "tests/hub/control/support/folder.hpp"

namespace gimnet::hub {
namespace {

using ::testing::HasSubstr;

HubState some_state(std::uint64_t boot = 3) {
  HubState state;
  state.secret.fill(std::byte{0x5a});
  state.boot = boot;
  return state;
}

class StateFolderTest : public ::testing::Test {
 protected:
  std::string path() const { return folder_.path("state-folder"); }
  std::string file(const std::string& name) const { return path() + "/" + name; }
  /// Keeps something and lets the folder go again.
  void keep() {
    const auto folder = StateFolder::open(path());
    ASSERT_TRUE(folder);
    ASSERT_EQ((*folder)->write(some_state()), "");
  }
  std::string read_fault() const {
    const auto folder = StateFolder::open(path());
    if (!folder) return folder.error().sentence;
    const auto found = (*folder)->read();
    return found ? "" : found.error().sentence;
  }
  static mode_t mode_of(const std::string& name) {
    struct stat info{};
    EXPECT_EQ(::stat(name.c_str(), &info), 0) << name;
    return info.st_mode & 0777;
  }

  TestFolder folder_;
};

TEST_F(StateFolderTest, KeepsStateInFilesOfOneUser) {
  {
    const auto folder = StateFolder::open(path());
    ASSERT_TRUE(folder);
    EXPECT_FALSE((*folder)->was_used());
    EXPECT_FALSE((*folder)->read()->has_value());
    EXPECT_EQ((*folder)->write(some_state(3)), "");
    EXPECT_EQ((*folder)->write(some_state(4)), "");
  }
  EXPECT_EQ(mode_of(path()), 0700u);
  EXPECT_EQ(mode_of(file("state")), 0600u);
  EXPECT_EQ(mode_of(file("lock")), 0600u);
  EXPECT_FALSE(std::filesystem::exists(file("state.new")));
  const auto again = StateFolder::open(path());
  ASSERT_TRUE(again);
  EXPECT_TRUE((*again)->was_used());
  EXPECT_EQ(**(*again)->read(), some_state(4));
}

TEST_F(StateFolderTest, FilesOfAnotherUserAreRefused) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root can give a file away";
  keep();
  for (const char* name : {"state", "lock"}) {
    ASSERT_EQ(::chown(file(name).c_str(), 12'345, 12'345), 0);
    EXPECT_THAT(read_fault(), HasSubstr(file(name) + ": it belongs to another user"));
    ASSERT_EQ(::chown(file(name).c_str(), 0, 0), 0);
  }
  EXPECT_EQ(read_fault(), "");
}

TEST_F(StateFolderTest, AHubThatKeptNothingIsNoHub) {
  {
    const auto folder = StateFolder::open(path());
    ASSERT_TRUE(folder);
    ASSERT_EQ(::mkdir(file("state.new").c_str(), 0700), 0);
    EXPECT_NE((*folder)->write(some_state()), "");
    ASSERT_EQ(::rmdir(file("state.new").c_str()), 0);
  }
  EXPECT_FALSE((*StateFolder::open(path()))->was_used());
  keep();
  const auto again = StateFolder::open(path());
  ASSERT_TRUE(again);
  EXPECT_TRUE((*again)->was_used());
  EXPECT_TRUE((*again)->read()->has_value());
}

/// In a process of its own: the limit is for all of it.
int leave_no_part_where_no_file_may_grow(const std::string& path) {
  std::signal(SIGXFSZ, SIG_IGN);
  const rlimit limit{.rlim_cur = 0, .rlim_max = 0};
  if (::setrlimit(RLIMIT_FSIZE, &limit) != 0) return 1;
  {
    const auto folder = StateFolder::open(path);
    if (!folder) return 2;
    if ((*folder)->write(some_state()).find("(write): File too large") == std::string::npos)
      return 3;
  }
  return std::filesystem::exists(path + "/state.new") ? 4 : 0;
}

TEST_F(StateFolderTest, APartOfAStateIsNotLeftBehind) {
  EXPECT_EXIT(::_exit(leave_no_part_where_no_file_may_grow(path())), testing::ExitedWithCode(0),
              "");
}

TEST_F(StateFolderTest, WhereNothingWasKeptTheNextOneIsTheFirst) {
  auto first = StateFolder::open(path());
  ASSERT_TRUE(first);
  *first = nullptr;
  const auto second = StateFolder::open(path());
  ASSERT_TRUE(second);
  EXPECT_FALSE((*second)->was_used());
  EXPECT_FALSE(StateFolder::open(path())) << "it is in use";
}

/// A hub leaves one that kept nothing, or could not lock it.
TEST_F(StateFolderTest, ALockThatNobodyHadIsNoSignOfAHub) {
  ASSERT_EQ(::mkdir(path().c_str(), 0700), 0);
  std::ofstream(file("lock")).close();
  ASSERT_EQ(::chmod(file("lock").c_str(), 0600), 0);
  const auto folder = StateFolder::open(path());
  ASSERT_TRUE(folder) << folder.error().sentence;
  EXPECT_FALSE((*folder)->was_used());
}

TEST_F(StateFolderTest, ALockOrAStateIsTheSignOfAHub) {
  for (const char* name : {"lock", "state"}) {
    keep();
    ASSERT_EQ(::unlink(file(name).c_str()), 0);
    const auto folder = StateFolder::open(path());
    ASSERT_TRUE(folder) << folder.error().sentence;
    EXPECT_TRUE((*folder)->was_used()) << "without " << name;
  }
}

TEST_F(StateFolderTest, ASecondHubIsToldWhoHasIt) {
  const auto first = StateFolder::open(path());
  ASSERT_TRUE(first);
  const auto second = StateFolder::open(path());
  ASSERT_FALSE(second);
  EXPECT_THAT(second.error().sentence, HasSubstr("in use by"));
  EXPECT_THAT(second.error().sentence, HasSubstr("process " + std::to_string(::getpid())));
  EXPECT_THAT(second.error().sentence, HasSubstr("--state-dir"));
}

TEST_F(StateFolderTest, DamageIsToldWithTheRemedy) {
  keep();
  std::ofstream(file("state"), std::ios::binary | std::ios::in).write("X", 1);
  EXPECT_THAT(read_fault(), HasSubstr(file("state")));
  EXPECT_THAT(read_fault(), HasSubstr("move it away"));
  std::filesystem::resize_file(file("state"), 0);
  EXPECT_THAT(read_fault(), HasSubstr("too short"));
  std::filesystem::resize_file(file("state"), std::uintmax_t{1} << 40);
  EXPECT_THAT(read_fault(), HasSubstr("too long"));
}

TEST_F(StateFolderTest, FilesThatOthersMayReadOrThatAreNoneAreRefused) {
  keep();
  ASSERT_EQ(::chmod(file("state").c_str(), 0640), 0);
  EXPECT_THAT(read_fault(), HasSubstr("chmod 600"));
  ASSERT_EQ(::unlink(file("state").c_str()), 0);
  ASSERT_EQ(::symlink("/etc/passwd", file("state").c_str()), 0);
  EXPECT_EQ(
      read_fault(),
      "cannot read " + file("state") +
          ": it is a link, and links are not followed; put a file in its place, or remove it");
  ASSERT_EQ(::unlink(file("state").c_str()), 0);
  ASSERT_EQ(::mkfifo(file("state").c_str(), 0600), 0);
  EXPECT_THAT(read_fault(), HasSubstr("not a file"));
}

TEST_F(StateFolderTest, ALinkIsNotWrittenThrough) {
  keep();
  std::ofstream(folder_.path("precious")) << "precious";
  ASSERT_EQ(::symlink(folder_.path("precious").c_str(), file("state.new").c_str()), 0);
  keep();
  std::string content;
  std::ifstream(folder_.path("precious")) >> content;
  EXPECT_EQ(content, "precious");
  EXPECT_TRUE(std::filesystem::is_regular_file(std::filesystem::symlink_status(file("state"))));
}

TEST_F(StateFolderTest, ALinkOrAFolderIsNoLock) {
  ASSERT_EQ(::mkdir(path().c_str(), 0700), 0);
  ASSERT_EQ(::symlink(folder_.path("elsewhere").c_str(), file("lock").c_str()), 0);
  EXPECT_EQ(
      read_fault(),
      "cannot use " + file("lock") +
          ": it is a link, and links are not followed; put a file in its place, or remove it");
  EXPECT_FALSE(std::filesystem::exists(folder_.path("elsewhere")));
  ASSERT_EQ(::unlink(file("lock").c_str()), 0);
  ASSERT_EQ(::mkdir(file("lock").c_str(), 0700), 0);
  EXPECT_EQ(read_fault(), "cannot use " + file("lock") + ": it is a folder; remove it");
}

TEST_F(StateFolderTest, AFolderThatOthersMayWriteToIsRefused) {
  keep();
  ASSERT_EQ(::chmod(path().c_str(), 0770), 0);
  EXPECT_THAT(read_fault(), HasSubstr("chmod go-w"));
}

TEST_F(StateFolderTest, WhatCannotBeWrittenLeavesWhatWasThere) {
  keep();
  const auto folder = StateFolder::open(path());
  ASSERT_TRUE(folder);
  ASSERT_EQ(::mkdir(file("state.new").c_str(), 0700), 0);  // in the way, whoever runs the test
  const std::string error = (*folder)->write(some_state(9));
  EXPECT_EQ(error, "cannot write the hub's state: " + file("state.new") +
                       " is in the way: it is a folder; remove it");
  EXPECT_EQ((*(*folder)->read())->boot, 3u);
}

TEST_F(StateFolderTest, AFolderInThePlaceOfTheStateIsTold) {
  const auto folder = StateFolder::open(path());
  ASSERT_TRUE(folder);
  ASSERT_EQ(::mkdir(file("state").c_str(), 0700), 0);
  EXPECT_THAT((*folder)->write(some_state()),
              ::testing::AllOf(HasSubstr("cannot write the hub's state to " + file("state")),
                               HasSubstr("it is a folder: remove it")));
}

}  // namespace
}  // namespace gimnet::hub
