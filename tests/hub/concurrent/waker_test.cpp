#include "hub/concurrent/waker.hpp"

#include <gtest/gtest.h>
#include <poll.h>

#include <atomic>
#include <thread>

namespace gimnet::hub {
namespace {

bool readable(int descriptor, int timeout_ms) {
  pollfd wanted{descriptor, POLLIN, 0};
  return ::poll(&wanted, 1, timeout_ms) == 1;
}

TEST(Waker, CostsNothingWhileItsThreadRuns) {
  Waker waker;
  EXPECT_FALSE(waker.wake());
  EXPECT_FALSE(readable(waker.descriptor(), 0));
}

TEST(Waker, OnlyTheFirstWakePaysForTheCall) {
  Waker waker;
  waker.prepare_to_sleep();
  EXPECT_TRUE(waker.wake());
  EXPECT_FALSE(waker.wake());
  EXPECT_TRUE(readable(waker.descriptor(), 0));
  waker.awake();
  waker.clear();
  EXPECT_FALSE(readable(waker.descriptor(), 0));
}

TEST(Waker, AnAwakenedThreadIsNotWokenAgain) {
  Waker waker;
  waker.prepare_to_sleep();
  waker.awake();
  EXPECT_FALSE(waker.wake());
}

// Provable: an item published before wake() is seen by a sleeper that looked after
// prepare_to_sleep(), or the sleeper's descriptor becomes readable. So no item is left lying with
// both threads at rest.
TEST(Waker, NoItemIsLeftBehindASleepingThread) {
  constexpr int kItems = 20'000;
  Waker waker;
  std::atomic<int> published{0};
  std::thread producer([&] {
    for (int i = 1; i <= kItems; ++i) {
      published.store(i, std::memory_order_release);  // pairs with the sleeper's acquire
      waker.wake();
    }
  });
  int seen = 0;
  while (seen < kItems) {
    waker.prepare_to_sleep();
    if (published.load(std::memory_order_acquire) == seen) {
      ASSERT_TRUE(readable(waker.descriptor(), 20'000)) << "asleep with work at " << seen;
      waker.clear();
    }
    waker.awake();
    seen = published.load(std::memory_order_acquire);
  }
  producer.join();
}

}  // namespace
}  // namespace gimnet::hub
