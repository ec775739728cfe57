#include "tools/demo/node_port.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>
#include <vector>

#include "gimnet/gimi.hpp"

namespace gimnet::demo {
namespace {

// A viewer that draws is not at its queue for a few milliseconds; a log played fast sends hundreds
// in them.
constexpr std::size_t kQueueMessages = 4096;
constexpr Timeout kSend{2000};
constexpr Timeout kCounters{500};

struct ServiceInfo {
  Service service;
  std::string_view name;
  std::string_view metadata;
};
constexpr std::array<ServiceInfo, 3> kProvided{
    {{Service::kOdometry, "odom", "pose and speed of the robot, Bitestream"},
     {Service::kScan, "scan", "laser scan, Bitestream"},
     {Service::kInfo, "info", "what the robot is, Bitestream"}}};
constexpr std::string_view kDriveName = "drive";

MessageKey key_of(Service service) { return {static_cast<std::uint32_t>(service) + 1, 0}; }

// Nothing overwritten: when the queue is full the node stops reading, and the hub counts what it
// drops.
constexpr AtFullQueue kLossless = AtFullQueue::stop_reading;

// For good: everything that trying again cannot heal.
bool is_final(const Failure& failure) {
  return failure.status != Status::timeout && failure.status != Status::not_connected;
}

// The common part of both ends.
class GimiPort : public NodePort {
 public:
  explicit GimiPort(Node node) : node_(std::move(node)) {}

  Result<std::optional<Event>> receive(std::int64_t wait_ns) override {
    constexpr std::int64_t kMillisecond_ns = 1'000'000;
    const Timeout timeout((std::max<std::int64_t>(wait_ns, 0) + kMillisecond_ns - 1) /
                          kMillisecond_ns);
    Outcome<Message> message = node_.receive(timeout);
    if (!message) {
      if (is_final(message.failure())) return Error{message.failure().sentence};
      return std::optional<Event>();
    }
    const std::optional<Service> service = service_of(*message);
    if (!service) return std::optional<Event>();
    return std::optional(Event{*service, Bytes(message->data().begin(), message->data().end()),
                               message->arrival_ns()});
  }

  [[nodiscard]] bool connected() const override { return node_.state().connected; }

  std::optional<HubCounters> hub_counters() override {
    const Outcome<std::vector<ShardCounts>> shards = node_.hub_counters(kCounters);
    if (!shards) return std::nullopt;
    HubCounters sum;
    for (const ShardCounts& shard : *shards) {
      for (const auto& [name, value] : shard.counters) sum.add(name, value);
    }
    return sum;
  }

 protected:
  [[nodiscard]] const Node& node() const { return node_; }

 private:
  static std::optional<Service> service_of(const Message& message) {
    for (const Service service :
         {Service::kOdometry, Service::kScan, Service::kInfo, Service::kDrive}) {
      if (message.key() == key_of(service)) return service;
    }
    return std::nullopt;
  }

  Node node_;
};

class RobotPort final : public GimiPort {
 public:
  explicit RobotPort(Node node) : GimiPort(std::move(node)) {}

  std::optional<Error> open() {
    for (const ServiceInfo& info : kProvided) {
      PublishOptions options;
      options.key = key_of(info.service);
      options.metadata = info.metadata;
      Outcome<Publisher> publisher = node().advertise(info.name, options);
      if (!publisher) return Error{publisher.failure().sentence};
      publishers_.push_back(std::move(*publisher));
    }
    AcceptOptions options;
    options.key = key_of(Service::kDrive);
    options.queue = {kQueueMessages, kLossless};
    options.metadata = "wanted speed, Bitestream";
    Outcome<Accepted> drive = node().accept(kDriveName, options);
    if (!drive) return Error{drive.failure().sentence};
    drive_.emplace(std::move(*drive));
    return std::nullopt;
  }

  std::optional<Error> publish(Service service, std::span<const std::byte> payload) override {
    // However long the hub is away: what both ends show at the end counts every message.
    const Outcome<void> outcome =
        publishers_[static_cast<std::size_t>(service)].publish(payload, kForever);
    if (!outcome && is_final(outcome.failure())) return Error{outcome.failure().sentence};
    return std::nullopt;
  }

  Result<bool> command(std::span<const std::byte>) override {
    return Error{"a robot commands nobody"};
  }

  [[nodiscard]] bool heard() const override {
    return std::all_of(publishers_.begin(), publishers_.end(),
                       [](const Publisher& publisher) { return publisher.subscribers() > 0; });
  }

 private:
  std::vector<Publisher> publishers_;
  std::optional<Accepted> drive_;
};

class ViewerPort final : public GimiPort {
 public:
  ViewerPort(Node node, std::string robot) : GimiPort(std::move(node)), robot_(std::move(robot)) {}

  std::optional<Error> open() {
    for (const ServiceInfo& info : kProvided) {
      Outcome<Subscription> subscription = node().subscribe(
          fmt::format("{}/{}", robot_, info.name), {.queue = kQueueMessages, .at_full = kLossless});
      if (!subscription) return Error{subscription.failure().sentence};
      subscriptions_.push_back(std::move(*subscription));
    }
    return std::nullopt;
  }

  std::optional<Error> publish(Service, std::span<const std::byte>) override {
    return Error{"a viewer publishes nothing"};
  }

  // The robot is there: it was heard before. A network that is cut may not find it for a moment.
  Result<bool> command(std::span<const std::byte> payload) override {
    if (!drive_) {
      SendOptions options;
      options.lane = Lane::real_time;
      Outcome<Sender> sender =
          node().sender(fmt::format("{}/{}", robot_, kDriveName), options, kSend);
      if (!sender) return unsent(sender.failure());
      drive_.emplace(std::move(*sender));
    }
    const Outcome<void> outcome = drive_->send(payload, kSend);
    return outcome ? Result<bool>(true) : unsent(outcome.failure());
  }

  [[nodiscard]] bool heard() const override { return false; }

 private:
  static Result<bool> unsent(const Failure& failure) {
    if (is_final(failure) && failure.status != Status::not_found) return Error{failure.sentence};
    return false;
  }

  std::string robot_;
  std::vector<Subscription> subscriptions_;
  std::optional<Sender> drive_;
};

}  // namespace

Result<std::unique_ptr<NodePort>> connect_robot(const PortOptions& options) {
  NodeOptions joining;
  joining.name = options.robot;
  joining.hub = options.hub_url;
  joining.description = "the demo's robot";
  Outcome<Node> node = Node::join(joining);
  if (!node) return Error{node.failure().sentence};
  auto port = std::make_unique<RobotPort>(std::move(*node));
  if (std::optional<Error> error = port->open()) return *error;
  return std::unique_ptr<NodePort>(std::move(port));
}

Result<std::unique_ptr<NodePort>> connect_viewer(const PortOptions& options) {
  NodeOptions joining;
  // Without a name: several viewers, on as many computers, may look at one robot.
  joining.resume = true;
  joining.hub = options.hub_url;
  joining.description = "the demo's viewer and driver";
  Outcome<Node> node = Node::join(joining);
  if (!node) return Error{node.failure().sentence};
  auto port = std::make_unique<ViewerPort>(std::move(*node), options.robot);
  if (std::optional<Error> error = port->open()) return *error;
  return std::unique_ptr<NodePort>(std::move(port));
}

}  // namespace gimnet::demo
