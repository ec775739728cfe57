#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "base/ids.hpp"
#include "base/log.hpp"
#include "hub/control/listen_url.hpp"
#include "hub/control/state/sessions.hpp"
#include "hub/limits.hpp"

namespace gimnet::hub {

/// How a hub is to run. A value type.
struct HubOptions {
  std::vector<ListenUrl> listen;  ///< empty: the default addresses
  std::size_t shards = 1;
  HubId id{1};
  std::string name;
  std::string state_dir;  ///< "": the default one
  Placement placement = Placement::spread;
  bool insecure = false;
  bool spin = false;  ///< shards never sleep
  LogLevel log_level = LogLevel::info;
  Limits limits;
};

inline constexpr std::size_t kShardCountMax = 16;

/// Shards if nobody says: half of this machine's processors, since the nodes that a hub serves
/// often run beside it, at least 1 and at most 8.
[[nodiscard]] std::size_t default_shards();

}  // namespace gimnet::hub
