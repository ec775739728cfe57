#pragma once

#include <chrono>
#include <cstddef>
#include <string>

#include "base/ids.hpp"
#include "proto/control/hub_identity.hpp"

namespace gimnet::hub {

/// The identity of this hub. Thread safety: immutable after start-up.
struct HubFacts {
  HubId id{1};
  bool id_configured = false;   ///< and not drawn, nor the default
  bool redrawn = false;         ///< it began anew when it started, since another hub kept its id
  proto::UniqueId unique;       ///< of its state folder
  proto::HubInstance instance;  ///< of this start
  bool insecure = false;        ///< it may link to other machines
  std::string name;
  std::string version;
  std::size_t shards = 1;
  std::chrono::milliseconds started{};  ///< by the conductor's clock
};

}  // namespace gimnet::hub
