#pragma once

#include <cinttypes>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

// The command line that the simulations of hubs share, and the loop over their worlds.

namespace gimnet::sim {

/// The end of one world.
struct WorldOutcome {
  std::optional<std::size_t> checker;  ///< that found something
  std::string what;
  std::string words;  ///< of the world
};

/// A simulation as its command line shows it.
struct Simulation {
  std::string_view program;
  std::span<const std::string_view> checkers;
  std::span<const std::string_view> events;
  /// In so many worlds each fault and collision comes.
  std::uint64_t seeds_for_all;
  std::uint64_t seeds;                  ///< of a plain run
  std::vector<std::string_view> flags;  ///< without a value
};

struct Arguments {
  std::uint64_t from = 1;
  std::uint64_t seeds = 0;
  std::string_view expect;
  std::vector<std::string_view> flags;
  [[nodiscard]] bool has(std::string_view flag) const {
    for (const std::string_view each : flags)
      if (each == flag) return true;
    return false;
  }
};

[[nodiscard]] Arguments read_arguments(const Simulation& simulation, int count, char** texts);

/// Runs the worlds and says what came of them. `run_world` adds to the counts of events. Returns
/// the exit status.
[[nodiscard]] int run_worlds(const Simulation& simulation, const Arguments& arguments,
                             const std::function<WorldOutcome(std::uint64_t seed)>& run_world,
                             const std::function<std::vector<std::uint64_t>()>& counts);

}  // namespace gimnet::sim
