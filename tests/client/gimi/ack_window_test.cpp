#include "client/gimi/ack_window.hpp"

#include <gtest/gtest.h>

namespace gimnet::gimi {
namespace {

constexpr std::int64_t kMs = 1'000'000;
constexpr std::uint64_t kAll = ~std::uint64_t{0};

void fill(AckWindow& window, std::size_t messages) {
  for (std::size_t i = 0; i < messages; ++i) window.open(1, 0);
}

TEST(AckWindow, TakesAsManyAsItWasTold) {
  AckWindow window(3);
  fill(window, 3);
  EXPECT_FALSE(window.has_room(1));
  EXPECT_EQ(window.acknowledge(1, 0, 0, kMs).acknowledged, 1u);
  EXPECT_TRUE(window.has_room(1));
  EXPECT_EQ(window.open(1, 0), 4u);
  EXPECT_FALSE(window.has_room(1));
}

TEST(AckWindow, TakesAsManyBytesAsFitAndNotOneMore) {
  AckWindow window(64);
  window.open(kWindowBytesMax - 10, 0);
  EXPECT_TRUE(window.has_room(10));
  EXPECT_FALSE(window.has_room(11));
  window.open(10, 0);
  EXPECT_TRUE(window.has_room(0));
  EXPECT_FALSE(window.has_room(1));
  EXPECT_EQ(window.acknowledge(1, 0, 0, kMs).acknowledged, 1u);
  EXPECT_TRUE(window.has_room(kWindowBytesMax - 10));
  EXPECT_FALSE(window.has_room(kWindowBytesMax - 9));
}

TEST(AckWindow, TakesOneOfAnySize) {
  AckWindow window(64);
  EXPECT_TRUE(window.has_room(std::size_t{1} << 30));
  window.open(std::size_t{1} << 30, 0);
  EXPECT_FALSE(window.has_room(0));
  EXPECT_EQ(window.acknowledge(1, 0, 0, kMs).acknowledged, 1u);
  EXPECT_TRUE(window.has_room(std::size_t{1} << 30));
}

TEST(AckWindow, BytesAreFreedHoweverAMessageEnds) {
  AckWindow window(64);
  const auto open = [&] {
    EXPECT_TRUE(window.has_room(kWindowBytesMax)) << "nothing waits";
    return window.open(kWindowBytesMax, 0);
  };
  static_cast<void>(window.lose(open()));
  static_cast<void>(window.cancel(open()));
  open();
  static_cast<void>(window.lose_all());
  const std::uint32_t asked = open();
  window.ping_sent(9, 0);
  EXPECT_EQ(window.acknowledge(asked - 1, 0, 9, kMs).lost, 1u);
  window.open(1, 0);
  EXPECT_TRUE(window.has_room(kWindowBytesMax - 1)) << "bytes of those that ended count still";
  EXPECT_FALSE(window.has_room(kWindowBytesMax));
}

TEST(AckWindow, CountsNothingOfWhatPasses) {
  AckWindow window(1);
  for (std::uint32_t sequence = 1; sequence <= 1000; ++sequence) EXPECT_EQ(window.pass(), sequence);
  EXPECT_TRUE(window.has_room(1));
  EXPECT_TRUE(window.empty());
}

TEST(AckWindow, KeepsTheOldestInReachOfAnyAckAmongWhatPasses) {
  AckWindow window(64);
  window.open(1, 0);
  for (int i = 0; i < 63; ++i) window.pass();
  EXPECT_TRUE(window.has_room(1));
  window.pass();
  EXPECT_FALSE(window.has_room(1));
  EXPECT_TRUE(window.waits_for(1));
  EXPECT_FALSE(window.waits_for(2));
  EXPECT_EQ(window.acknowledge(64, kAll, 0, kMs).acknowledged, 1u);
  EXPECT_FALSE(window.waits_for(1));
  EXPECT_TRUE(window.has_room(1));
}

TEST(AckWindow, OneAckSpeaksOfMany) {
  AckWindow window(64);
  fill(window, 64);
  EXPECT_EQ(window.acknowledge(64, kAll, 0, kMs).acknowledged, 64u);
  EXPECT_TRUE(window.empty());
}

TEST(AckWindow, WaitsForTheOneThatIsMissing) {
  AckWindow window(3);
  fill(window, 3);
  EXPECT_EQ(window.acknowledge(3, 0b10, 0, kMs).acknowledged, 2u);  // 3 and 1
  EXPECT_EQ(window.size(), 2u);
  EXPECT_EQ(window.acknowledge(3, 0b10, 0, kMs).acknowledged, 0u);
  EXPECT_EQ(window.acknowledge(2, 0, 0, kMs).acknowledged, 1u);
  EXPECT_TRUE(window.empty());
}

TEST(AckWindow, StaysWithinReachOfTheBitmap) {
  AckWindow window(kWindowMax);
  fill(window, 64);
  EXPECT_EQ(window.acknowledge(64, kAll >> 2, 0, kMs).acknowledged, 63u);  // all but 1
  EXPECT_TRUE(window.has_room(1));
  EXPECT_EQ(window.open(1, 0), 65u);
  EXPECT_FALSE(window.has_room(1)) << "66 could not be acknowledged together with 1";
}

TEST(AckWindow, IgnoresAcksOfWhatWasNeverSent) {
  AckWindow window(2);
  fill(window, 2);
  EXPECT_FALSE(window.acknowledge(4000, kAll, 0, kMs).any());
  EXPECT_FALSE(window.acknowledge(0, 0, 0, kMs).any());
  EXPECT_EQ(window.size(), 2u);
}

TEST(AckWindow, AsksWhenAnAckIsLate) {
  AckWindow window(2);
  window.open(1, 0);
  EXPECT_FALSE(window.ping_due(200 * kMs - 1));
  EXPECT_TRUE(window.ping_due(200 * kMs));
  window.ping_sent(9, 200 * kMs);
  EXPECT_FALSE(window.ping_due(400 * kMs - 1));
  EXPECT_TRUE(window.ping_due(400 * kMs)) << "not answered: repeated";
  EXPECT_EQ(window.ping_number(), 9u);
  window.ping_sent(9, 400 * kMs);
  EXPECT_FALSE(window.ping_due(800 * kMs - 1)) << "each time after twice as long";
  EXPECT_TRUE(window.ping_due(800 * kMs));
}

TEST(AckWindow, AsksAgainAtOnceWhereThePingCouldNotBeSent) {
  AckWindow window(2);
  window.open(1, 0);
  window.ping_sent(9, 200 * kMs);
  window.ping_not_sent();
  EXPECT_TRUE(window.ping_due(200 * kMs));
  EXPECT_EQ(window.ping_number(), 9u);
  window.ping_sent(9, 201 * kMs);
  EXPECT_TRUE(window.ping_due(401 * kMs)) << "it counts as the first";
  static_cast<void>(window.acknowledge(1, 0, 0, 201 * kMs));
  window.ping_not_sent();
  EXPECT_FALSE(window.ping_due(3600'000 * kMs)) << "nothing waits any more";
}

TEST(AckWindow, WaitsLongerWhereTheWayIsLong) {
  AckWindow window(2);
  window.open(1, 0);
  static_cast<void>(window.acknowledge(1, 0, 0, 100 * kMs));
  EXPECT_EQ(window.round_trip_ns(), 100 * kMs);
  window.open(1, 1000 * kMs);
  EXPECT_FALSE(window.ping_due(1400 * kMs - 1));
  EXPECT_TRUE(window.ping_due(1400 * kMs));
}

TEST(AckWindow, APongFreesOnlyWhatStoodBeforeThePing) {
  AckWindow window(4);
  fill(window, 2);
  window.ping_sent(9, 200 * kMs);
  fill(window, 2);
  const auto freed = window.acknowledge(2, 0, 9, 300 * kMs);
  EXPECT_EQ(freed.acknowledged, 1u);
  EXPECT_EQ(freed.lost, 1u) << "1 stood before the PING and did not come";
  EXPECT_EQ(window.size(), 2u) << "3 and 4 may be on their way";
  EXPECT_EQ(window.ping_number(), 0u);
}

TEST(AckWindow, APongOfAnotherPingFreesNothing) {
  AckWindow window(4);
  fill(window, 2);
  window.ping_sent(9, 200 * kMs);
  EXPECT_EQ(window.acknowledge(0, 0, 8, 300 * kMs).lost, 0u);
  EXPECT_EQ(window.size(), 2u);
}

TEST(AckWindow, TimeAloneNeverFrees) {
  AckWindow window(1);
  window.open(1, 0);
  for (std::int64_t now = 0; now < 3600'000 * kMs; now += 1000 * kMs) {
    if (window.ping_due(now)) window.ping_sent(9, now);
  }
  EXPECT_FALSE(window.has_room(1));
}

TEST(AckWindow, FreesWhatIsKnownToBeLost) {
  AckWindow window(3);
  fill(window, 3);
  EXPECT_EQ(window.lose(2).lost, 1u);
  EXPECT_EQ(window.lose(2).lost, 0u);
  EXPECT_EQ(window.lose(99).lost, 0u);
  EXPECT_EQ(window.lose_all().lost, 2u);
  EXPECT_TRUE(window.empty());
  EXPECT_FALSE(window.ping_due(3600'000 * kMs));
}

TEST(AckWindow, HurriesWhenSomethingIsDoubtful) {
  AckWindow window(3);
  window.open(1, 0);
  window.hurry();
  EXPECT_TRUE(window.ping_due(1));
  window.ping_sent(1, 1);
  EXPECT_FALSE(window.ping_due(2));
}

TEST(AckWindow, TakesBackWhatWasNotSent) {
  AckWindow window(1);
  const std::uint32_t sequence = window.open(1, 0);
  EXPECT_TRUE(window.cancel(sequence));
  EXPECT_TRUE(window.has_room(1));
  EXPECT_EQ(window.open(1, 0), sequence);
  static_cast<void>(window.lose_all());
  EXPECT_FALSE(window.cancel(sequence)) << "it did not wait any more";
}

}  // namespace
}  // namespace gimnet::gimi
