#include "tools/gimnet/table.hpp"

#include <gtest/gtest.h>

namespace gimnet::tool {
namespace {

TEST(Table, HasColumnsAsWideAsTheyNeed) {
  Table table({"ID", "NAME"});
  table.add({"7.17", "robot"});
  table.add({"7.1", "a"});
  EXPECT_EQ(table.text(), "ID    NAME\n7.17  robot\n7.1   a\n");
}

}  // namespace
}  // namespace gimnet::tool
