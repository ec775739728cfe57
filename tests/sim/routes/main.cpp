#include "tests/sim/routes/world.hpp"
#include "tests/sim/run_worlds.hpp"

// The simulation of routes: gimnet-sim-routes. See tests/sim/README.md.

int main(int count, char** texts) {
  using namespace gimnet::sim;
  const Simulation simulation{
      "gimnet-sim-routes", routes::kCheckerNames, routes::kEventNames, 500, 500, {}};
  routes::Census census;
  const auto run_world = [&](std::uint64_t seed) {
    routes::World world(seed);
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
  return run_worlds(simulation, read_arguments(simulation, count, texts), run_world, counts);
}
