#include "hub/shard/io_shard.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <thread>

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

}  // namespace
}  // namespace gimnet::hub
