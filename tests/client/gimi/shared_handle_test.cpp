#include "gimnet/gimi/shared_handle.hpp"

#include <gtest/gtest.h>

#include <thread>
#include <utility>
#include <vector>

#include "gimnet/gimi_wait.h"

namespace gimnet::detail {
namespace {

/// Of a kind that needs no hub.
SharedHandle made() {
  gimi_handle set = 0;
  EXPECT_EQ(gimi_wait_set_create(&set), GIMI_OK);
  return SharedHandle(set);
}

bool is_open(gimi_handle handle) { return gimi_wait_set_wake(handle) == GIMI_OK; }

TEST(SharedHandle, IsClosedWithItsLastCopy) {
  SharedHandle first = made();
  const gimi_handle handle = first.value();
  EXPECT_TRUE(first);
  {
    const SharedHandle second = first;
    SharedHandle third = std::move(first);
    EXPECT_EQ(third.value(), handle);
    first = second;
    third = SharedHandle();
    EXPECT_TRUE(is_open(handle));
  }
  EXPECT_TRUE(is_open(handle));
  first = made();
  EXPECT_FALSE(is_open(handle));
  EXPECT_TRUE(is_open(first.value()));
}

TEST(SharedHandle, IsNoneByItselfAndWhenItWasMovedFrom) {
  SharedHandle handle;
  EXPECT_FALSE(handle);
  EXPECT_EQ(handle.value(), 0u);
  const SharedHandle copy = handle;
  EXPECT_FALSE(copy);
  handle = made();
  const SharedHandle moved = std::move(handle);
  EXPECT_FALSE(handle);  // NOLINT(bugprone-use-after-move)
  EXPECT_EQ(handle.value(), 0u);
  EXPECT_TRUE(is_open(moved.value()));
}

TEST(SharedHandle, IsNotClosedWhenItIsAssignedToItself) {
  SharedHandle handle = made();
  const SharedHandle& same = handle;
  handle = same;
  EXPECT_TRUE(is_open(handle.value()));
  handle = std::move(const_cast<SharedHandle&>(same));
  EXPECT_TRUE(is_open(handle.value()));
}

// Each thread has copies of its own. What can be proved: the handle is open while any thread has
// one, and is closed when all are gone, by whichever thread. ThreadSanitizer proves that the last
// one comes after the others.
TEST(SharedHandle, IsCopiedByManyThreads) {
  for (int round = 0; round < 50; ++round) {
    SharedHandle first = made();
    const gimi_handle handle = first.value();
    std::vector<std::thread> threads;
    for (int i = 0; i < 4; ++i) {
      threads.emplace_back([handle, own = first] {
        std::vector<SharedHandle> copies;
        for (int j = 0; j < 200; ++j) {
          copies.push_back(own);
          if (j % 3 == 0) copies.erase(copies.begin());
        }
        EXPECT_TRUE(is_open(handle));
      });
    }
    first = SharedHandle();
    for (std::thread& thread : threads) thread.join();
    EXPECT_FALSE(is_open(handle));
  }
}

}  // namespace
}  // namespace gimnet::detail
