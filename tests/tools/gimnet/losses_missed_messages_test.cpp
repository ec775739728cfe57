#include "tools/gimnet/losses.hpp"

#include <gtest/gtest.h>

#include <utility>

#include "tests/client/gimi/support/made_message.hpp"

namespace gimnet::tool {
namespace {

using test::make_message;
using Sentences = std::vector<std::string>;

const char* const kUnknown =
    " of r/s did not come: this reader was too slow, or the sender's connection or a "
    "link between hubs broke (`gimnet status` counts what the hub dropped)";
const char* const kBroken = " of r/s did not come: the connection to the hub was broken";

const char* const kFlooded =
    " of r/s did not come: the queue of this reader at the hub was full, mostly of what 7.9 sent";
const char* const kSqueezed =
    " of r/s did not come: the hub's memory for what waits was short (`gimnet ctl connections` "
    "shows for whom it waits)";
constexpr Peer kFlooder{7u << 20 | 9};

class MissedMessagesTest : public testing::Test {
 protected:
  std::uint64_t take(std::uint32_t sequence, std::uint32_t reconnects = 0) {
    return missed_.take(make_message("x", sequence, {}, "r/s", reconnects));
  }

  MissedMessages missed_;
};

TEST_F(MissedMessagesTest, TheFirstMayHaveAnyNumber) {
  EXPECT_EQ(take(1000), 0u);
  EXPECT_EQ(take(1001), 0u);
  EXPECT_EQ(missed_.rest(), Sentences{});
}

TEST_F(MissedMessagesTest, GapsAreCounted) {
  take(1);
  EXPECT_EQ(take(3), 1u);
  EXPECT_EQ(missed_.rest(), Sentences{std::string("1 message") + kUnknown});
  EXPECT_EQ(take(13), 10u);
  EXPECT_EQ(missed_.rest(), Sentences{std::string("10 messages") + kUnknown});
  EXPECT_EQ(missed_.rest(), Sentences{}) << "once";
}

TEST_F(MissedMessagesTest, ABrokenConnectionIsTheCauseOfTheGapAcrossIt) {
  take(1);
  take(3);
  EXPECT_EQ(take(13, 1), 10u);
  EXPECT_EQ(take(15, 1), 11u);
  EXPECT_EQ(missed_.rest(),
            (Sentences{std::string("9 messages") + kBroken, std::string("2 messages") + kUnknown}));
  take(17, 1);
  EXPECT_EQ(missed_.rest(), Sentences{std::string("3 messages") + kUnknown});
}

TEST_F(MissedMessagesTest, WhatIsToldAsLostIsNotToldTwice) {
  take(1);
  missed_.take_lost(
      {.incomplete = 1, .too_large = 0, .frames_broken_off = 50, .unknown_service = 1});
  EXPECT_EQ(take(4), 2u);
  EXPECT_EQ(missed_.rest(), Sentences{});
  missed_.take_lost(
      {.incomplete = 1, .too_large = 1, .frames_broken_off = 50, .unknown_service = 1});
  EXPECT_EQ(take(7), 4u);
  EXPECT_EQ(missed_.rest(), Sentences{std::string("1 message") + kUnknown});
}

TEST_F(MissedMessagesTest, WhoWasFloodedIsNotCalledSlow) {
  take(1);
  missed_.take_lost({.queue_full = 2, .queue_filled_by = kFlooder});
  EXPECT_EQ(take(2), 0u) << "had waited before the gap";
  EXPECT_EQ(take(5), 2u);
  EXPECT_EQ(missed_.rest(), Sentences{std::string("2 messages") + kFlooded});
  EXPECT_EQ(take(7), 3u);
  EXPECT_EQ(missed_.rest(), Sentences{std::string("1 message") + kUnknown})
      << "nothing was said of this gap";
}

TEST_F(MissedMessagesTest, EachGapOfOneFloodHasItsCause) {
  take(1);
  // The hub told twice before the first gap was seen.
  missed_.take_lost({.queue_full = 2, .queue_filled_by = kFlooder});
  missed_.take_lost({.queue_full = 5, .queue_filled_by = kFlooder});
  take(4);
  take(6);
  EXPECT_EQ(missed_.rest(), Sentences{std::string("3 messages") + kFlooded});
  take(9);
  EXPECT_EQ(missed_.rest(), Sentences{std::string("5 messages") + kFlooded});
  take(11);
  EXPECT_EQ(missed_.rest(), Sentences{std::string("1 message") + kUnknown})
      << "all that was told of is found";
}

TEST_F(MissedMessagesTest, WhereTheHubsMemoryWasShortNobodyIsCalledSlow) {
  take(1);
  missed_.take_lost({.over_budget = 2});
  EXPECT_EQ(take(4), 2u);
  EXPECT_EQ(missed_.rest(), Sentences{std::string("2 messages") + kSqueezed});
  missed_.take_lost({.queue_full = 1, .queue_filled_by = kFlooder, .over_budget = 5});
  take(6);
  EXPECT_EQ(missed_.rest(), Sentences{std::string("1 message") + kFlooded});
  take(9);
  EXPECT_EQ(missed_.rest(), Sentences{std::string("4 messages") + kSqueezed});
}

TEST_F(MissedMessagesTest, AGapLongAfterAFloodHasAnotherCause) {
  const auto take_at = [this](std::uint32_t sequence, std::int64_t arrival_s) {
    gimi_message message = make_message("x", sequence, {}, "r/s").give_up();
    message.arrival_ns = arrival_s * 1'000'000'000;
    missed_.take(Message(message));
  };
  take_at(1, 100);
  missed_.take_lost({.queue_full = 100, .queue_filled_by = kFlooder});
  take_at(3, 130);
  take_at(5, 135);
  EXPECT_EQ(missed_.rest(), Sentences{std::string("2 messages") + kFlooded});
  take_at(7, 141);
  EXPECT_EQ(missed_.rest(), Sentences{std::string("1 message") + kUnknown})
      << "most of the 100 frames were others";
}

TEST_F(MissedMessagesTest, WhoseProviderFilledTheQueueWasTooSlow) {
  take(1);
  missed_.take_lost({.queue_full = 2, .queue_filled_by = make_message("x", 1, {}, "r/s").from()});
  EXPECT_EQ(take(4), 2u);
  EXPECT_EQ(missed_.rest(), Sentences{"2 messages of r/s did not come: this reader was too slow"});
}

TEST_F(MissedMessagesTest, WhatWasBeforeALateSubscriptionCounts) {
  std::vector<std::string> asked;
  bool late = true;
  MissedMessages missed([&](std::string_view service) {
    asked.emplace_back(service);
    return std::exchange(late, false);
  });
  EXPECT_EQ(missed.take(make_message("x", 4, {}, "r/s")), 3u);
  EXPECT_EQ(missed.take(make_message("x", 5, {}, "r/s")), 3u);
  EXPECT_EQ(missed.take(make_message("x", 7, {}, "r/s")), 4u);
  EXPECT_EQ(
      missed.rest(),
      (Sentences{
          "3 messages of r/s did not come: published before this node had heard of the service and "
          "subscribed to it",
          std::string("1 message") + kUnknown}));
  EXPECT_EQ(missed.take(make_message("x", 1000, {}, "r/t")), 0u) << "is not late";
  EXPECT_EQ(asked, (Sentences{"r/s", "r/t"})) << "once each";
}

TEST_F(MissedMessagesTest, WhoseFirstComesHasMissedNothing) {
  MissedMessages missed([](std::string_view) { return true; });
  EXPECT_EQ(missed.take(make_message("x", 1, {}, "r/s")), 0u);
  EXPECT_EQ(missed.rest(), Sentences{});
}

TEST_F(MissedMessagesTest, OfTheLatestTheyWereSkipped) {
  const auto take_latest = [this](std::uint32_t sequence) {
    return missed_.take(make_message("x", sequence, {}, "r/s", 0, NIF_LATEST));
  };
  take_latest(1);
  EXPECT_EQ(take_latest(4), 2u);
  EXPECT_EQ(missed_.rest(),
            Sentences{"2 messages of r/s skipped for newer ones (delivery latest)"});
  EXPECT_EQ(missed_.skipped("r/s"), 2u);
  EXPECT_EQ(missed_.skipped("r/t"), 0u);
  EXPECT_EQ(missed_.rest(), Sentences{}) << "once";
}

TEST_F(MissedMessagesTest, NumbersWrapAround) {
  take(0xFFFFFFFF);
  EXPECT_EQ(take(1), 1u);
}

TEST_F(MissedMessagesTest, AProviderThatBeginsAgainMissedNothing) {
  take(500);
  EXPECT_EQ(take(1), 0u);
  EXPECT_EQ(take(2), 0u);
}

TEST_F(MissedMessagesTest, OneThatComesLateCountsNoneTwice) {
  take(1);
  EXPECT_EQ(take(70), 68u);
  EXPECT_EQ(take(7), 68u);
  EXPECT_EQ(take(71), 68u) << "goes on behind the highest";
  EXPECT_EQ(take(7), 68u) << "64 behind: the provider began again";
  EXPECT_EQ(take(9), 69u);
}

TEST_F(MissedMessagesTest, NewsComeAtMostOnceASecond) {
  take(1);
  EXPECT_EQ(missed_.news(50), Sentences{});
  take(3);
  EXPECT_EQ(missed_.news(100).size(), 1u);
  take(5);
  EXPECT_EQ(missed_.news(100 + NewsPace::kPeriodNs - 1), Sentences{});
  EXPECT_EQ(missed_.news(100 + NewsPace::kPeriodNs),
            Sentences{std::string("2 messages") + kUnknown});
}

}  // namespace
}  // namespace gimnet::tool
