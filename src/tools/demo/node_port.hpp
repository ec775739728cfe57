#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "base/clock.hpp"
#include "base/result.hpp"
#include "tools/demo/messages.hpp"

namespace gimnet::demo {

/// The four services of the demo (messages.hpp).
enum class Service : std::uint8_t { kOdometry, kScan, kInfo, kDrive };

/// The counters of the hub's ledger (docs/protocol.md, section 9), summed over its shards. Thread
/// safety: one thread.
struct HubCounters {
  std::uint64_t accepted = 0;
  std::uint64_t copies = 0;
  std::uint64_t delivered = 0;
  std::uint64_t queued = 0;
  /// Reasons with at least one frame, and its frames.
  std::map<std::string, std::uint64_t> drops;

  /// Adds one counter of one shard, by its name in docs/operations.md; others than the ledger's are
  /// passed over.
  void add(std::string_view name, std::uint64_t value) {
    constexpr std::string_view kDropped = "dropped.";
    if (name == "accepted") accepted += value;
    if (name == "copies") copies += value;
    if (name == "delivered") delivered += value;
    if (name == "queued") queued += value;
    if (!name.starts_with(kDropped) || value == 0) return;
    drops[std::string(name.substr(kDropped.size()))] += value;
  }
  [[nodiscard]] std::uint64_t dropped() const {
    std::uint64_t sum = 0;
    for (const auto& [reason, frames] : drops) sum += frames;
    return sum;
  }
  /// Is accepted + copies = delivered + dropped + queued? Holds exactly whenever nothing moves.
  [[nodiscard]] bool exact() const { return accepted + copies == delivered + dropped() + queued; }
};

/// The network as robot and viewer need it: a seam, so that tests put two ends together without a
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

  /// Sends a command to the robot, in the lane that goes first. False: it could not be sent at the
  /// moment. Errors: the connection ended for good.
  [[nodiscard]] virtual Result<bool> command(std::span<const std::byte> payload) = 0;

  /// The next message; nothing if none comes within `wait_ns`. Also the time in which events are
  /// seen to. Errors: the connection ended for good.
  [[nodiscard]] virtual Result<std::optional<Event>> receive(std::int64_t wait_ns) = 0;

  /// Are there subscribers of all own services that are provided?
  [[nodiscard]] virtual bool heard() const = 0;

  /// Does the connection to the hub stand?
  [[nodiscard]] virtual bool connected() const = 0;

  /// The hub's counters so far; nothing if it does not answer in time.
  [[nodiscard]] virtual std::optional<HubCounters> hub_counters() = 0;
};

/// The hub to connect to, and the robot's name.
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
