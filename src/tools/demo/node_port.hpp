#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/clock.hpp"
#include "base/result.hpp"
#include "tools/demo/hub_counters.hpp"
#include "tools/demo/messages.hpp"

namespace gimnet::demo {

/// The four services of the demo (messages.hpp).
enum class Service : std::uint8_t { kOdometry, kScan, kInfo, kDrive };

/// What robot and viewer need of the network: a seam, so that tests put two ends together without a
/// hub. Thread safety: one thread. Ownership: of its connection, which ends with it.
class NodePort {
 public:
  /// A message of a service: to the viewer from odom, scan and info; to the robot from drive.
  struct Event {
    Service service = Service::kInfo;
    Bytes payload;
    /// When it was read from the network, in ns since 1970.
    std::int64_t arrival_ns = 0;
  };

  virtual ~NodePort() = default;

  /// The time in ns since 1970: the clock of everything that is said through this port.
  [[nodiscard]] virtual std::int64_t now_ns() const { return wall_now_ns(); }

  /// Sends a message to all subscribers of an own service. Errors: the connection ended for good.
  [[nodiscard]] virtual std::optional<Error> publish(Service service,
                                                     std::span<const std::byte> payload) = 0;

  /// Sends a command to the robot, in the lane that goes first. Errors: the connection ended for
  /// good.
  [[nodiscard]] virtual std::optional<Error> command(std::span<const std::byte> payload) = 0;

  /// The next message; nothing if none comes within `wait_ns`. Also the time in which events are
  /// seen to. Errors: the connection ended for good.
  [[nodiscard]] virtual Result<std::optional<Event>> receive(std::int64_t wait_ns) = 0;

  /// Are there subscribers of all own services that are provided?
  [[nodiscard]] virtual bool heard() const = 0;

  /// Does the connection to the hub stand?
  [[nodiscard]] virtual bool connected() const = 0;

  /// What the hub counted so far; nothing if it does not answer in time.
  [[nodiscard]] virtual std::optional<HubCounters> hub_counters() = 0;
};

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
