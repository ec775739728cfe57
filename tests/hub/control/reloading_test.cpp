#include "hub/control/reloading.hpp"

#include <gtest/gtest.h>

namespace gimnet::hub {
namespace {

TEST(Reloading, IsSummedUpInOneLine) {
  Reloading reloading;
  EXPECT_EQ(reload_summary(reloading), "configuration read again: nothing changed");
  reloading.changes = {{"log_level", "\"info\"", "\"debug\"", false}, {"shards", "1", "2", true}};
  EXPECT_EQ(
      reload_summary(reloading),
      "configuration read again: changed log_level from \"info\" to \"debug\"; needs a restart: shards from 1 to 2");
}

}  // namespace
}  // namespace gimnet::hub
