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

TEST(Table, ColoursWholeRowsAndHidesControlCharacters) {
  Table table({"ID"});
  table.add({"a\x1b[2J"}, Tone::warning);
  EXPECT_EQ(table.text(Paint(true)), "\x1b[1mID\x1b[0m\n\x1b[33ma.[2J\x1b[0m\n");
}

}  // namespace
}  // namespace gimnet::tool
