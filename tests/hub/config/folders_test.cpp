#include "hub/config/folders.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>

#include "tests/hub/control/support/folder.hpp"

namespace gimnet::hub {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

mode_t mode_of(const std::string& path) {
  struct stat info{};
  EXPECT_EQ(::stat(path.c_str(), &info), 0);
  return info.st_mode & 0777;
}

TEST(Folders, APrivateFolderIsCreatedForOneUser) {
  const TestFolder folder;
  EXPECT_EQ(prepare_private_folder(folder.path("run")), "");
  EXPECT_EQ(mode_of(folder.path("run")), 0700u);
  EXPECT_EQ(prepare_private_folder(folder.path("run")), "");
}

TEST(Folders, AFolderThatOthersCanEnterIsRefused) {
  const TestFolder folder;
  ASSERT_EQ(::mkdir(folder.path("run").c_str(), 0700), 0);
  ASSERT_EQ(::chmod(folder.path("run").c_str(), 0770), 0);
  EXPECT_THAT(prepare_private_folder(folder.path("run")), HasSubstr("chmod 700"));
}

TEST(Folders, AnotherUsersFolderIsRefused) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root can give a folder away";
  const TestFolder folder;
  ASSERT_EQ(::mkdir(folder.path("run").c_str(), 0700), 0);
  ASSERT_EQ(::chown(folder.path("run").c_str(), 12'345, 12'345), 0);
  EXPECT_THAT(prepare_private_folder(folder.path("run")), HasSubstr("another user"));
}

TEST(Folders, AFolderThatNothingCanBePutIntoIsRefused) {
  constexpr uid_t kOther = 12'345;
  const TestFolder folder;
  ASSERT_EQ(::mkdir(folder.path("run").c_str(), 0700), 0);
  const bool root = ::geteuid() == 0;
  if (root) {  // who may write everywhere: it acts for another user, whose folder it is
    ASSERT_EQ(::chmod(folder.path("").c_str(), 0755), 0);
    ASSERT_EQ(::chown(folder.path("run").c_str(), kOther, kOther), 0);
    ASSERT_EQ(::seteuid(kOther), 0);
  }
  EXPECT_EQ(prepare_private_folder(folder.path("run")), "");
  for (const mode_t mode : {0500u, 0600u, 0000u}) {
    ASSERT_EQ(::chmod(folder.path("run").c_str(), mode), 0);
    EXPECT_THAT(
        prepare_private_folder(folder.path("run")),
        AllOf(HasSubstr("Permission denied"), HasSubstr("chmod 700 " + folder.path("run"))));
  }
  ASSERT_EQ(::chmod(folder.path("run").c_str(), 0700), 0);
  if (root) {
    ASSERT_EQ(::seteuid(0), 0);
  }
}

TEST(Folders, ALinkIsNoPrivateFolder) {
  const TestFolder folder;
  ASSERT_EQ(::mkdir(folder.path("target").c_str(), 0700), 0);
  ASSERT_EQ(::symlink(folder.path("target").c_str(), folder.path("run").c_str()), 0);
  EXPECT_THAT(prepare_private_folder(folder.path("run")), HasSubstr("not a folder"));
}

TEST(Folders, TheRuntimeFolderFollowsTheEnvironment) {
  const TestFolder folder;
  ::setenv("XDG_RUNTIME_DIR", folder.path("").c_str(), 1);
  const auto given = runtime_folder();
  ASSERT_TRUE(given);
  EXPECT_EQ(mode_of(*given), 0700u);
  ::unsetenv("XDG_RUNTIME_DIR");
  ::setenv("TMPDIR", folder.path("").c_str(), 1);
  const auto fallback = runtime_folder();
  ASSERT_TRUE(fallback);
  EXPECT_THAT(*fallback, ::testing::EndsWith("/gimnet-" + std::to_string(::geteuid())));
  EXPECT_EQ(mode_of(*fallback), 0700u);
  ::unsetenv("TMPDIR");
}

TEST(Folders, AStateFolderIsCreatedOrUsed) {
  const TestFolder folder;
  EXPECT_EQ(prepare_state_folder(folder.path("state")), "");
  EXPECT_EQ(mode_of(folder.path("state")), 0700u);
  EXPECT_EQ(prepare_state_folder(folder.path("state")), "");
  std::ofstream(folder.path("file")) << "x";
  EXPECT_THAT(prepare_state_folder(folder.path("file")),
              AllOf(HasSubstr("not a folder"), HasSubstr("--state-dir")));
}

TEST(Folders, AnotherUsersStateFolderIsRefused) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root can give a folder away";
  const TestFolder folder;
  ASSERT_EQ(prepare_state_folder(folder.path("state")), "");
  ASSERT_EQ(::chown(folder.path("state").c_str(), 12'345, 12'345), 0);
  EXPECT_THAT(prepare_state_folder(folder.path("state")),
              AllOf(HasSubstr("another user"), HasSubstr("--state-dir")))
      << "root, too: that user could put other files into it";
}

TEST(Folders, RootMakesNothingInTheHomeOfAnotherUser) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root can give a folder away";
  const TestFolder folder;
  ASSERT_EQ(::mkdir(folder.path("home").c_str(), 0755), 0);
  ::unsetenv("STATE_DIRECTORY");
  ::unsetenv("XDG_STATE_HOME");
  ::setenv("HOME", folder.path("home").c_str(), 1);
  EXPECT_TRUE(default_state_folder("hub"));
  ASSERT_EQ(::chown(folder.path("home").c_str(), 12'345, 12'345), 0);
  const auto place = default_state_folder("hub");
  ASSERT_FALSE(place);
  EXPECT_THAT(place.error().sentence, HasSubstr("belongs to another user"));
}

TEST(Folders, AStateFolderThatCannotBeMadeIsToldWithTheRemedy) {
  const TestFolder folder;
  std::ofstream(folder.path("file")) << "x";
  const auto fault = [&](const std::string& name) {
    return prepare_state_folder(folder.path(name));
  };
  EXPECT_EQ(fault("none/state"), "cannot create the folder " + folder.path("none/state") +
                                     ": No such file or directory; make " + folder.path("none") +
                                     " first, or name another place with --state-dir");
  EXPECT_THAT(fault("file/state"), HasSubstr("; a part of " + folder.path("file") +
                                             " is no folder: name another place"));
  EXPECT_THAT(fault(std::string(256, 'n')),
              HasSubstr("; name another place with --state-dir, with a shorter path"));
  EXPECT_THAT(prepare_state_folder("/proc/state"),
              HasSubstr(": No such file or directory; name another place"));
  ASSERT_EQ(::symlink(folder.path("nowhere").c_str(), folder.path("dangling").c_str()), 0);
  EXPECT_EQ(fault("dangling"), "cannot use the folder " + folder.path("dangling") +
                                   ": it is a link, and No such file or directory; remove it, or "
                                   "name another place with --state-dir");
  ASSERT_EQ(::symlink("round", folder.path("round").c_str()), 0);
  EXPECT_THAT(fault("round"), AllOf(HasSubstr("it is a link, and Too many levels"),
                                    HasSubstr("; remove it, or name")));
}

TEST(Folders, AStateFolderWhereNothingMayBeMadeIsToldWithTheRemedy) {
  const TestFolder folder;
  const bool root = ::geteuid() == 0;
  ASSERT_EQ(::chmod(folder.path("").c_str(), 0555), 0);
  if (root) {  // who may write everywhere: it acts for another user
    ASSERT_EQ(::seteuid(12'345), 0);
  }
  const std::string said = prepare_state_folder(folder.path("state"));
  const std::string above = folder.path("state").substr(0, folder.path("state").rfind('/'));
  if (root) {
    ASSERT_EQ(::seteuid(0), 0);
  }
  ASSERT_EQ(::chmod(folder.path("").c_str(), 0700), 0);
  EXPECT_EQ(said, "cannot create the folder " + folder.path("state") +
                      ": Permission denied; run tcphub as a user that may write to " + above +
                      ", or name another place with --state-dir");
}

}  // namespace
}  // namespace gimnet::hub
