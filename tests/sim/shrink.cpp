#include "tests/sim/shrink.hpp"

#include <algorithm>
#include <array>
#include <utility>

namespace gimnet::sim {
namespace {

/// Sizes that are tried, the smallest first.
constexpr std::array<std::size_t, 14> kSizes = {2, 3, 4, 5, 6, 8, 10, 13, 17, 25, 40, 65, 100, 150};

/// Takes the world if it breaks as the one that is to be shrunk. True: it does.
bool try_world(Shrunk& best, const World::Options& world) {
  ++best.tried;
  Report report = World(world).run();
  if (!report.broken || report.broken->checker != best.report.broken->checker) return false;
  best.world = world;
  best.report = std::move(report);
  return true;
}

bool take_nodes_away(Shrunk& best) {
  for (const std::size_t nodes : kSizes) {
    if (nodes >= best.world.nodes) return false;
    World::Options smaller = best.world;
    smaller.nodes = nodes;
    if (try_world(best, smaller)) return true;
  }
  return false;
}

bool leave_faults_out(Shrunk& best) {
  bool helped = false;
  for (std::size_t i = 0; i < kFaults.size(); ++i) {
    if (best.world.without[i]) continue;
    World::Options calmer = best.world;
    calmer.without.set(i);
    helped = try_world(best, calmer) || helped;
  }
  return helped;
}

}  // namespace

Shrunk shrink(const World::Options& world, const Report& report) {
  Shrunk best{world, report, 0};
  best.world.print = false;
  // Each step takes nodes or faults away, so the loop ends.
  while (take_nodes_away(best) || leave_faults_out(best)) {
  }
  return best;
}

std::string arguments_of(const World::Options& world) {
  std::string words =
      "--seed " + std::to_string(world.seed) + " --nodes " + std::to_string(world.nodes);
  const char* before = " --without ";
  for (std::size_t i = 0; i < kFaults.size(); ++i) {
    if (!world.without[i]) continue;
    words.append(before).append(kFaults[i].name);
    before = ",";
  }
  return words;
}

Faults faults_of(std::string_view list, std::string& unknown) {
  Faults faults;
  unknown.clear();
  while (!list.empty()) {
    const std::string_view name = list.substr(0, list.find(','));
    list.remove_prefix(std::min(list.size(), name.size() + 1));
    std::size_t place = 0;
    while (place < kFaults.size() && kFaults[place].name != name) ++place;
    if (place < kFaults.size()) {
      faults.set(place);
    } else {
      unknown = name;
    }
  }
  return faults;
}

}  // namespace gimnet::sim
