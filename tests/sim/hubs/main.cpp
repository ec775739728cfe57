#include "base/log.hpp"
#include "tests/sim/hubs/world.hpp"
#include "tests/sim/run_worlds.hpp"

// The simulation of whole hubs that are linked: gimnet-sim-hubs. See tests/sim/README.md.

int main(int count, char** texts) {
  using namespace gimnet::sim;
  const Simulation simulation{
      "gimnet-sim-hubs",     hubs::kCheckerNames, hubs::kEventNames, 400, 2'000,
      {"--large", "--trace"}};
  const Arguments arguments = read_arguments(simulation, count, texts);
  gimnet::set_log_level(gimnet::LogLevel::off);
  hubs::Census census;
  const auto run_world = [&](std::uint64_t seed) {
    hubs::World::Options options{seed, {}, arguments.has("--trace")};
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
