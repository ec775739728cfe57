#pragma once

#include <string>
#include <vector>

#include "tests/sim/agenda.hpp"
#include "tests/sim/census.hpp"
#include "tests/sim/plan.hpp"
#include "tests/sim/random.hpp"
#include "tests/sim/trace.hpp"

namespace gimnet::sim {

/// What all parts of a world share. Thread safety: none. Lifetime: the world's.
struct Setting {
  Setting(std::uint64_t seed, std::size_t nodes, bool print)
      : random(seed), plan(Plan::draw(random, nodes)), trace(agenda, print) {}

  Random random;
  const Plan plan;
  Agenda agenda;
  Trace trace;
  Census census;
  std::vector<std::string> offered;  ///< full names of services that nodes advertised, of which others hear
  std::uint64_t messages = 0;        ///< that nodes sent: each says its number, so that their order can be checked
};

}  // namespace gimnet::sim
