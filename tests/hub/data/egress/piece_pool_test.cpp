#include "hub/data/egress/piece_pool.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace gimnet::hub {
namespace {

class PiecePoolTest : public ::testing::Test {
 protected:
  Budget budget{4ull << 20};
  BudgetLease lease{budget};
  PiecePool pool{lease};
};

TEST_F(PiecePoolTest, GivesTheSameMemoryAgain) {
  PieceRef first = pool.take(hub::Run{{}, nullptr, 10, 1});
  const MorePieces* memory = first.get();
  EXPECT_EQ(first->run.size, 10u);
  first.reset();
  EXPECT_EQ(pool.kept(), 1u);
  const PieceRef second = pool.take(hub::Run{{}, nullptr, 20, 2});
  EXPECT_EQ(second.get(), memory);
  EXPECT_EQ(second->run.size, 20u);
  EXPECT_EQ(second->next, nullptr);
  EXPECT_EQ(pool.kept(), 0u);
}

// As many as a hostile node can make wait: given back one after the other, not one inside the
// other.
TEST_F(PiecePoolTest, TakesBackAMillionThatHangTogether) {
  PieceRef first = pool.take(hub::Run{});
  MorePieces* last = first.get();
  for (int i = 0; i < 1'000'000; ++i) {
    last->next = pool.take(hub::Run{});
    last = last->next.get();
  }
  first.reset();
  EXPECT_EQ(pool.kept(), PiecePool::kKeptMax);
}

TEST_F(PiecePoolTest, CountsWhatIsInUseAgainstTheBudget) {
  std::vector<PieceRef> pieces;
  while (!lease.exhausted()) pieces.push_back(pool.take(hub::Run{}));
  EXPECT_EQ(pieces.size(), (4u << 20) / sizeof(MorePieces) + 1);
  pieces.clear();
  EXPECT_FALSE(lease.exhausted());
}

}  // namespace
}  // namespace gimnet::hub
