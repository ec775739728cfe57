#include "client/gimi/report_words.hpp"

#include <gtest/gtest.h>

namespace gimnet::gimi {
namespace {

TEST(ReportWords, SayWhatAReasonMeansWhereItsNameDoesNot) {
  EXPECT_EQ(report_words("no_such_node"), "the hub reports no_such_node: no node has that id");
  EXPECT_EQ(report_words("too_old"), "the hub reports too_old");
}

}  // namespace
}  // namespace gimnet::gimi
