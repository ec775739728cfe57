#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace gimnet {

/// Fills `memory` with bits of the system that nobody can guess. Aborts where the system has none
/// to give, which Linux does not do once it is up: without them epochs, tokens and ids could not be
/// trusted. Thread safety: any thread.
void fill_randomly(std::span<std::byte> memory);

/// Bits that nobody can guess; as fill_randomly().
[[nodiscard]] std::uint64_t random_bits();

}  // namespace gimnet
