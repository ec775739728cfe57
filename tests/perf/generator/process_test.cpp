#include "generator/process.hpp"

#include <gtest/gtest.h>
#include <poll.h>
#include <unistd.h>

#include <chrono>

namespace gimnet::perf {
namespace {

TEST(Process, CountsContextSwitches) {
  constexpr int kSleeps = 20;
  const auto before = context_switches(::getpid());
  for (int sleep = 0; sleep < kSleeps; ++sleep) ::poll(nullptr, 0, 1);
  EXPECT_GE(context_switches(::getpid()) - before, kSleeps) << "each sleep is one at least";
}

TEST(Process, CountsTheTimeOfWhatItDid) {
  const auto before = cpu_time_ns(::getpid());
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(30);
  while (cpu_time_ns(::getpid()) == before && std::chrono::steady_clock::now() < deadline) continue;
  EXPECT_GT(cpu_time_ns(::getpid()), before);
}

TEST(Process, KnowsTheMemoryThatIsAndWas) {
  EXPECT_GT(resident_bytes(::getpid()), 0);
  EXPECT_GE(peak_resident_bytes(::getpid()), resident_bytes(::getpid()));
}

}  // namespace
}  // namespace gimnet::perf
