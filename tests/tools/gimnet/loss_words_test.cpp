#include "tools/gimnet/loss_words.hpp"

#include <gtest/gtest.h>

namespace gimnet::tool {
namespace {

SendCounts lost(LossReason reason) {
  SendCounts counts;
  counts.lost = 1;
  counts.loss = "as the library says it";
  counts.loss_reason = reason;
  return counts;
}

TEST(LossWords, SayThatANodeHasLeftThatWasCalledByItsName) {
  const SendCounts counts = lost(LossReason::no_such_node);
  EXPECT_EQ(loss_words(counts, "robot/arm"), "the hub reports no_such_node: robot/arm has left");
  EXPECT_EQ(loss_words(counts, "7.17"), counts.loss) << "an id may be wrong";
}

TEST(LossWords, LeaveOtherReasonsAlone) {
  for (const LossReason reason :
       {LossReason::queue_full, LossReason::no_route, LossReason::not_received}) {
    EXPECT_EQ(loss_words(lost(reason), "robot"), "as the library says it");
  }
}

}  // namespace
}  // namespace gimnet::tool
