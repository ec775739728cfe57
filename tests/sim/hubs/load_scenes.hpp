#pragma once

#include <span>

#include "tests/sim/hubs/scenes.hpp"

namespace gimnet::sim::hubs {

/// Scenes in which nodes send as much as they may.
[[nodiscard]] std::span<const Scene> load_scenes();

}  // namespace gimnet::sim::hubs
