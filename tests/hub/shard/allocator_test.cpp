#include "hub/shard/allocator.hpp"

#include <gtest/gtest.h>

#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <fstream>
#include <thread>
#include <vector>

namespace gimnet::hub {
namespace {

void allocate(std::size_t bytes) {
  void* memory = std::malloc(bytes);
  ASSERT_NE(memory, nullptr);
  *static_cast<volatile char*>(memory) = 1;  // or the compiler leaves both calls out
  std::free(memory);
}

TEST(AllocationMeter, CountsWhatItsThreadAllocates) {
  const AllocationMeter meter;
  const std::uint64_t before = meter.bytes();
  allocate(10'000);
  EXPECT_GE(meter.bytes(), before + 10'000) << "is this test linked with jemalloc?";
  const std::uint64_t after = meter.bytes();
  EXPECT_EQ(meter.bytes(), after) << "asking costs nothing";
}

TEST(AllocationMeter, DoesNotCountOtherThreads) {
  const AllocationMeter meter;
  std::thread other;
  std::uint64_t theirs = 0;
  other = std::thread([&theirs] {
    const AllocationMeter own;
    const std::uint64_t before = own.bytes();
    allocate(1 << 20);
    theirs = own.bytes() - before;
  });
  const std::uint64_t before = meter.bytes();
  other.join();
  EXPECT_GE(theirs, 1u << 20);
  EXPECT_LT(meter.bytes() - before, 1u << 20);
}

std::size_t resident_bytes() {
  std::ifstream file("/proc/self/statm");
  std::size_t all = 0;
  std::size_t resident = 0;
  file >> all >> resident;
  return resident * static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
}

TEST(ReturnFreedPages, GivesBackWhatItsThreadHasFreed) {
  constexpr std::size_t kBlockBytes = 64 * 1024;
  constexpr std::size_t kBlocks = 512;
  std::vector<void*> blocks(kBlocks);
  for (void*& block : blocks) {
    block = std::malloc(kBlockBytes);
    ASSERT_NE(block, nullptr);
    std::memset(block, 1, kBlockBytes);
  }
  for (void* block : blocks) std::free(block);
  const std::size_t before = resident_bytes();
  return_freed_pages();
  EXPECT_LT(resident_bytes() + kBlocks * kBlockBytes / 2, before);
}

}  // namespace
}  // namespace gimnet::hub
