#include "hub/data/tables/node_table.hpp"

#include <sys/mman.h>

#include <new>

#include "base/check.hpp"

namespace gimnet::hub {
namespace {
constexpr std::size_t kWords = std::size_t{1} << kIndexBits;
constexpr std::size_t kExpectedWords = kWords / 64;
constexpr std::size_t kTableBytes = (kWords + kExpectedWords) * sizeof(std::atomic<std::uint64_t>);
static_assert(std::atomic<std::uint64_t>::is_always_lock_free);
}  // namespace

NodeTable::NodeTable() {
  // Anonymous memory is zero, which is the empty entry, and costs nothing until an index is used.
  void* memory = ::mmap(nullptr, kTableBytes, PROT_READ | PROT_WRITE,
                        MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (memory == MAP_FAILED) throw std::bad_alloc{};
  words_ = static_cast<std::atomic<std::uint64_t>*>(memory);
  expected_ = words_ + kWords;
}

NodeTable::~NodeTable() { ::munmap(static_cast<void*>(words_), kTableBytes); }

void NodeTable::publish(std::uint32_t index, NodePlace place) {
  GIMNET_CHECK(index < kWords && place.slot.value() < kSlotsMax &&
               place.shard.value() < kShardsMax);
  if (may_return(index)) change_expected(index, false);  // it came, and may leave for good
  const NodePlace before = find(index);
  const std::uint64_t word = place.exists() ? pack(place) : place.slot.value();
  words_[index].store(word, std::memory_order_release);  // pairs with the acquire load in find()
  epoch_.fetch_add(1, std::memory_order_release);        // pairs with the acquire load in epoch()
  std::uint64_t shards = shards_.load(std::memory_order_relaxed);  // relaxed: this thread wrote it
  if (before.exists() && change_count(before.shard, -1) == 0)
    shards &= ~(std::uint64_t{1} << before.shard.value());
  if (place.exists() && change_count(place.shard, 1) == 1)
    shards |= std::uint64_t{1} << place.shard.value();
  shards_.store(shards, std::memory_order_relaxed);  // relaxed: see shards()
}

std::uint32_t NodeTable::change_count(ShardIndex shard, int change) {
  std::atomic<std::uint32_t>& nodes = nodes_by_shard_[shard.value()];
  // relaxed: this thread wrote it
  const std::uint32_t count =
      nodes.load(std::memory_order_relaxed) + static_cast<std::uint32_t>(change);
  nodes.store(count, std::memory_order_relaxed);  // relaxed: see nodes_on()
  return count;
}

void NodeTable::expect(std::uint32_t index) {
  GIMNET_CHECK(index > 0 && index < kWords);
  change_expected(index, true);
}

void NodeTable::expect_nobody() {
  for (std::size_t word = 0; word < kExpectedWords; ++word) {
    // Memory that is only read stays the kernel's one page of zeros.
    if (expected_[word].load(std::memory_order_relaxed) == 0)
      continue;                                           // relaxed: this thread wrote it
    expected_[word].store(0, std::memory_order_relaxed);  // relaxed: see may_return()
  }
}

void NodeTable::change_expected(std::uint32_t index, bool expected) {
  const std::uint64_t bit = std::uint64_t{1} << (index % 64);
  const std::uint64_t before =
      expected_[index / 64].load(std::memory_order_relaxed);  // relaxed: this thread wrote it
  // relaxed: see may_return()
  expected_[index / 64].store(expected ? before | bit : before & ~bit, std::memory_order_relaxed);
}

}  // namespace gimnet::hub
