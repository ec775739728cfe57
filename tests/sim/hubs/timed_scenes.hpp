#pragma once

#include <span>

#include "tests/sim/hubs/scenes.hpp"

namespace gimnet::sim::hubs {

/// Scenes in which something has to happen in time.
[[nodiscard]] std::span<const Scene> timed_scenes();

}  // namespace gimnet::sim::hubs
