#include "hub/concurrent/mpsc_queue.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <memory>
#include <thread>
#include <vector>

namespace gimnet::hub {
namespace {

struct Item {
  std::size_t producer = 0;
  std::uint64_t number = 0;
};

TEST(MpscQueue, TakesAtMostWhatIsAskedFor) {
  MpscQueue<int> queue(1);
  for (int i = 0; i < 100; ++i) queue.push(0, i);
  std::vector<int> taken;
  EXPECT_EQ(queue.drain(33, [&](int item) { taken.push_back(item); }), 33u);
  EXPECT_EQ(taken.size(), 33u);
  EXPECT_FALSE(queue.empty());
  EXPECT_EQ(queue.drain(1'000, [&](int item) { taken.push_back(item); }), 67u);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(taken[static_cast<std::size_t>(i)], i);
  EXPECT_TRUE(queue.empty());
  EXPECT_EQ(queue.drain(1, [](int) { FAIL(); }), 0u);
}

TEST(MpscQueue, SaysSoBeforeItemsAreLookedAt) {
  MpscQueue<int> queue(1);
  for (int i = 0; i < 40; ++i) queue.push(0, i);
  int said = 0;
  int since = 0;
  queue.drain(
      100,
      [&] {
        ++said;
        since = 0;
      },
      [&](int) { ++since; });
  EXPECT_EQ(said, 2) << "32 items, and 8";
  EXPECT_EQ(since, 8);
}

#ifndef GIMNET_TSAN_QUEUE
TEST(MpscQueue, ABusyProducerDoesNotKeepTheOthersWaiting) {
  for (const std::size_t busy : {0u, 1u, 2u}) {
    MpscQueue<Item> queue(3);
    for (std::uint64_t i = 0; i < 1'000; ++i) queue.push(busy, {busy, i});
    for (std::size_t p = 0; p < 3; ++p) {
      if (p != busy) queue.push(p, {p, 0});
    }
    std::size_t others = 0;
    queue.drain(100, [&](const Item& item) { others += item.producer != busy; });
    EXPECT_EQ(others, 2u) << busy;
  }
}
#endif

TEST(MpscQueue, MovesItems) {
  MpscQueue<std::unique_ptr<int>> queue(2);
  queue.push(1, std::make_unique<int>(5));
  int value = 0;
  queue.drain(1, [&](std::unique_ptr<int> item) { value = *item; });
  EXPECT_EQ(value, 5);
}

// Provable: every item of every producer is taken once, and those of one producer in the order
// pushed, whatever the threads do.
TEST(MpscQueue, KeepsEachProducersOrderUnderThreads) {
  constexpr std::size_t kProducers = 3;
  constexpr std::uint64_t kItems = 50'000;
  MpscQueue<Item> queue(kProducers);
  std::vector<std::thread> producers;
  for (std::size_t p = 0; p < kProducers; ++p) {
    producers.emplace_back([&queue, p] {
      for (std::uint64_t i = 0; i < kItems; ++i) queue.push(p, {p, i});
    });
  }
  std::uint64_t next[kProducers] = {};
  std::uint64_t taken = 0;
  while (taken < kProducers * kItems) {
    taken += queue.drain(1'000,
                         [&](const Item& item) { ASSERT_EQ(item.number, next[item.producer]++); });
  }
  for (std::thread& producer : producers) producer.join();
  EXPECT_TRUE(queue.empty());
}

}  // namespace
}  // namespace gimnet::hub
