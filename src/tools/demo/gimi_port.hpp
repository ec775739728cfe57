#pragma once

#include <memory>
#include <string>

#include "base/result.hpp"
#include "tools/demo/node_port.hpp"

namespace gimnet::demo {

/// Where to connect, and as whom.
struct PortOptions {
  /// Empty: GIMNET_HUB, or the hub's usual places.
  std::string hub_url;
  /// The robot's node name, at both ends.
  std::string robot;
};

/// A robot's end: a node of that name that provides odom, scan and info, and accepts drive. Errors:
/// no hub there, the name is taken, a service was refused.
[[nodiscard]] Result<std::unique_ptr<NodePort>> connect_robot(const PortOptions& options);

/// A viewer's end: a node without a name that subscribes to the robot's services, whether they
/// exist already or not, and commands it. Errors: as connect_robot().
[[nodiscard]] Result<std::unique_ptr<NodePort>> connect_viewer(const PortOptions& options);

}  // namespace gimnet::demo
