#include <gtest/gtest.h>
#include <malloc.h>

#include <algorithm>
#include <cstdio>
#include <ctime>
#include <string>
#include <vector>

#include "base/log.hpp"
#include "proto/control/ns.hpp"
#include "proto/control/ns_register.hpp"
#include "tests/hub/control/support/test_conductor.hpp"
#include "tests/stress/support/size.hpp"

// A node takes another name, and each of its services has very many subscribers, who are all told.
// The conductor alone: provable is how long its thread takes, in all and until it could answer
// somebody else, and the memory of what it tells the shards, if they carry out nothing meanwhile.

namespace gimnet::hub {
namespace {

namespace ns = proto::ns;

double thread_seconds() {
  timespec now{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + static_cast<double>(now.tv_nsec) * 1e-9;
}

double heap_megabytes() {
  const struct mallinfo2 info = ::mallinfo2();
  return static_cast<double>(info.uordblks + info.hblkhd) / 1e6;
}

TEST(Rename, OfManyServicesWithManySubscribersIsQuickAndSmall) {
  // One event encoded for each subscriber took 4 s and 400 MB in the full size.
  const bool full = stress::is_full_size();
  const std::size_t services = full ? 1'000 : 100;
  const std::size_t readers = 1'000;
  const double seconds_max = full ? 0.2 : 0.1;
  const double step_seconds_max = full ? 0.02 : 0.2;
  const double megabytes_max = full ? 40 : 4;
  set_log_level(LogLevel::off);
  TestConductor hub;
  const TestConductor::Node robot = hub.join("robot");
  for (std::size_t k = 0; k < services; ++k) {
    ASSERT_TRUE(hub.ask<ns::AdvertiseAnswer>(
        robot, ns::Advertise{.service = "service-" + std::to_string(k)}));
  }
  for (std::size_t i = 0; i < readers; ++i) {
    const TestConductor::Node reader = hub.join("reader-" + std::to_string(i));
    for (std::size_t k = 0; k < services; ++k) {
      ASSERT_TRUE(hub.ask<ns::SubscribeAnswer>(
          reader, ns::Subscribe{"robot/service-" + std::to_string(k)}));
    }
    hub.shards.sent.clear();
  }
  std::vector<TellCommand> told;
  hub.shards.on_tell = [&](TellCommand command) { told.push_back(std::move(command)); };
  const double heap_before = heap_megabytes();
  double seconds = 0;
  double step_seconds = 0;
  std::size_t steps = 0;
  const auto step = [&](const auto& take) {
    const double before = thread_seconds();
    const bool more = take();
    const double taken = thread_seconds() - before;
    seconds += taken;
    step_seconds = std::max(step_seconds, taken);
    ++steps;
    return more;
  };
  bool more = step([&] {
    EXPECT_TRUE(hub.ask<ns::RegisterNameAnswer>(robot, ns::RegisterName{"lifter"}));
    return hub.conductor.tells_later();
  });
  while (more) more = step([&] { return hub.conductor.tell_rest(hub.now); });
  const double megabytes = heap_megabytes() - heap_before;
  set_log_level(LogLevel::info);
  std::size_t events = 0;
  for (const TellCommand& command : told) events += command.to.size();
  EXPECT_EQ(events, services * readers);
  EXPECT_LE(told.size(), services * readers / 200) << "each is one encoding";
  EXPECT_EQ(steps, (events + hub.limits.told_at_once - 1) / hub.limits.told_at_once);
  EXPECT_LE(step_seconds, step_seconds_max) << "so long does another request wait";
  EXPECT_LE(seconds, seconds_max);
  EXPECT_LE(megabytes, megabytes_max);
  std::printf("%zu events in %zu encodings: %.1f ms, %.1f MB, %zu steps of at most %.1f ms\n",
              events, told.size(), seconds * 1e3, megabytes, steps, step_seconds * 1e3);
}

}  // namespace
}  // namespace gimnet::hub
