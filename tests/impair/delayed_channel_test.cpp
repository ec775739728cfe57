#include "impair/delayed_channel.hpp"

#include <gtest/gtest.h>

#include <algorithm>

namespace gimnet::impair {
namespace {

constexpr std::int64_t kMs = 1'000'000;

std::vector<std::byte> numbered(std::size_t count) {
  std::vector<std::byte> bytes(count);
  for (std::size_t i = 0; i < count; ++i) bytes[i] = static_cast<std::byte>(i * 7);
  return bytes;
}

/// All that is due at `now_ns`, and the sizes of the pieces.
struct Taken {
  std::vector<std::byte> bytes;
  std::vector<std::size_t> pieces;
};
Taken take_due(DelayedChannel& channel, std::int64_t now_ns) {
  Taken taken;
  for (auto piece = channel.due(now_ns); !piece.empty(); piece = channel.due(now_ns)) {
    taken.bytes.insert(taken.bytes.end(), piece.begin(), piece.end());
    taken.pieces.push_back(piece.size());
    channel.took(piece.size());
  }
  return taken;
}

TEST(DelayedChannel, WithoutFaultsGivesWhatItTookAtOnce) {
  DelayedChannel channel(1);
  EXPECT_EQ(channel.due_ns(), DelayedChannel::kNever);
  const auto bytes = numbered(200'000);
  channel.put(5, {}, bytes);
  EXPECT_EQ(channel.held(), bytes.size());
  EXPECT_EQ(take_due(channel, 5).bytes, bytes);
  EXPECT_EQ(channel.held(), 0u);
  EXPECT_EQ(channel.due_ns(), DelayedChannel::kNever);
}

TEST(DelayedChannel, DelaysToTheNanosecond) {
  DelayedChannel channel(1);
  channel.put(0, {.delay_ns = 80 * kMs}, numbered(10));
  EXPECT_EQ(channel.due_ns(), 80 * kMs);
  EXPECT_TRUE(channel.due(80 * kMs - 1).empty());
  EXPECT_EQ(channel.due(80 * kMs).size(), 10u);
}

TEST(DelayedChannel, JitterStaysWithinItsBoundsAndKeepsTheOrder) {
  DelayedChannel channel(7);
  const Impairment how{.delay_ns = 80 * kMs, .jitter_ns = 5 * kMs};
  std::int64_t before = 0;
  std::int64_t least = INT64_MAX;
  std::int64_t most = 0;
  for (std::int64_t now = 0; now < 2000 * kMs; now += 20 * kMs) {
    channel.put(now, how, numbered(1));
    const std::int64_t due = channel.due_ns();
    EXPECT_GE(due, before);
    before = due;
    least = std::min(least, due - now);
    most = std::max(most, due - now);
    channel.took(1);
  }
  EXPECT_GE(least, 75 * kMs);
  EXPECT_LT(least, 77 * kMs);
  EXPECT_LE(most, 85 * kMs);
  EXPECT_GT(most, 83 * kMs);
}

TEST(DelayedChannel, EqualSeedsDrawEqualJitter) {
  const Impairment how{.delay_ns = kMs, .jitter_ns = kMs, .split = 5};
  DelayedChannel one(3);
  DelayedChannel same(3);
  DelayedChannel other(4);
  for (DelayedChannel* channel : {&one, &same, &other}) channel->put(0, how, numbered(1000));
  const auto pieces = take_due(one, 10 * kMs).pieces;
  EXPECT_EQ(pieces, take_due(same, 10 * kMs).pieces);
  EXPECT_NE(pieces, take_due(other, 10 * kMs).pieces);
}

TEST(DelayedChannel, TheRateBoundsWhatIsOut) {
  DelayedChannel channel(1);
  const Impairment how{.delay_ns = 10 * kMs, .rate = 1'000'000};
  const auto bytes = numbered(100'000);
  channel.put(0, how, bytes);
  // One byte a microsecond, let out every 10 ms.
  EXPECT_EQ(take_due(channel, 60 * kMs).bytes.size(), 50'000u);
  // A line that was idle does not catch up.
  EXPECT_EQ(take_due(channel, 110 * kMs).bytes.size(), 50'000u);
  channel.put(1000 * kMs, how, bytes);
  EXPECT_EQ(take_due(channel, 1060 * kMs).bytes.size(), 50'000u);
}

TEST(DelayedChannel, SplitsIntoPiecesOfAtMostSoMany) {
  DelayedChannel channel(1);
  const auto bytes = numbered(5000);
  channel.put(0, {.split = 3}, bytes);
  const Taken taken = take_due(channel, 0);
  EXPECT_EQ(taken.bytes, bytes);
  for (const std::size_t size : {1u, 2u, 3u})
    EXPECT_GT(std::ranges::count(taken.pieces, size), 100) << size;
  EXPECT_EQ(*std::ranges::max_element(taken.pieces), 3u);
}

TEST(DelayedChannel, WhatIsUnderWayKeepsItsTimeWhenTheDelayFalls) {
  DelayedChannel channel(1);
  channel.put(0, {.delay_ns = 100 * kMs}, numbered(1));
  channel.put(1, {}, numbered(1));
  EXPECT_TRUE(channel.due(99 * kMs).empty());
  EXPECT_EQ(take_due(channel, 100 * kMs).bytes.size(), 2u);
}

TEST(DelayedChannel, HasRoomUpToItsQueue) {
  DelayedChannel channel(1);
  const Impairment how{.delay_ns = kMs, .queue = 100};
  EXPECT_EQ(channel.room(how), 100u);
  channel.put(0, how, numbered(100));
  EXPECT_EQ(channel.room(how), 0u);
  channel.took(1);
  EXPECT_EQ(channel.room(how), 1u);
}

}  // namespace
}  // namespace gimnet::impair
