#pragma once

#include <cstdint>

#include "tests/sim/hubs/world.hpp"

namespace gimnet::sim::hubs {

/// The means by which the course of a scene acts on its world. Thread safety: none. Errors: Broken.
class Stage {
 public:
  explicit Stage(World& world) : world_(world) {}

  /// It may take longer.
  [[nodiscard]] bool is_long() const { return world_.options_.is_long; }
  [[nodiscard]] milliseconds now() const { return world_.now_; }
  void run(std::uint64_t ms) { world_.run_until(world_.now_ + milliseconds{ms}); }
  /// Until that wire carries a link at both ends. Errors: it does not within 10 s.
  void run_until_up(std::size_t wire);
  void cut(std::size_t wire, bool there = true, bool back = true) {
    world_.wires_[wire].cut = {there, back};
  }
  void mend(std::size_t wire) { world_.wires_[wire].cut = {}; }
  void reset(std::size_t wire) { world_.reset(wire); }
  void reset_at_both_ends(std::size_t wire) { world_.reset(wire, 3); }
  /// A reserved flag is set in the next UNICAST from the dialler.
  void spoil_next(std::size_t wire);
  void set_cost(std::size_t wire, std::uint16_t cost);
  void start(std::size_t hub) { world_.start(hub); }
  void stop(std::size_t hub) { world_.stop(hub); }
  void lose_state(std::size_t hub) {
    world_.machines_[hub].disk = world_.new_disk(world_.random_.next());
  }
  [[nodiscard]] HubId hub_id(std::size_t hub) const {
    return world_.machines_[hub].hub->facts().id;
  }
  /// The operator gives it that id, which holds from its next start on.
  void set_hub_id(std::size_t hub, HubId id) {
    world_.machines_[hub].plan.hub = id.value();
    world_.machines_[hub].plan.configured = true;
  }
  [[nodiscard]] SimNode& node(std::size_t index) { return world_.nodes_[index]; }
  [[nodiscard]] std::size_t nodes() const { return world_.nodes_.size(); }
  void crash(std::size_t index) { node(index).crash(world_.now_); }
  void move(std::size_t index, std::size_t hub) { node(index).move_to(hub, world_.now_); }
  [[nodiscard]] std::uint64_t count(Event event) const {
    return world_.census_.counts()[static_cast<std::size_t>(event)];
  }
  /// Hubs that this one can reach, and itself.
  [[nodiscard]] std::size_t reachable(std::size_t hub) const {
    return world_.machines_[hub].hub->links().network().map().reachable().size();
  }
  /// The line on which the link of that wire stands.
  [[nodiscard]] std::uint64_t line_of(std::size_t wire) const {
    return world_.wires_[wire].counted[0].line;
  }
  /// One of its ends took it to break too often.
  [[nodiscard]] bool is_damped(std::size_t wire) const;
  /// That crossed it so far, both ways.
  [[nodiscard]] std::uint64_t frames_of(std::size_t wire) const {
    return world_.wires_[wire].frames;
  }
  [[nodiscard]] std::uint64_t sent() const { return world_.book_.sent(); }
  [[nodiscard]] std::uint64_t arrived() const { return world_.book_.arrived(); }
  [[nodiscard]] bool has_arrived(std::uint64_t number) const {
    return world_.book_.has_arrived(number);
  }
  /// For so long each node sends as much as it may, a frame of so many bytes each ms at most, to
  /// the node with that number.
  void flood(std::uint64_t ms, std::uint64_t bytes, auto&& target_of) {
    for (std::uint64_t i = 0; i < ms; ++i) {
      for (std::size_t from = 0; from < nodes(); ++from) {
        const std::size_t to = target_of(from);
        if (to == from || !node(from).is_up() || !node(to).is_up()) continue;
        if (node(from).is_blocked()) continue;
        static_cast<void>(node(from).send_to(node(to).id(), bytes));
      }
      run(1);
    }
  }
  /// Waits until all frames have come.
  void all_arrive(std::uint64_t within_ms);
  /// Each name has one owner, and all hubs say so.
  void check_names();
  static void need(bool holds, Checker checker, const char* what) {
    if (!holds) broken(checker, what);
  }

 private:
  World& world_;
};

}  // namespace gimnet::sim::hubs
