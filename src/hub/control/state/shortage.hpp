#pragma once

#include <chrono>
#include <optional>
#include <string>

namespace gimnet::hub {

/// Why nobody can be given an id of that kind ("node ids"). `wait`: IndexPool::waits_for_returns().
[[nodiscard]] inline std::string shortage(const std::string& kind, std::optional<std::chrono::milliseconds> wait) {
  if (!wait) return "all " + kind + " that this hub may hand out are in use or resting; try again in a minute";
  return "this hub was restarted a moment ago, and those who had its " + kind + " may still come back; try again in " +
         std::to_string((wait->count() + 999) / 1'000) + " s";
}

}  // namespace gimnet::hub
