#include "hub/data/egress/drop_book.hpp"

#include <gtest/gtest.h>

#include <map>
#include <utility>

#include "tests/hub/data/support/egress_rig.hpp"

namespace gimnet::hub {
namespace {

using proto::DropReason;
using testing::EgressRig;

struct Sent {
  NodeId sender;
  std::vector<std::byte> payload;
};

std::vector<Sent> flush(DropBook& book, std::uint64_t now_ms) {
  std::vector<Sent> sent;
  book.flush(now_ms, [&](NodeId sender, std::span<const std::byte> payload) {
    sent.push_back({sender, {payload.begin(), payload.end()}});
    return true;
  });
  return sent;
}

void drop(DropBook& book, const std::string& text, std::uint32_t src, DropReason reason,
          std::uint8_t flags = proto::kFlagReport) {
  const auto bytes = EgressRig::bytes(text, {.flags = flags, .src = src});
  book.drop(bytes.data(), 1, reason);
}

TEST(DropBook, CountsEverythingAndReportsWhatAskedForIt) {
  Tally tally;
  DropBook book(tally, 10, 4'096);
  drop(book, "quiet", 1, DropReason::queue_full, 0);
  EXPECT_FALSE(book.pending());
  drop(book, "loud", 1, DropReason::queue_full);
  EXPECT_TRUE(book.pending());
  EXPECT_EQ(tally.dropped[static_cast<std::size_t>(DropReason::queue_full)], 2u);
  const auto sent = flush(book, 1'000);
  ASSERT_EQ(sent.size(), 1u);
  const auto report = proto::decode_report(sent[0].payload);
  ASSERT_TRUE(report);
  EXPECT_EQ(report->count, 1u);
  EXPECT_EQ(report->following.size(), 4u);
}

TEST(DropBook, TellsOfAFrameThatIsNotDroppedAndCountsNothing) {
  Tally tally;
  DropBook book(tally, 10, 4'096);
  for (const std::uint32_t group : {1u, 2u, 1u}) {
    auto bytes = EgressRig::bytes("map", {.kind = proto::Kind::group, .flags = 0, .src = 1});
    store_le(bytes.data() + 4, group);
    book.tell(bytes.data(), DropReason::not_retained);
  }
  EXPECT_FALSE(tally.any_dropped);
  const auto sent = flush(book, 1'000);
  ASSERT_EQ(sent.size(), 2u) << "one for each group";
  for (const Sent& each : sent) {
    const auto report = proto::decode_report(each.payload);
    ASSERT_TRUE(report);
    EXPECT_EQ(report->reason, DropReason::not_retained);
    EXPECT_EQ(report->count, report->header.dst == 1 ? 2u : 1u);
  }
}

TEST(DropBook, CountsAFrameForEachOfItsRecipients) {
  Tally tally;
  DropBook book(tally, 10, 4'096);
  auto start =
      EgressRig::bytes(std::string(proto::kReportFollowingMax, 'x'), {.flags = proto::kFlagReport});
  store_le(start.data(), std::uint32_t{1'000'000});  // most of it is somewhere else
  book.drop(start.data(), 3, DropReason::shard_full);
  EXPECT_EQ(tally.dropped[static_cast<std::size_t>(DropReason::shard_full)], 3u);
  const auto sent = flush(book, 1'000);
  ASSERT_EQ(sent.size(), 1u);
  const auto report = proto::decode_report(sent[0].payload);
  ASSERT_TRUE(report);
  EXPECT_EQ(report->count, 3u);
  EXPECT_EQ(report->header.length, 1'000'000u);
  EXPECT_EQ(report->following.size(), proto::kReportFollowingMax);
  const auto quiet = EgressRig::bytes("quiet", {});
  book.drop(quiet.data(), 2, DropReason::shard_full);
  EXPECT_EQ(tally.dropped[static_cast<std::size_t>(DropReason::shard_full)], 5u);
  EXPECT_TRUE(flush(book, 2'000).empty());
}

// Frames that are written again after a break may come from many senders, one behind the other.
TEST(DropBook, ReportsEachOfFramesWithDifferentHeaders) {
  Tally tally;
  DropBook book(tally, 10, 4'096);
  std::vector<std::byte> all;
  const auto add = [&all](const std::string& text, std::uint32_t src, std::uint8_t flags) {
    const auto one = EgressRig::bytes(text, {.flags = flags, .src = src});
    all.insert(all.end(), one.begin(), one.end());
  };
  add("quiet", 1, 0);
  add("first", 2, proto::kFlagReport);
  add("", 3, proto::kFlagReport);
  add("second", 2, proto::kFlagReport);
  book.drop_mixed(all.data(), static_cast<std::uint32_t>(all.size()), DropReason::link_lost);
  EXPECT_EQ(tally.dropped[static_cast<std::size_t>(DropReason::link_lost)], 4u);
  const auto sent = flush(book, 1'000);
  ASSERT_EQ(sent.size(), 2u);
  EXPECT_EQ(index_of(sent[0].sender), 2u);
  EXPECT_EQ(proto::decode_report(sent[0].payload)->count, 2u);
  EXPECT_EQ(index_of(sent[1].sender), 3u);
  EXPECT_EQ(proto::decode_report(sent[1].payload)->count, 1u);
}

TEST(DropBook, MergesBySenderAndReasonAndShowsTheFirstOfTheLastRun) {
  Tally tally;
  DropBook book(tally, 10, 4'096);
  drop(book, "one", 1, DropReason::queue_full);
  EgressRig rig;
  const hub::Run run = rig.run({"two", "three", "four!"}, {.flags = proto::kFlagReport, .src = 1});
  book.drop(run.bytes, run.frames, DropReason::queue_full);
  drop(book, "another sender", 2, DropReason::queue_full);
  drop(book, "another reason", 1, DropReason::away);
  const auto sent = flush(book, 1'000);
  ASSERT_EQ(sent.size(), 3u);
  const auto report = proto::decode_report(sent[0].payload);
  ASSERT_TRUE(report);
  EXPECT_EQ(report->count, 4u);
  EXPECT_EQ(report->header.length, 3u);
}

TEST(DropBook, SaysNoMoreThanOneAnInterval) {
  Tally tally;
  DropBook book(tally, 10, 4'096);
  drop(book, "one", 1, DropReason::queue_full);
  EXPECT_EQ(flush(book, 1'000).size(), 1u);
  drop(book, "two", 1, DropReason::queue_full);
  EXPECT_EQ(flush(book, 1'009).size(), 0u);
  EXPECT_TRUE(book.pending());
  EXPECT_EQ(flush(book, 1'010).size(), 1u);
}

TEST(DropBook, KeepsAReportWithoutAWayToItsSenderForAWhile) {
  Tally tally;
  DropBook book(tally, 10, 4'096);
  const auto find_no_way = [&book](std::uint64_t now_ms) {
    std::size_t asked = 0;
    book.flush(now_ms, [&asked](NodeId, std::span<const std::byte>) { return ++asked == 0; });
    return asked;
  };
  drop(book, "one", 1, DropReason::no_route);
  EXPECT_EQ(find_no_way(1'000), 1u);
  drop(book, "two", 1, DropReason::no_route);
  EXPECT_EQ(find_no_way(1'009), 0u) << "it is not asked for all the time";
  EXPECT_EQ(find_no_way(1'010), 1u);
  const auto sent = flush(book, 1'020);
  ASSERT_EQ(sent.size(), 1u);
  EXPECT_EQ(proto::decode_report(sent[0].payload)->count, 2u);
  EXPECT_EQ(book.take_lost(), 0u);
  drop(book, "three", 1, DropReason::no_route);
  EXPECT_EQ(find_no_way(2'000), 1u);
  EXPECT_EQ(find_no_way(2'000 + DropBook::kKeptMs - 1), 1u);
  EXPECT_EQ(book.take_lost(), 0u);
  EXPECT_EQ(find_no_way(2'000 + DropBook::kKeptMs + 9), 1u);
  EXPECT_EQ(book.take_lost(), 1u);
  EXPECT_EQ(flush(book, 9'000).size(), 0u);
  EXPECT_FALSE(book.pending());
}

// So many senders at once that some are only counted; later ones are heard again.
TEST(DropBook, ReportsAsManySendersAndReasonsAsItIsTold) {
  for (const std::uint64_t notes_max : {1u, 3u}) {
    Tally tally;
    DropBook book(tally, 10, notes_max);
    for (std::uint32_t src = 1; src <= notes_max; ++src) drop(book, "x", src, DropReason::away);
    drop(book, "one beyond", 9, DropReason::away);
    drop(book, "one beyond", 1, DropReason::queue_full);
    drop(book, "of one that it knows", 1, DropReason::away);
    const auto sent = flush(book, 1'000);
    ASSERT_EQ(sent.size(), notes_max);
    EXPECT_EQ(proto::decode_report(sent[0].payload)->count, 2u);
    EXPECT_EQ(tally.dropped[static_cast<std::size_t>(DropReason::away)], notes_max + 2)
        << "counted all the same";
  }
}

// Notes come and go in any order; each is found again while it is there.
TEST(DropBook, FindsEachOfManyNotes) {
  Tally tally;
  DropBook book(tally, 10, 300);
  std::uint64_t now = 1'000;
  for (std::uint32_t round = 0; round < 20; ++round, now += 10) {
    std::map<std::pair<std::uint32_t, DropReason>, std::uint32_t> dropped;
    for (std::uint32_t src = 1; src <= 60; ++src) {
      if ((src + round) % 3 == 0) continue;  // quiet in this round, and forgotten
      for (std::uint32_t times = 0; times <= src % 4; ++times) {
        const DropReason reason = times % 2 == 0 ? DropReason::away : DropReason::queue_full;
        drop(book, "x", src << 8, reason);  // ids that share a place
        ++dropped[{src << 8, reason}];
      }
    }
    std::map<std::pair<std::uint32_t, DropReason>, std::uint32_t> told;
    for (const auto& each : flush(book, now)) {
      const auto report = proto::decode_report(each.payload);
      ASSERT_TRUE(report);
      told[{index_of(each.sender), report->reason}] += report->count;
    }
    EXPECT_EQ(told, dropped);
  }
}

TEST(DropBook, ForgetsSendersThatAreQuiet) {
  Tally tally;
  DropBook book(tally, 10, 4'096);
  for (std::uint32_t src = 1; src <= 5'000; ++src) drop(book, "x", src, DropReason::away);
  EXPECT_FALSE(flush(book, 1'000).empty());
  for (std::uint64_t now = 1'000; book.pending() && now < 2'000; now += 10) flush(book, now);
  EXPECT_FALSE(book.pending());
  drop(book, "x", 9'000, DropReason::away);
  EXPECT_EQ(flush(book, 3'000).size(), 1u);
}

}  // namespace
}  // namespace gimnet::hub
