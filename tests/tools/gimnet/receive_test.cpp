#include "tools/gimnet/receive.hpp"

#include <gtest/gtest.h>

#include "tests/client/gimi/support/made_message.hpp"

namespace gimnet::tool {
namespace {

TEST(Printer, ALineForPeopleHidesControlCharacters) {
  EXPECT_EQ(text_line(test::make_message("a\x1b[2Jb", 3)), "7.5 #3: a.[2Jb\n");
  EXPECT_EQ(text_line(test::make_message("x", 1, {4, 2})), "7.5 4/2 #1: x\n");
}

TEST(Printer, OfSeveralServicesALineNamesItsOwn) {
  const Message message = test::make_message("x", 1, {}, "r/s");
  EXPECT_EQ(text_line(message, true), "r/s 7.5 #1: x\n");
  EXPECT_EQ(text_line(message, false), "7.5 #1: x\n");
}

TEST(Printer, AnObjectForPrograms) {
  EXPECT_EQ(
      json_line(test::make_message("a\"b", 3, {4, 2})),
      R"({"from":"7.5","type":4,"instance":2,"sequence":3,"arrival_ns":1000,"lost":0,"size":3,"text":"a\"b"})"
      "\n");
}

TEST(Printer, AnObjectTellsWhatDidNotCome) {
  const Absent absent{.lost = 5, .missed = 941, .skipped = 40};
  EXPECT_NE(json_line(test::make_message("x", 3), absent)
                .find(R"("lost":5,"missed":941,"skipped":40,"size":1)"),
            std::string::npos);
}

}  // namespace
}  // namespace gimnet::tool
