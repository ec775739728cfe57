#include "hub/data/buffer_pool.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <vector>

namespace gimnet::hub {
namespace {

class Pools : public ::testing::Test {
 protected:
  Budget budget{64ull << 20};
  BudgetLease lease{budget};
  BufferPool pool{65'536, lease};
  BudgetLease other_lease{budget};
  BufferPool other{65'536, other_lease};
};

using BufferPoolTest = Pools;

TEST_F(BufferPoolTest, GivesTheSameMemoryAgain) {
  BufferRef first = pool.take_slab();
  const std::byte* data = first->data;
  EXPECT_GE(first->capacity, kSlabReadBytes + 16 + 65'536);
  first.reset();
  EXPECT_EQ(pool.take_slab()->data, data);
}

TEST_F(BufferPoolTest, AReferenceKeepsTheBuffer) {
  BufferRef first = pool.take_slab();
  BufferRef second = first.share();
  EXPECT_EQ(first->references, 2u);
  first.reset();
  EXPECT_NE(pool.take_slab().get(), second.get());
  BufferRef moved = std::move(second);
  EXPECT_EQ(moved->references, 1u);
}

TEST_F(BufferPoolTest, ChunksAreAtLeastAsLargeAsAskedFor) {
  for (const std::uint32_t bytes :
       {1u, 1'024u, 1'025u, 4'096u, 4'097u, 16'384u, 16'385u, 100'000u}) {
    const BufferRef chunk = pool.take_chunk(bytes);
    EXPECT_GE(chunk->capacity, bytes);
    EXPECT_EQ(chunk->kind, BufferKind::chunk);
  }
}

// The budget would not know of the bytes by which the allocator rounds up.
TEST_F(BufferPoolTest, ASharedChunkIsAsMuchMemoryAsTheAllocatorGives) {
  for (const std::uint32_t bytes :
       {1u, 256 - kBufferRoom, 1'024 - kBufferRoom, 4'096 - kBufferRoom}) {
    const BufferRef chunk = pool.take_chunk(bytes);
    EXPECT_TRUE(std::has_single_bit(kBufferRoom + chunk->capacity)) << bytes;
  }
  EXPECT_EQ(kBufferRoom + pool.take_chunk(kSharedChunkBytes)->capacity, 14u * 1'024);
  EXPECT_GT(pool.take_chunk(kSharedChunkBytes + 1)->capacity, kSharedChunkBytes);
}

TEST_F(BufferPoolTest, PinsABufferOnceUntilItIsFree) {
  BufferRef slab = pool.take_slab();
  const std::uint64_t memory = kBufferRoom + slab->capacity;
  pool.pin(*slab.get(), lease);
  pool.pin(*slab.get(), lease);
  EXPECT_EQ(pool.pinned_bytes(), memory);
  const BufferRef second = slab.share();
  slab.reset();
  EXPECT_EQ(pool.pinned_bytes(), memory);
  BufferRef moved = second.share();
  moved.reset();
  EXPECT_EQ(pool.pinned_bytes(), memory);
}

TEST_F(BufferPoolTest, AFreedPinIsGivenBack) {
  {
    const BufferRef slab = pool.take_slab();
    pool.pin(*slab.get(), lease);
  }
  EXPECT_EQ(pool.pinned_bytes(), 0u);
  EXPECT_EQ(pool.take_slab()->payer, nullptr);
}

TEST_F(BufferPoolTest, TheFirstPayerPaysUntilTheBufferIsFree) {
  Budget links{4ull << 20};
  BudgetLease link_lease{links};
  {
    const BufferRef slab = pool.take_slab();
    pool.pin(*slab.get(), link_lease);
    pool.pin(*slab.get(), lease);
    EXPECT_LT(links.left(), links.total());
    EXPECT_EQ(budget.left(), budget.total());
    EXPECT_EQ(pool.pinned_bytes(), kBufferRoom + slab->capacity) << "counted once";
  }
  EXPECT_EQ(links.left() + 2 * links.piece_bytes(), links.total()) << "all but what a shard keeps";
  EXPECT_EQ(budget.left(), budget.total());
}

TEST_F(BufferPoolTest, ALentSlabIsNotReusedBeforeItsLoanEnds) {
  BufferRef slab = pool.take_slab();
  Buffer* const memory = slab.get();
  Buffer* const lent = BufferPool::lend(*slab.get());
  slab.reset();
  EXPECT_NE(pool.take_slab().get(), memory);
  BufferPool::end_loan(lent);
  const BufferRef held = pool.take_slab();  // the free one
  EXPECT_EQ(pool.take_slab().get(), memory) << "reclaimed";
}

// Chunks that one burst lent do not stay for ever, though nobody asks for a slab again.
TEST_F(BufferPoolTest, TakesBackWhatWasLent) {
  std::vector<Buffer*> loans;
  std::vector<BufferRef> used;
  for (int i = 0; i < 40; ++i) {
    used.push_back(i % 2 == 0 ? pool.take_slab() : pool.take_chunk(60'000));
    loans.push_back(BufferPool::lend(*used.back().get()));
  }
  const Buffer* const chunk = used.back().get();
  used.clear();
  EXPECT_EQ(pool.lent_buffers(), 40u);
  BufferPool::end_loan(loans.back());
  loans.pop_back();
  pool.take_back_lent();
  EXPECT_EQ(pool.lent_buffers(), 39u) << "the others are still read";
  EXPECT_EQ(pool.take_chunk(60'000).get(), chunk);
  for (Buffer* loan : loans) BufferPool::end_loan(loan);
  pool.take_back_lent();
  EXPECT_EQ(pool.lent_buffers(), 0u);
}

TEST_F(BufferPoolTest, KeepsLittleWhileMemoryIsScarce) {
  const auto use_many = [&] {
    std::vector<BufferRef> used;
    for (int i = 0; i < 200; ++i) used.push_back(pool.take_chunk(4'000));
  };
  use_many();
  EXPECT_GT(pool.kept_chunk_bytes(), 800'000u);
  lease.take(60 << 20);
  lease.begin_turn(0);
  ASSERT_TRUE(lease.scarce());
  pool.free_kept();
  EXPECT_LE(pool.kept_chunk_bytes(), 256u * 1'024);
  use_many();
  EXPECT_LE(pool.kept_chunk_bytes(), 260u * 1'024);
  EXPECT_GT(pool.kept_chunk_bytes(), 200u * 1'024) << "enough for some turns";
  lease.give_back(60 << 20);
}

TEST_F(BufferPoolTest, KeepsChunksUpToTheLargestFrame) {
  for (const std::uint32_t bytes : {1'024u, 4'096u, 16'384u, 65'536u + 16}) {
    BufferRef chunk = pool.take_chunk(bytes);
    const Buffer* const memory = chunk.get();
    chunk.reset();
    EXPECT_EQ(pool.take_chunk(bytes).get(), memory) << bytes;
  }
}

TEST_F(BufferPoolTest, ABorrowedSlabIsGivenBackWithTheLastReference) {
  BufferRef slab = pool.take_slab();
  {
    const BufferRef foreign = other.adopt(BufferPool::lend(*slab.get()));
    EXPECT_EQ(foreign->kind, BufferKind::foreign);
    EXPECT_EQ(foreign->data, slab->data);
    const BufferRef again = foreign.share();
    EXPECT_EQ(slab->lent.load(), 1u);
  }
  EXPECT_EQ(slab->lent.load(), 0u);
}

// However many mailbox entries lie in one slab, it is one piece of memory, and counts once.
TEST_F(BufferPoolTest, ASlabThatIsBorrowedOftenIsPinnedOnce) {
  BufferRef slab = pool.take_slab();
  std::vector<BufferRef> borrowed;
  for (int i = 0; i < 100; ++i) {
    borrowed.push_back(other.adopt(BufferPool::lend(*slab.get())));
    other.pin(*borrowed.back().get(), other_lease);
  }
  EXPECT_EQ(other.pinned_bytes(), kBufferRoom + slab->capacity);
  borrowed.clear();
  EXPECT_EQ(other.pinned_bytes(), 0u);
  EXPECT_EQ(slab->lent.load(), 0u);
  const BufferRef later = other.adopt(BufferPool::lend(*slab.get()));
  EXPECT_EQ(later->data, slab->data);
}

TEST_F(BufferPoolTest, LendingABorrowedSlabLendsTheSlabBehindIt) {
  BufferRef slab = pool.take_slab();
  const BufferRef foreign = other.adopt(BufferPool::lend(*slab.get()));
  EXPECT_EQ(BufferPool::lend(*foreign.get()), slab.get());
  BufferPool::end_loan(slab.get());
}

// If memory is scarce, a frame takes its own size and not the room of the next class.
TEST_F(BufferPoolTest, AnExactChunkIsFreedAfterItsUse) {
  const std::size_t kept = pool.kept_chunk_bytes();
  {
    const BufferRef chunk = pool.take_exact(20'000);
    EXPECT_EQ(chunk->capacity, 20'000u);
    EXPECT_EQ(chunk->kind, BufferKind::chunk);
    pool.pin(*chunk.get(), lease);
    EXPECT_EQ(pool.pinned_bytes(), 20'000u + kBufferRoom);
  }
  EXPECT_EQ(pool.pinned_bytes(), 0u);
  EXPECT_EQ(pool.kept_chunk_bytes(), kept);
}

}  // namespace
}  // namespace gimnet::hub
