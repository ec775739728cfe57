#include "client/gimi/loss_tally.hpp"

#include <gtest/gtest.h>

namespace gimnet::gimi {
namespace {

TEST(LossTally, CountsByWhy) {
  LossTally tally;
  EXPECT_EQ(tally.counts().all(), 0u);
  tally.add(proto::DropReason::cut_message, 1);
  tally.add(proto::DropReason::too_large, 2);
  tally.add(proto::DropReason::link_lost, 3);
  tally.add(proto::DropReason::none, 4);  // what a later version calls by another name
  tally.add(proto::DropReason::cut_message, 10);
  tally.add_unknown_service();
  tally.add_unknown_service();
  EXPECT_EQ(tally.counts().unknown_service, 2u);
  EXPECT_EQ(tally.counts().incomplete, 11u);
  EXPECT_EQ(tally.counts().too_large, 2u);
  EXPECT_EQ(tally.counts().frames_broken_off, 7u);
  EXPECT_EQ(tally.counts().all(), 22u);
}

TEST(LossTally, KnowsWhoFilledTheQueueLast) {
  LossTally tally;
  EXPECT_EQ(tally.counts().queue_filled_by, Peer{});
  tally.add_queue_full(9, 3);
  tally.add_queue_full(10, 4);
  EXPECT_EQ(tally.counts().queue_full, 7u);
  EXPECT_EQ(tally.counts().queue_filled_by, Peer{10});
  EXPECT_EQ(tally.counts().all(), 0u);
}

}  // namespace
}  // namespace gimnet::gimi
