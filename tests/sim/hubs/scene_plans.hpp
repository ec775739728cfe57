#pragma once

#include <cstdint>
#include <string>

#include "tests/sim/hubs/plan.hpp"

// The plans of scenes: hubs 1, 2, ... that are linked in a shape. Thread safety: pure functions.

namespace gimnet::sim::hubs {

/// Until all hubs of a scene run and are linked.
inline constexpr std::uint64_t kStartMs = 2'500;

/// So many hubs without links.
[[nodiscard]] Plan plan_of(std::size_t hubs);
/// bytes_per_ms: 0: no limit.
void wire(Plan& plan, std::size_t from, std::size_t to, std::uint64_t delay_ms = 1,
          std::uint32_t bytes_per_ms = 0);
/// "": a name by its number.
void node(Plan& plan, std::size_t hub, std::string name = {});
/// A node at each hub, which is linked to the next one.
[[nodiscard]] Plan chain(std::size_t hubs, std::uint64_t delay_ms = 1,
                         std::uint32_t bytes_per_ms = 0);
[[nodiscard]] Plan ring(std::size_t hubs, std::uint64_t delay_ms = 1,
                        std::uint32_t bytes_per_ms = 0);
/// All others are linked to the first one.
[[nodiscard]] Plan star(std::size_t hubs);

}  // namespace gimnet::sim::hubs
