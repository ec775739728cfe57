#include "client/gimi/loss_tally.hpp"

#include <gtest/gtest.h>

#include <iterator>
#include <utility>

#include "proto/frame/frame_header.hpp"

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
  tally.add_over_budget(3);
  EXPECT_EQ(tally.counts().queue_full, 7u);
  EXPECT_EQ(tally.counts().queue_filled_by, Peer{10});
  EXPECT_EQ(tally.counts().over_budget, 3u);
  EXPECT_EQ(tally.counts().all(), 0u);
}

}  // namespace

namespace {

TEST(ReportWords, SayWhatAReasonMeansWhereItsNameDoesNot) {
  EXPECT_EQ(report_words("no_such_node"), "the hub reports no_such_node: no node has that id");
  EXPECT_EQ(report_words("too_old"), "the hub reports too_old");
}

TEST(DroppedStatus, TellsWhatIsForbiddenFromWhatDidNotCome) {
  EXPECT_EQ(dropped_status(NIF_DROP_NOT_ALLOWED), Status::denied);
  for (const std::uint32_t reason : {NIF_DROP_NO_ROUTE, NIF_DROP_LINK_UNSURE, NIF_DROP_AWAY})
    EXPECT_EQ(dropped_status(reason), Status::not_delivered);
}

TEST(ReportedLoss, IsWhatTheWireSays) {
  const std::pair<LossReason, proto::DropReason> pairs[] = {
      {LossReason::no_such_node, proto::DropReason::no_such_node},
      {LossReason::no_route, proto::DropReason::no_route},
      {LossReason::away, proto::DropReason::away},
      {LossReason::queue_full, proto::DropReason::queue_full},
      {LossReason::replaced, proto::DropReason::replaced},
      {LossReason::too_old, proto::DropReason::too_old},
      {LossReason::hop_limit, proto::DropReason::hop_limit},
      {LossReason::too_large, proto::DropReason::too_large},
      {LossReason::not_allowed, proto::DropReason::not_allowed},
      {LossReason::wrong_way, proto::DropReason::wrong_way},
      {LossReason::link_lost, proto::DropReason::link_lost},
      {LossReason::shard_full, proto::DropReason::shard_full},
      {LossReason::no_such_group, proto::DropReason::no_such_group},
      {LossReason::renumbered, proto::DropReason::renumbered},
      {LossReason::over_budget, proto::DropReason::over_budget},
      {LossReason::timed_out, proto::DropReason::timed_out},
      {LossReason::cut_message, proto::DropReason::cut_message},
      {LossReason::no_subscriber, proto::DropReason::no_subscriber},
      {LossReason::malformed, proto::DropReason::malformed},
      {LossReason::wrong_source, proto::DropReason::wrong_source},
      {LossReason::link_unsure, proto::DropReason::link_unsure},
  };
  EXPECT_EQ(std::size(pairs) + 2, proto::kDropReasonCount)
      << "and none, and not_retained, which is no loss";
  for (const auto& [known, wire] : pairs) {
    const auto reason = static_cast<std::uint32_t>(wire);
    EXPECT_EQ(reported_loss(reason, proto::drop_reason_name(wire)).reason, known);
  }
  EXPECT_EQ(reported_loss(66, "of a later hub").reason, LossReason::none)
      << "none that this node knows by itself";
}

}  // namespace

}  // namespace gimnet::gimi
