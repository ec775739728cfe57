#include "hub/data/ring_queue.hpp"

#include <gtest/gtest.h>

#include <memory>

namespace gimnet::hub {
namespace {

TEST(RingQueue, KeepsOrderAndNumbersWhileItGrows) {
  RingQueue<int> queue;
  std::uint64_t popped = 0;
  for (int i = 0; i < 1'000; ++i) {
    queue.push_back(i);
    EXPECT_EQ(queue.end_number(), static_cast<std::uint64_t>(i) + 1);
    if (i % 3 == 0) {
      EXPECT_EQ(queue.front(), static_cast<int>(popped));
      queue.pop_front();
      ++popped;
    }
  }
  EXPECT_EQ(queue.first_number(), popped);
  EXPECT_EQ(queue.size(), 1'000 - popped);
  for (std::uint64_t number = popped; number < 1'000; ++number)
    EXPECT_EQ(queue.at(number), static_cast<int>(number));
  EXPECT_EQ(queue.back(), 999);
}

TEST(RingQueue, LetsItemsGoWhenTheyLeave) {
  RingQueue<std::shared_ptr<int>> queue;
  const auto item = std::make_shared<int>(1);
  queue.push_back(item);
  EXPECT_EQ(item.use_count(), 2);
  queue.pop_front();
  EXPECT_EQ(item.use_count(), 1);
  for (int i = 0; i < 100; ++i) queue.push_back(item);
  queue.clear();
  EXPECT_EQ(item.use_count(), 1);
  EXPECT_TRUE(queue.empty());
}

TEST(RingQueue, GoesOnAfterATrim) {
  RingQueue<int> queue;
  for (int i = 0; i < 100; ++i) queue.push_back(i);
  queue.trim();
  EXPECT_EQ(queue.size(), 100u) << "nothing is lost";
  while (!queue.empty()) queue.pop_front();
  queue.trim();
  queue.push_back(7);
  EXPECT_EQ(queue.front(), 7);
  EXPECT_EQ(queue.first_number(), 100u) << "numbers are never used again";
}

}  // namespace
}  // namespace gimnet::hub
