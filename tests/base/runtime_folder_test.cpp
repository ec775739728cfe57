#include "base/runtime_folder.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <string>

#include "tests/client/nif/support/environment.hpp"

namespace gimnet {
namespace {

using nif::test::Environment;

std::string own_name() { return "gimnet-" + std::to_string(::geteuid()); }

TEST(RuntimeFolder, IsInTheUsersOwnFolderWhereThereIsOne) {
  const Environment runtime("XDG_RUNTIME_DIR", "/run/user/7");
  const Environment temporary("TMPDIR", "/var/tmp");
  const RuntimeFolder folder = runtime_folder_of_user();
  EXPECT_EQ(folder.path(), "/run/user/7/gimnet");
  EXPECT_TRUE(folder.in_private);
}

TEST(RuntimeFolder, ElseHasTheUsersNumberInTheTemporaryFolder) {
  const Environment runtime("XDG_RUNTIME_DIR", "");
  const Environment temporary("TMPDIR", "/var/tmp");
  EXPECT_EQ(runtime_folder_of_user().path(), "/var/tmp/" + own_name());
  EXPECT_FALSE(runtime_folder_of_user().in_private);
  const Environment none("TMPDIR", "");
  EXPECT_EQ(runtime_folder_of_user().path(), "/tmp/" + own_name());
}

TEST(RuntimeFolder, DoesNotMoveWithTheFolderInWhichAProgramWasStarted) {
  const Environment runtime("XDG_RUNTIME_DIR", "run");
  const Environment temporary("TMPDIR", "tmp");
  EXPECT_EQ(runtime_folder_of_user().path(), "/tmp/" + own_name());
}

}  // namespace
}  // namespace gimnet
