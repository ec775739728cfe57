#pragma once

#include <deque>
#include <functional>
#include <optional>

#include "tools/demo/node_port.hpp"

namespace gimnet::demo {

/// A robot's and a viewer's end without a hub between them, on one thread and with a clock of their
/// own: whoever would wait lets the other work, and if there is none, the time passes.
class FakeNetwork {
 public:
  /// One end; what it sends arrives in the other's queue.
  class Port final : public NodePort {
   public:
    explicit Port(FakeNetwork& network) : network_(network) {}

    std::optional<Error> publish(Service service, std::span<const std::byte> payload) override {
      network_.sent(service, payload, network_.to_viewer);
      return network_.broken;
    }
    Result<bool> command(std::span<const std::byte> payload) override {
      if (network_.broken) return *network_.broken;
      if (!network_.commands_go) return false;
      network_.sent(Service::kDrive, payload, network_.to_robot);
      return true;
    }
    [[nodiscard]] std::int64_t now_ns() const override { return network_.now_ns; }
    Result<std::optional<Event>> receive(std::int64_t wait_ns) override {
      if (network_.broken) return *network_.broken;
      if (queue->empty() && when_idle) {
        when_idle();
      } else if (queue->empty()) {
        network_.now_ns += wait_ns;
      }
      if (queue->empty()) return std::optional<Event>();
      Event event = queue->front();
      queue->pop_front();
      return std::optional(event);
    }
    [[nodiscard]] bool heard() const override { return network_.heard; }
    [[nodiscard]] bool connected() const override { return true; }
    std::optional<HubCounters> hub_counters() override { return network_.counters; }

    std::deque<Event>* queue = nullptr;
    std::function<void()> when_idle;

   private:
    FakeNetwork& network_;
  };

  FakeNetwork() {
    robot.queue = &to_robot;
    viewer.queue = &to_viewer;
  }

  Port robot{*this};
  Port viewer{*this};
  std::deque<NodePort::Event> to_robot;
  std::deque<NodePort::Event> to_viewer;
  std::int64_t now_ns = 1'700'000'000'000'000'000;
  bool heard = true;
  bool commands_go = true;
  /// Loses each n-th message; 0: none.
  std::uint64_t lose_each = 0;
  std::optional<Error> broken;
  HubCounters counters;

 private:
  void sent(Service service, std::span<const std::byte> payload,
            std::deque<NodePort::Event>& queue) {
    ++counters.accepted;
    if (lose_each != 0 && counters.accepted % lose_each == 0) {
      counters.add("dropped.queue_full", 1);
      return;
    }
    ++counters.delivered;
    queue.push_back({service, Bytes(payload.begin(), payload.end()), now_ns});
  }
};

}  // namespace gimnet::demo
