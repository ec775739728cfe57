#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "tests/sim/world.hpp"

namespace gimnet::sim {

/// The smallest world that was found in which the same checker finds something.
struct Shrunk {
  World::Options world;
  Report report;
  std::uint64_t tried = 0;  ///< worlds
};

/// Makes a world that broke smaller: fewer nodes, then one kind of fault after the other left out,
/// again until nothing helps. What is left is often another world that breaks in the same way, not
/// a part of the first: fewer nodes draw other numbers. Thread safety: any, worlds share nothing.
/// Takes some dozens of worlds. REQUIRES: report.broken, of that world.
[[nodiscard]] Shrunk shrink(const World::Options& world, const Report& report);

/// As on the command line: "--seed 17 --nodes 12 --without crash,hang".
[[nodiscard]] std::string arguments_of(const World::Options& world);

/// The faults of a list "crash,hang"; the name that is not one in `unknown`, which is empty if all
/// are.
[[nodiscard]] Faults faults_of(std::string_view list, std::string& unknown);

}  // namespace gimnet::sim
