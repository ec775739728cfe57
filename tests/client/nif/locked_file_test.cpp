#include "client/nif/locked_file.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <fstream>

#include "tests/client/nif/support/runtime_folder.hpp"

namespace gimnet::nif::test {
namespace {

using State = LockedFile::State;

std::span<const std::byte> bytes_of(std::string_view text) {
  return std::as_bytes(std::span{text});
}

std::string content_of(const LockedFile& file) {
  std::array<std::byte, 16> memory{};
  const std::size_t size = file.read(memory);
  return {reinterpret_cast<const char*>(memory.data()), size};
}

mode_t mode_of(const std::string& path) {
  struct stat info{};
  EXPECT_EQ(::lstat(path.c_str(), &info), 0) << path;
  return info.st_mode & 0777;
}

TEST(PrivateFolder, IsMadeForOneUser) {
  const RuntimeFolder runtime;
  const PrivateFolder folder;
  EXPECT_EQ(folder.fault(), "");
  EXPECT_EQ(mode_of(runtime.path() + "/gimnet"), 0700u);
  EXPECT_EQ(mode_of(runtime.tokens()), 0700u);
}

TEST(PrivateFolder, IsNamedAfterTheUserWhereThereIsNoRuntimeFolder) {
  const RuntimeFolder somewhere;
  const Environment none("XDG_RUNTIME_DIR", "");
  const Environment temporary("TMPDIR", somewhere.path().c_str());
  EXPECT_EQ(PrivateFolder().fault(), "");
  const std::string own = somewhere.path() + "/gimnet-" + std::to_string(::getuid());
  EXPECT_EQ(mode_of(own), 0700u);
  // Not closed to others; a link; another user's.
  ASSERT_EQ(::chmod(own.c_str(), 0750), 0);
  EXPECT_NE(PrivateFolder().fault().find("chmod 700 " + own), std::string::npos);
  std::filesystem::remove_all(own);
  ASSERT_EQ(::symlink(somewhere.path().c_str(), own.c_str()), 0);
  EXPECT_NE(PrivateFolder().fault(), "");
  std::filesystem::remove(own);
  if (::geteuid() == 0) {
    ASSERT_EQ(::mkdir(own.c_str(), 0700), 0);
    ASSERT_EQ(::chown(own.c_str(), 12'345, 12'345), 0);
    EXPECT_NE(PrivateFolder().fault().find("another user"), std::string::npos);
  }
}

TEST(PrivateFolder, SaysThatItsPlaceIsNotThere) {
  const Environment nowhere("XDG_RUNTIME_DIR", "/nonexistent/gimnet");
  EXPECT_NE(PrivateFolder().fault().find("/nonexistent/gimnet"), std::string::npos);
}

TEST(LockedFile, KeepsItsContentWhenItIsClosed) {
  const RuntimeFolder runtime;
  const PrivateFolder folder;
  LockedFile file;
  EXPECT_EQ(file.open(folder, "a", false), State::missing);
  ASSERT_EQ(file.open(folder, "a", true), State::open);
  EXPECT_EQ(mode_of(runtime.tokens() + "/a"), 0600u);
  EXPECT_TRUE(file.write(bytes_of("longer")));
  EXPECT_TRUE(file.write(bytes_of("new")));
  file.close();
  ASSERT_EQ(file.open(folder, "a", false), State::open);
  EXPECT_EQ(content_of(file), "new");
  file.remove(folder, "a");
  EXPECT_FALSE(std::filesystem::exists(runtime.tokens() + "/a"));
  EXPECT_EQ(file.open(folder, "a", false), State::missing);
}

TEST(LockedFile, IsOpenOnceAtATime) {
  const RuntimeFolder runtime;
  const PrivateFolder folder;
  LockedFile first;
  LockedFile second;
  ASSERT_EQ(first.open(folder, "a", true), State::open);
  EXPECT_EQ(second.open(folder, "a", true), State::in_use);
  EXPECT_FALSE(second.is_open());
  LockedFile moved = std::move(first);
  EXPECT_EQ(second.open(folder, "a", true), State::in_use);
  moved.close();
  EXPECT_EQ(second.open(folder, "a", true), State::open);
}

TEST(LockedFile, RefusesWhatIsNoFileOfThisUserAlone) {
  const RuntimeFolder runtime;
  const PrivateFolder folder;
  const std::string path = runtime.tokens() + "/a";
  LockedFile file;
  ASSERT_EQ(::symlink("/etc/passwd", path.c_str()), 0);
  EXPECT_EQ(file.open(folder, "a", true), State::refused);
  ASSERT_EQ(::unlink(path.c_str()), 0);
  ASSERT_EQ(::mkfifo(path.c_str(), 0600), 0);
  EXPECT_EQ(file.open(folder, "a", true), State::refused);
  ASSERT_EQ(::unlink(path.c_str()), 0);
  ASSERT_EQ(::mkdir(path.c_str(), 0700), 0);
  EXPECT_EQ(file.open(folder, "a", true), State::refused);
  ASSERT_EQ(::rmdir(path.c_str()), 0);
  std::ofstream(path) << "x";
  ASSERT_EQ(::chmod(path.c_str(), 0644), 0);
  EXPECT_EQ(file.open(folder, "a", true), State::refused);
  ASSERT_EQ(::chmod(path.c_str(), 0600), 0);
  EXPECT_EQ(file.open(folder, "a", true), State::open);
}

TEST(LockedFile, DoesNotRemoveAnotherFileOfItsName) {
  const RuntimeFolder runtime;
  const PrivateFolder folder;
  const std::string path = runtime.tokens() + "/a";
  LockedFile first;
  ASSERT_EQ(first.open(folder, "a", true), State::open);
  ASSERT_EQ(::unlink(path.c_str()), 0);
  LockedFile second;
  ASSERT_EQ(second.open(folder, "a", true), State::open) << "a new file, which nobody has locked";
  first.remove(folder, "a");
  EXPECT_TRUE(std::filesystem::exists(path));
}

TEST(LockedFile, AChildOfAProgramThatDiedDoesNotKeepItLocked) {
  const RuntimeFolder runtime;
  const PrivateFolder folder;
  std::array<int, 2> alive{};
  std::array<int, 2> gate{};
  ASSERT_EQ(::pipe(alive.data()), 0);
  ASSERT_EQ(::pipe(gate.data()), 0);
  const pid_t program = ::fork();
  ASSERT_GE(program, 0);
  if (program == 0) {
    LockedFile file;
    if (file.open(folder, "a", true) != State::open) ::_exit(1);
    if (::fork() != 0) ::_exit(0);
    // The child of the one that had it: lives until the test has looked.
    ::close(gate[1]);
    char byte = 'x';
    static_cast<void>(!::write(alive[1], &byte, 1));
    static_cast<void>(!::read(gate[0], &byte, 1));
    ::_exit(0);
  }
  ::close(gate[0]);
  int status = 0;
  ASSERT_EQ(::waitpid(program, &status, 0), program);
  EXPECT_EQ(status, 0);
  char byte = 0;
  ASSERT_EQ(::read(alive[0], &byte, 1), 1);
  LockedFile again;
  EXPECT_EQ(again.open(folder, "a", false), State::open);
  for (const int end : {gate[1], alive[0], alive[1]}) ::close(end);
}

}  // namespace
}  // namespace gimnet::nif::test
