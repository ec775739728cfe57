#include "tests/sim/hubs/load_scenes.hpp"

#include <algorithm>
#include <vector>

#include "tests/sim/hubs/scene_plans.hpp"

namespace gimnet::sim::hubs {
namespace {

constexpr std::uint32_t kGigabit = 125'000;  ///< bytes a ms
constexpr std::uint32_t kRingRate = 50;      ///< bytes a ms of each link of a ring that is full
constexpr std::uint64_t kRingBytes = 2'000;  ///< of each frame there

void play_broadcasts(Stage& stage) {
  constexpr std::size_t kTimes = 3;
  stage.run(2 * kStartMs);
  for (std::size_t i = 0; i < kTimes; ++i) {
    for (std::size_t from = 0; from < stage.nodes(); ++from)
      stage.node(from).broadcast(from * kTimes + i);
    stage.run(20);
  }
  stage.run(500);
  for (std::size_t to = 0; to < stage.nodes(); ++to) {
    std::vector<std::uint64_t> heard = stage.node(to).broadcasts();
    std::ranges::sort(heard);
    Stage::need(std::ranges::adjacent_find(heard) == heard.end(), Checker::right_node,
                "a BROADCAST comes twice");
    Stage::need(heard.size() == kTimes * (stage.nodes() - 1), Checker::reachable,
                "a BROADCAST does not come to all");
  }
}

Plan plan_broadcasts() {
  Plan plan = star(66);
  wire(plan, 1, 2);
  wire(plan, 3, 4);
  return plan;
}

// Two senders at each of three hubs fill their links towards one slow node.
constexpr std::size_t kSlow = 0;
constexpr std::size_t kSenders = 1;     ///< the first of them
constexpr std::size_t kBystanders = 7;  ///< the first of them, one at each hub

Plan plan_slow_node() {
  Plan plan = plan_of(4);
  for (std::size_t hub = 1; hub < 4; ++hub) wire(plan, hub, 0, 25, kGigabit);
  node(plan, 0);
  plan.nodes[kSlow].reads_per_ms = 2'000;
  for (std::size_t i = kSenders; i < kBystanders; ++i) node(plan, 1 + i % 3);
  for (std::size_t hub = 0; hub < 4; ++hub) node(plan, hub);
  return plan;
}

void play_slow_node(Stage& stage) {
  constexpr int kMs = 3'000;
  const auto slow = [](std::size_t from) {
    return from >= kSenders && from < kBystanders ? kSlow : from;
  };
  stage.run(kStartMs);
  for (int ms = 0; ms < kMs; ++ms) {
    stage.flood(1, kGigabit / 2, slow);
    // Over the same links and through the same hub, in the same lane.
    for (std::size_t i = kBystanders; i < stage.nodes(); ++i) {
      const std::size_t next = i + 1 < stage.nodes() ? i + 1 : kBystanders;
      const auto sent = stage.node(i).send_to(stage.node(next).id(), 50);
      Stage::need(sent.has_value(), Checker::resumes, "a bystander is paused");
    }
  }
  Stage::need(stage.count(Event::paused_sender) >= kBystanders - kSenders, Checker::resumes,
              "not all senders were paused");
  stage.all_arrive(60'000);
}

/// Node 1 sends to node 0 over a link and ignores PAUSE, nodes 2 and 3 are bystanders.
Plan plan_deaf() {
  Plan plan = chain(2);
  node(plan, 0);
  node(plan, 1);
  plan.nodes[0].reads_per_ms = 1'000;
  plan.nodes[1].heeds_pause = false;
  plan.limits.lane1_bytes = 16 * 1'024;
  plan.limits.reserve_bytes = 64 * 1'024;
  plan.limits.budget_bytes = 8 << 20;
  return plan;
}

/// The queue for node 0 stays bounded (checker bounded), and each frame comes or is reported.
void play_deaf(Stage& stage) {
  std::vector<std::uint64_t> numbers;
  stage.run(kStartMs);
  for (int ms = 0; ms < 2'000; ++ms) {
    stage.flood(1, 20'000, [](std::size_t from) { return from == 1 ? 0 : from; });
    const auto sent = stage.node(3).send_to(stage.node(2).id(), 50);
    Stage::need(sent.has_value(), Checker::resumes, "a bystander is paused");
    numbers.push_back(*sent);
  }
  stage.run(5'000);
  for (const std::uint64_t number : numbers)
    Stage::need(stage.has_arrived(number), Checker::reachable, "a bystander's frame was lost");
  Stage::need(stage.node(1).reported() != 0, Checker::bounded, "nothing was dropped");
  Stage::need(stage.arrived() + stage.node(1).reported() == stage.sent(), Checker::reachable,
              "a frame neither comes nor is reported");
}

/// Each node sends to the one opposite. Two of the four links carry frames of their own node and of
/// another one, which have to take turns.
void play_block_ring(Stage& stage) {
  // Longer than what lies in two full lanes takes.
  constexpr std::uint64_t kLookMs = 60'000;
  const std::uint64_t looks = stage.is_long() ? 60 : 5;
  const auto opposite = [](std::size_t from) { return (from + 2) % 4; };
  stage.run(kStartMs);
  for (std::uint64_t look = 0; look < looks; ++look) {
    std::vector<std::uint64_t> before;
    for (std::size_t to = 0; to < stage.nodes(); ++to) before.push_back(stage.node(to).taken());
    stage.flood(kLookMs, kRingBytes, opposite);
    for (std::size_t to = 0; to < stage.nodes(); ++to)
      Stage::need((stage.node(to).taken() - before[to]) * kRingBytes * 4 > kLookMs * kRingRate,
                  Checker::resumes, "a sender does not get a quarter of its link");
  }
  stage.all_arrive(60'000);
}

constexpr Scene kLoad[] = {
    {"66_sources_of_broadcast", plan_broadcasts, play_broadcasts},
    {"three_block_to_a_slow_node", plan_slow_node, play_slow_node},
    {"sender_ignores_pause", plan_deaf, play_deaf},
    {"ring_of_four_with_block", [] { return ring(4, 5, kRingRate); }, play_block_ring},
};

}  // namespace

std::span<const Scene> load_scenes() { return kLoad; }

}  // namespace gimnet::sim::hubs
