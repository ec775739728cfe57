#pragma once

#include <chrono>
#include <optional>
#include <string>

#include "hub/control/state/index_pool.hpp"

namespace gimnet::hub {

/// Why nobody can be given an id of that kind ("node ids"), which are the pool's.
[[nodiscard]] inline std::string shortage(const std::string& kind, const IndexPool& pool,
                                          std::chrono::milliseconds now) {
  if (pool.waits_for_keeping(now)) {
    return "this hub cannot write its state, and has no " + kind +
           " left until it can; its log says why (a full disk?), try again when that is mended";
  }
  const std::optional<std::chrono::milliseconds> wait = pool.waits_for_returns(now);
  if (!wait)
    return "all " + kind +
           " that this hub may hand out are in use or resting; try again in a minute";
  return "this hub was restarted a moment ago, and those who had its " + kind +
         " may still come back; try again in " + std::to_string((wait->count() + 999) / 1'000) +
         " s";
}

}  // namespace gimnet::hub
