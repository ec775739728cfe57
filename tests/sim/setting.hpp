#pragma once

#include <string>
#include <vector>

#include "tests/sim/agenda.hpp"
#include "tests/sim/census.hpp"
#include "tests/sim/plan.hpp"
#include "tests/sim/random.hpp"
#include "tests/sim/trace.hpp"

namespace gimnet::sim {

/// State that all parts of a world share. Thread safety: none. Lifetime: the world's.
struct Setting {
  /// `without`: what is taken out of what the seed drew.
  Setting(const Random& source, std::size_t nodes, const Faults& without, bool print)
      : random(source), plan(draw(random, nodes, without)), trace(agenda, print) {}

  Random random;
  const Plan plan;
  Agenda agenda;
  Trace trace;
  Census census;
  std::vector<std::string>
      offered;  ///< full names of services that nodes advertised, of which others hear
  std::uint64_t messages =
      0;  ///< that nodes sent: each says its number, so that their order can be checked

 private:
  [[nodiscard]] static Plan draw(Random& random, std::size_t nodes, const Faults& without) {
    Plan plan = Plan::draw(random, nodes);
    for (std::size_t i = 0; i < kFaults.size(); ++i) {
      if (without[i]) plan.*kFaults[i].likelihood = 0;
    }
    return plan;
  }
};

}  // namespace gimnet::sim
