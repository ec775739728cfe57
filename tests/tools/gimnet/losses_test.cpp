#include "tools/gimnet/losses.hpp"

#include <gtest/gtest.h>

namespace gimnet::tool {
namespace {

TEST(NewsPace, IsDueAtOnceAndThenAfterEachPeriod) {
  NewsPace pace;
  EXPECT_TRUE(pace.due(100));
  EXPECT_FALSE(pace.due(100));
  EXPECT_FALSE(pace.due(100 + NewsPace::kPeriodNs - 1));
  EXPECT_TRUE(pace.due(100 + NewsPace::kPeriodNs));
  EXPECT_FALSE(pace.due(101 + NewsPace::kPeriodNs));
}

}  // namespace

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

TEST(LossWords, OfAServiceAForbiddenMessageHasTwoCauses) {
  const SendCounts counts = lost(LossReason::not_allowed);
  EXPECT_EQ(loss_words(counts, "robot"), counts.loss);
  EXPECT_EQ(loss_words(counts, "robot/drive"), counts.loss + "; or the service takes no data");
}

TEST(LossWords, LeaveOtherReasonsAlone) {
  for (const LossReason reason :
       {LossReason::queue_full, LossReason::no_route, LossReason::not_received}) {
    EXPECT_EQ(loss_words(lost(reason), "robot"), "as the library says it");
  }
}

}  // namespace

namespace {

using Sentences = std::vector<std::string>;

TEST(LostMessages, NothingIsSaidOfNothing) {
  LostMessages lost;
  lost.take({});
  EXPECT_EQ(lost.news(1), Sentences{});
  EXPECT_EQ(lost.rest(), Sentences{});
  EXPECT_EQ(lost.all(), 0u);
}

TEST(LostMessages, EachReasonIsSaidOnceWithItsSum) {
  LostMessages lost;
  lost.take({.incomplete = 1,
             .too_large = 2,
             .frames_broken_off = 3,
             .unknown_service = 4,
             .unreadable = 5,
             .outdated = 6});
  EXPECT_EQ(lost.all(), 21u);
  EXPECT_EQ(
      lost.rest(),
      (Sentences{
          "1 message was lost: a part did not come, or did not fit the others",
          "2 messages were lost: larger than this end takes",
          "3 frames were lost: on the way when the connection broke, and a large message has many "
          "frames",
          "4 messages were lost: of a service that this end does not know to have subscribed",
          "5 frames were lost: another node broke the protocol, or sent a key without a GIMI "
          "header",
          "6 messages were lost: its sender had been started again, and had sent newer ones"}));
  EXPECT_EQ(lost.rest(), Sentences{});
  lost.take({.incomplete = 4,
             .too_large = 2,
             .frames_broken_off = 3,
             .unknown_service = 4,
             .unreadable = 5,
             .outdated = 6});
  EXPECT_EQ(lost.rest(),
            Sentences{"4 messages were lost: a part did not come, or did not fit the others"});
}

TEST(LostMessages, AFullQueueIsSaidWithWhoFilledIt) {
  LostMessages lost;
  lost.take({.queue_full = 5, .queue_filled_by = Peer{7u << 20 | 9}});
  EXPECT_EQ(lost.all(), 0u);
  EXPECT_EQ(lost.news(100),
            Sentences{"5 frames were lost: the queue of this node at the hub was full, mostly of "
                      "what 7.9 sent"});
  lost.take({.queue_full = 6, .queue_filled_by = {}});
  EXPECT_EQ(lost.rest(),
            Sentences{"6 frames were lost: the queue of this node at the hub was full"});
  EXPECT_EQ(lost.rest(), Sentences{});
}

TEST(LostMessages, ShortMemoryIsNoFullQueue) {
  LostMessages lost;
  lost.take({.over_budget = 3});
  EXPECT_EQ(lost.all(), 0u);
  EXPECT_EQ(lost.news(100),
            Sentences{"3 frames were lost: the hub's memory for what waits was short (`gimnet ctl "
                      "connections` shows for whom it waits)"});
  EXPECT_EQ(lost.rest(), Sentences{});
}

TEST(LostMessages, NewsComeAtMostOnceASecond) {
  LostMessages lost;
  lost.take({.incomplete = 1, .too_large = 0, .frames_broken_off = 0, .unknown_service = 0});
  EXPECT_EQ(lost.news(100).size(), 1u);
  lost.take({.incomplete = 2, .too_large = 0, .frames_broken_off = 0, .unknown_service = 0});
  EXPECT_EQ(lost.news(100 + NewsPace::kPeriodNs - 1), Sentences{});
  EXPECT_EQ(lost.news(100 + NewsPace::kPeriodNs).size(), 1u);
}

}  // namespace

}  // namespace gimnet::tool
