#pragma once

#include <chrono>
#include <cstddef>
#include <string>

#include "base/ids.hpp"

namespace gimnet::hub {

/// Who this hub is. Thread safety: immutable after start-up.
struct HubFacts {
  HubId id{1};
  std::string name;
  std::string version;
  std::size_t shards = 1;
  std::chrono::milliseconds started{};  ///< by the conductor's clock
};

}  // namespace gimnet::hub
