#include "tools/demo/temporary_folder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

namespace gimnet::demo {
namespace {

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

}  // namespace
}  // namespace gimnet::demo
