#pragma once

#include <span>
#include <string_view>

#include "tests/sim/hubs/stage.hpp"

namespace gimnet::sim::hubs {

/// A world that must be among the simulated ones: its plan and its events are written down. At its
/// end the same is checked as in every world.
struct Scene {
  std::string_view name;
  Plan (*plan)();
  void (*play)(Stage& stage);
  bool takes_long = false;  ///< a minute or so: `--long` alone plays it
};
[[nodiscard]] std::span<const Scene> scenes();

}  // namespace gimnet::sim::hubs
