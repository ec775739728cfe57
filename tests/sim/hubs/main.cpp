#include <algorithm>

#include "base/log.hpp"
#include "tests/sim/hubs/scenes.hpp"
#include "tests/sim/run_worlds.hpp"

// The simulation of whole hubs that are linked: gimnet-sim-hubs. See tests/sim/README.md.

int main(int count, char** texts) {
  using namespace gimnet::sim;
  Simulation simulation{"gimnet-sim-hubs",
                        hubs::kCheckerNames,
                        hubs::kEventNames,
                        400,
                        2'000,
                        {"--large", "--scenes", "--long", "--trace"}};
  Arguments arguments = read_arguments(simulation, count, texts);
  // Large worlds have more of everything.
  if (arguments.has("--large")) simulation.seeds_for_all = 100;
  const std::span<const hubs::Scene> scenes = hubs::scenes();
  const bool plays = arguments.has("--scenes");
  // The scenes are numbered from 1 on.
  if (plays) {
    arguments.from = std::min<std::uint64_t>(arguments.from, scenes.size());
    arguments.seeds = std::min<std::uint64_t>(arguments.seeds, scenes.size() + 1 - arguments.from);
  }
  gimnet::set_log_level(gimnet::LogLevel::off);
  hubs::Census census;
  const auto run_world = [&](std::uint64_t seed) {
    hubs::World::Options options{
        seed, {}, arguments.has("--trace"), nullptr, arguments.has("--long")};
    if (plays) options.scene = &scenes[seed - 1];
    if (plays && options.scene->takes_long && !options.is_long) return WorldOutcome{};
    if (arguments.has("--large")) options.size = {5, 16, 200};
    hubs::World world(options);
    const auto failure = world.run();
    census.add(world.census());
    WorldOutcome outcome{std::nullopt, {}, world.words()};
    if (!failure) return outcome;
    outcome.checker = static_cast<std::size_t>(failure->checker);
    outcome.what = failure->what;
    return outcome;
  };
  const auto counts = [&] {
    return std::vector<std::uint64_t>(census.counts().begin(), census.counts().end());
  };
  return run_worlds(simulation, arguments, run_world, counts);
}
