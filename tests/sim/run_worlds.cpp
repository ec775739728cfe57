#include "tests/sim/run_worlds.hpp"

#include <algorithm>

namespace gimnet::sim {
namespace {

[[noreturn]] void usage(const Simulation& simulation) {
  std::fprintf(stderr, "usage: %s [--seeds N] [--from SEED] [--seed SEED] [--expect CHECKER] ",
               simulation.program.data());
  for (const std::string_view flag : simulation.flags) std::fprintf(stderr, "[%s] ", flag.data());
  std::fprintf(
      stderr,
      "[--checkers]\n"
      "  --seeds N         so many worlds (%" PRIu64
      "), from seed 1 on\n"
      "  --from SEED       from that seed on\n"
      "  --seed SEED       that one world only\n"
      "  --expect CHECKER  succeed only if that checker finds something: for planted bugs\n"
      "  --checkers        the names of the checkers\n",
      simulation.seeds);
  std::exit(2);
}

/// Prints how often each fault and collision came. False: one never did.
bool print_census(const Simulation& simulation, const std::vector<std::uint64_t>& counts) {
  bool complete = true;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    std::printf("  %-18s %8" PRIu64 "\n", simulation.events[i].data(), counts[i]);
    complete = complete && counts[i] != 0;
  }
  return complete;
}

}  // namespace

Arguments read_arguments(const Simulation& simulation, int count, char** texts) {
  Arguments arguments;
  arguments.seeds = simulation.seeds;
  for (int at = 1; at < count; ++at) {
    const std::string_view flag = texts[at];
    if (flag == "--checkers") {
      for (const std::string_view name : simulation.checkers) std::puts(name.data());
      std::exit(0);
    }
    if (std::ranges::find(simulation.flags, flag) != simulation.flags.end()) {
      arguments.flags.push_back(flag);
      continue;
    }
    if (++at == count) usage(simulation);
    const std::uint64_t number = std::strtoull(texts[at], nullptr, 10);
    if (flag == "--expect") {
      arguments.expect = texts[at];
    } else if (number == 0) {
      usage(simulation);
    } else if (flag == "--seeds") {
      arguments.seeds = number;
    } else if (flag == "--from") {
      arguments.from = number;
    } else if (flag == "--seed") {
      arguments.from = number;
      arguments.seeds = 1;
    } else {
      usage(simulation);
    }
  }
  return arguments;
}

int run_worlds(const Simulation& simulation, const Arguments& arguments,
               const std::function<WorldOutcome(std::uint64_t seed)>& run_world,
               const std::function<std::vector<std::uint64_t>()>& counts) {
  for (std::uint64_t seed = arguments.from; seed < arguments.from + arguments.seeds; ++seed) {
    const WorldOutcome outcome = run_world(seed);
    if (!outcome.checker) continue;
    const std::string_view checker = simulation.checkers[*outcome.checker];
    // A planted bug shows itself in more than one way: another checker may be the first here.
    if (!arguments.expect.empty() && checker != arguments.expect) continue;
    std::printf("seed %" PRIu64 " (%s): %s: %s\nagain: %s", seed, outcome.words.c_str(),
                checker.data(), outcome.what.c_str(), simulation.program.data());
    for (const std::string_view flag : arguments.flags) std::printf(" %s", flag.data());
    std::printf(" --seed %" PRIu64 "\n", seed);
    return checker == arguments.expect ? 0 : 1;
  }
  std::printf("%" PRIu64 " worlds, nothing wrong\n", arguments.seeds);
  const bool complete = print_census(simulation, counts());
  if (!complete) std::puts("one of these never came");
  if (!arguments.expect.empty()) return 1;
  return complete || arguments.seeds < simulation.seeds_for_all ? 0 : 1;
}

}  // namespace gimnet::sim
