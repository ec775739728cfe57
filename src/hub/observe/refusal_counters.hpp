#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "hub/observe/counters.hpp"
#include "proto/control/link.hpp"

namespace gimnet::hub {

/// Peers that were turned away before they were admitted, by why.
/// Thread safety: written by the conductor's thread only, read by anybody.
struct RefusalCounters {
  std::array<Counter, proto::kGoodbyeCount> by_code;  ///< told with GOODBYE
  Counter garbage;                                    ///< what they sent is not this protocol
  Counter unfinished;     ///< they ended in the middle of their opening or HELLO
  Counter no_descriptor;  ///< the hub had no descriptor to keep them

  /// A code that is not listed is not counted.
  void count(proto::GoodbyeCode code) {
    const auto index = static_cast<std::size_t>(code);
    if (index < by_code.size()) by_code[index].add(1);
  }
  [[nodiscard]] std::uint64_t of(proto::GoodbyeCode code) const {
    return by_code[static_cast<std::size_t>(code)].value();
  }
};

}  // namespace gimnet::hub
