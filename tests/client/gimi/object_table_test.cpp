#include "client/gimi/object_table.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <memory>
#include <thread>
#include <vector>

namespace gimnet::gimi {
namespace {

struct Counted final : Object {
  explicit Counted(std::atomic<int>& the_living) : living(the_living) { ++living; }
  ~Counted() override { --living; }
  void end() override { ended = true; }
  std::atomic<int>& living;
  std::atomic<bool> ended{false};
};

gimi_handle add(std::atomic<int>& living, HandleKind kind = HandleKind::queue) {
  return add_object(kind, std::make_unique<Counted>(living));
}

TEST(ObjectTable, FindsWhatAHandleStandsFor) {
  std::atomic<int> living = 0;
  const gimi_handle handle = add(living);
  ASSERT_NE(handle, 0u);
  {
    const ObjectRef ref = find_object(handle);
    EXPECT_NE(ref.object(), nullptr);
    EXPECT_EQ(ref.kind(), HandleKind::queue);
  }
  EXPECT_EQ(close_object(handle), GIMI_OK);
  EXPECT_EQ(living, 0);
}

TEST(ObjectTable, RefusesWhatIsNoHandle) {
  std::atomic<int> living = 0;
  const gimi_handle handle = add(living);
  const gimi_handle of_another_kind = handle ^ (gimi_handle{1} << 24);
  const gimi_handle of_another_time = handle + (gimi_handle{1} << 32);
  for (const gimi_handle wrong : {gimi_handle{0}, ~gimi_handle{0}, gimi_handle{0x00FF'FFFF},
                                  of_another_kind, of_another_time}) {
    EXPECT_EQ(find_object(wrong).status(), GIMI_CLOSED) << wrong;
    EXPECT_EQ(close_object(wrong), GIMI_CLOSED) << wrong;
  }
  EXPECT_EQ(living, 1);
  EXPECT_EQ(close_object(handle), GIMI_OK);
  EXPECT_EQ(find_object(handle).status(), GIMI_CLOSED);
  EXPECT_EQ(close_object(handle), GIMI_CLOSED);
}

TEST(ObjectTable, AnObjectLivesUntilTheLastCallLeavesIt) {
  std::atomic<int> living = 0;
  const gimi_handle handle = add(living);
  {
    const ObjectRef inside = find_object(handle);
    EXPECT_EQ(close_object(handle), GIMI_OK);
    EXPECT_TRUE(static_cast<Counted*>(inside.object())->ended);
    EXPECT_EQ(living, 1);
  }
  EXPECT_EQ(living, 0);
}

TEST(ObjectTable, ASlotThatIsUsedAgainHasAnotherHandle) {
  std::atomic<int> living = 0;
  const gimi_handle former = add(living);
  EXPECT_EQ(close_object(former), GIMI_OK);
  const gimi_handle next = add(living);
  EXPECT_NE(former, next);
  EXPECT_EQ(find_object(former).object(), nullptr);
  EXPECT_EQ(close_object(next), GIMI_OK);
}

// It can be proved that one of those who try closes each handle, and that each object ends once.
TEST(ObjectTable, ManyThreadsOpenFindAndClose) {
  constexpr int kThreads = 4;
  constexpr int kRounds = 5'000;
  std::atomic<int> living = 0;
  std::atomic<gimi_handle> shared = 0;
  std::atomic<int> closed = 0;
  std::vector<std::thread> threads;
  for (int i = 0; i < kThreads; ++i) {
    threads.emplace_back([&] {
      for (int round = 0; round < kRounds; ++round) {
        const gimi_handle mine = add(living);
        const gimi_handle other = shared.exchange(mine);
        const ObjectRef inside = find_object(other);
        for (const gimi_handle handle : {other, other}) closed += close_object(handle) == GIMI_OK;
      }
    });
  }
  for (auto& thread : threads) thread.join();
  closed += close_object(shared) == GIMI_OK;
  EXPECT_EQ(closed, kThreads * kRounds);
  EXPECT_EQ(living, 0);
}

}  // namespace
}  // namespace gimnet::gimi
