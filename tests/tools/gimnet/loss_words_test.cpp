#include "tools/gimnet/loss_words.hpp"

#include <gtest/gtest.h>

#include "client/gimi/report_words.hpp"

namespace gimnet::tool {
namespace {

TEST(LossWords, SayThatANodeHasLeftThatWasCalledByItsName) {
  const std::string loss = gimi::report_words("no_such_node");
  EXPECT_EQ(loss_words(loss, "robot/arm"), "the hub reports no_such_node: robot/arm has left");
  EXPECT_EQ(loss_words(loss, "7.17"), loss) << "an id may be wrong";
}

TEST(LossWords, LeaveOtherReasonsAlone) {
  for (const char* reason : {"queue_full", "no_route", "away"}) {
    EXPECT_EQ(loss_words(gimi::report_words(reason), "robot"), gimi::report_words(reason));
  }
}

}  // namespace
}  // namespace gimnet::tool
