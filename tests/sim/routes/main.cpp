#include <cinttypes>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string_view>

#include "tests/sim/routes/world.hpp"

// The simulation of routes: gimnet-sim-routes. See tests/sim/README.md.

namespace gimnet::sim::routes {
namespace {

constexpr const char* kUsage =
    "usage: gimnet-sim-routes [--seeds N] [--from SEED] [--seed SEED] [--expect CHECKER] "
    "[--checkers]\n"
    "  --seeds N         so many worlds (500), from seed 1 on\n"
    "  --from SEED       from that seed on\n"
    "  --seed SEED       that one world only\n"
    "  --expect CHECKER  succeed only if that checker finds something: for planted bugs\n"
    "  --checkers        the names of the checkers\n";

/// In so many worlds each fault and collision comes.
constexpr std::uint64_t kSeeds = 500;

struct Arguments {
  std::uint64_t from = 1;
  std::uint64_t seeds = kSeeds;
  std::string_view expect;
};

[[noreturn]] void usage() {
  std::fputs(kUsage, stderr);
  std::exit(2);
}

Arguments read_arguments(int count, char** texts) {
  Arguments arguments;
  for (int at = 1; at < count; ++at) {
    const std::string_view flag = texts[at];
    if (flag == "--checkers") {
      for (const std::string_view name : kCheckerNames) std::puts(name.data());
      std::exit(0);
    }
    if (++at == count) usage();
    const std::uint64_t number = std::strtoull(texts[at], nullptr, 10);
    if (flag == "--expect") {
      arguments.expect = texts[at];
    } else if (number == 0) {
      usage();
    } else if (flag == "--seeds") {
      arguments.seeds = number;
    } else if (flag == "--from") {
      arguments.from = number;
    } else if (flag == "--seed") {
      arguments.from = number;
      arguments.seeds = 1;
    } else {
      usage();
    }
  }
  return arguments;
}

/// Prints how often each fault and collision came. False: one never did.
bool print_census(const Census& census) {
  bool complete = true;
  for (std::size_t i = 0; i < kEventNames.size(); ++i) {
    std::printf("  %-16s %8" PRIu64 "\n", kEventNames[i].data(), census.counts()[i]);
    complete = complete && census.counts()[i] != 0;
  }
  return complete;
}

/// The exit status.
int run(const Arguments& arguments) {
  Census census;
  for (std::uint64_t seed = arguments.from; seed < arguments.from + arguments.seeds; ++seed) {
    World world(seed);
    const auto failure = world.run();
    census.add(world.census());
    if (!failure) continue;
    const std::string_view checker = kCheckerNames[static_cast<std::size_t>(failure->checker)];
    std::printf("seed %" PRIu64 " (%s): %s: %s\nagain: gimnet-sim-routes --seed %" PRIu64 "\n",
                seed, world.words().c_str(), checker.data(), failure->what.c_str(), seed);
    return checker == arguments.expect ? 0 : 1;
  }
  std::printf("%" PRIu64 " worlds of routes, nothing wrong\n", arguments.seeds);
  const bool complete = print_census(census);
  if (!complete) std::puts("one of these never came");
  if (arguments.seeds < kSeeds) return arguments.expect.empty() ? 0 : 1;
  return arguments.expect.empty() && complete ? 0 : 1;
}

}  // namespace
}  // namespace gimnet::sim::routes

int main(int argc, char** argv) {
  return gimnet::sim::routes::run(gimnet::sim::routes::read_arguments(argc, argv));
}
