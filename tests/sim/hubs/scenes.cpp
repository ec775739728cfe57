#include "tests/sim/hubs/scenes.hpp"

#include <algorithm>
#include <string>
#include <vector>

#include "tests/sim/hubs/load_scenes.hpp"
#include "tests/sim/hubs/scene_plans.hpp"
#include "tests/sim/hubs/timed_scenes.hpp"

namespace gimnet::sim::hubs {
namespace {

/// So many names at hubs 0 and 1, each at both.
void same_names(Plan& plan, std::size_t names, std::size_t one, std::size_t other) {
  for (std::size_t i = 0; i < names; ++i) {
    node(plan, one, "twice" + std::to_string(i));
    node(plan, other, "twice" + std::to_string(i));
  }
}

// Sizes and ways

void play_wan(Stage& stage) {
  stage.run(kStartMs);
  for (int i = 0; i < 3; ++i) {
    stage.flood(300, 200, [](std::size_t from) { return 1 - from; });
    stage.reset(0);
    stage.run(1'500);
  }
  Stage::need(stage.count(Event::resumed) != 0, Checker::joined, "no break was resumed");
}

Plan plan_modem() {
  Plan plan = chain(2, 20, 1);
  plan.wires[0].silent_ms = 20'000;
  return plan;
}

void play_modem(Stage& stage) {
  stage.run(2 * kStartMs);
  const std::uint64_t line = stage.line_of(0);
  for (int i = 0; i < 2; ++i)
    Stage::need(stage.node(0).send_to(stage.node(1).id(), 65'000).has_value(), Checker::resumes,
                "a node may not send");
  stage.all_arrive(150'000);
  Stage::need(stage.line_of(0) == line, Checker::joined, "the link broke");
}

// Breaks

void play_control_only(Stage& stage) {
  stage.run(kStartMs);
  for (std::size_t i = 0; i < 8; ++i) {
    stage.cut(i % 2);
    stage.crash(i % stage.nodes());
    SimNode& other = stage.node((i + 1) % stage.nodes());
    if (other.is_up()) other.subscribe("n" + std::to_string(i % stage.nodes()));
    stage.run(100);
    stage.reset(i % 2);
    stage.mend(i % 2);
    stage.run(400);
  }
}

void play_no_state(Stage& stage) {
  stage.run(kStartMs);
  for (int i = 0; i < 3; ++i) {
    stage.stop(1);
    stage.lose_state(1);
    stage.run(20);
    stage.start(1);
    stage.run(1'500);
  }
}

Plan plan_block_loop() {
  Plan plan = ring(3);
  plan.nodes[2].reads_per_ms = 500;
  plan.limits.lane1_bytes = 16 * 1'024;
  plan.limits.reserve_bytes = 64 * 1'024;
  return plan;
}

void play_block_loop(Stage& stage) {
  const auto to_last = [](std::size_t) { return std::size_t{2}; };
  stage.run(kStartMs);
  stage.flood(200, 5'000, to_last);
  stage.cut(1);
  stage.cut(2);
  stage.flood(2'500, 5'000, to_last);
}

void play_costs(Stage& stage) {
  stage.run(kStartMs);
  for (int i = 0; i < 6; ++i) {
    stage.cut(0, true, false);
    stage.set_cost(0, i % 2 == 0 ? 30 : 1);
    stage.flood(500, 100, [](std::size_t from) { return (from + 2) % 4; });
    stage.mend(0);
    stage.flood(300, 100, [](std::size_t from) { return (from + 2) % 4; });
  }
}

void play_unknown_flag(Stage& stage) {
  const auto across = [](std::size_t from) { return 2 - from; };
  stage.run(kStartMs);
  stage.flood(20, 100, across);
  const std::uint64_t line = stage.line_of(0);
  stage.spoil_next(0);
  stage.flood(500, 100, across);
  stage.run(100);
  Stage::need(stage.arrived() + 1 == stage.sent(), Checker::reachable, "not one frame is missing");
  Stage::need(stage.line_of(0) == line, Checker::joined, "the link broke");
}

// Ids and clocks

Plan collision(bool copied) {
  Plan plan = chain(4);
  HubPlan& late = plan.hubs.back();
  late.hub = plan.hubs.front().hub;
  if (copied) late.unique = plan.hubs.front().unique;
  plan.hubs.front().collides = late.collides = plan.collisions = true;
  plan.copied = copied;
  return plan;
}

/// The chain is cut in its middle when the other hub of that id joins.
void play_collision(Stage& stage) {
  stage.cut(2);
  stage.run(kStartMs);
  Stage::need(stage.reachable(0) == 3, Checker::equal_tables, "not all hubs are there");
  stage.cut(1);
  stage.run(2'500);
  stage.mend(2);
  stage.run_until_up(2);
  stage.run(500);
  Stage::need(stage.reachable(2) == 2, Checker::equal_tables, "the newcomer has not joined");
  stage.mend(1);
  stage.run(14'000);
  Stage::need(stage.reachable(1) == 3, Checker::joined, "not one of both hubs stays out");
}

Plan plan_1970() {
  Plan plan = ring(3);
  plan.hubs[1].wall_ns = 1'000;
  same_names(plan, 3, 0, 1);
  return plan;
}

void play_1970(Stage& stage) {
  stage.cut(0);
  stage.cut(1);
  stage.run(kStartMs);
  stage.mend(0);
  stage.mend(1);
  stage.run_until_up(0);
  stage.stop(1);
  stage.start(1);
  stage.run(1'000);
}

// Names

Plan plan_away() {
  Plan plan = plan_of(2);
  wire(plan, 0, 1);
  same_names(plan, 1, 0, 1);
  return plan;
}

/// The claim with the lower node id would win, were its node connected.
void play_away(Stage& stage) {
  stage.cut(0);
  stage.run(kStartMs);
  stage.node(0).lose_connection(stage.now(), 5'000);
  stage.run(100);
  stage.mend(0);
  stage.run_until_up(0);
  stage.run(2'000);
  Stage::need(stage.node(1).name() == stage.node(1).plan().name, Checker::one_owner,
              "a node lost its name to one that is away");
  stage.check_names();
}

Plan plan_leaving() {
  Plan plan = chain(2);
  same_names(plan, 20, 0, 1);
  return plan;
}

/// One after the other, from the millisecond on in which the first claims meet.
void play_leaving(Stage& stage) {
  stage.cut(0);
  stage.run(kStartMs);
  stage.mend(0);
  stage.run_until_up(0);
  for (std::size_t i = 2; i < stage.nodes(); ++i) {
    stage.crash(i);
    stage.run(1);
  }
}

Plan plan_halves() {
  Plan plan = chain(4);
  same_names(plan, 100, 0, 3);
  return plan;
}

/// The claim at hub 0 cannot be reached. The news that hub 1 let go comes before its answer, which
/// takes the slow wire.
Plan plan_older_claim() {
  Plan plan = plan_of(3);
  wire(plan, 0, 1);
  wire(plan, 1, 2);
  wire(plan, 1, 2, 40);
  plan.wires.back().cost = 1;
  node(plan, 0);
  return plan;
}

void play_older_claim(Stage& stage) {
  stage.run(kStartMs);
  stage.stop(0);
  stage.move(0, 1);
  stage.run(3'000);
  Stage::need(stage.node(0).name() == "n0", Checker::moves, "the node did not get its name back");
  stage.move(0, 2);
  stage.run(1'300);
  Stage::need(stage.node(0).is_up() && stage.node(0).name() == "n0", Checker::moves,
              "the node has no name where it went");
}

void play_halves(Stage& stage) {
  stage.cut(1);
  stage.run(kStartMs);
  stage.mend(1);
  stage.run_until_up(1);
  stage.run(4'000);
  for (std::size_t i = 4; i < stage.nodes(); i += 2)
    Stage::need(stage.node(i).name().empty() != stage.node(i + 1).name().empty(),
                Checker::one_owner, "a name has not one owner 4 s later");
  stage.check_names();
}

constexpr Scene kScenes[] = {
    {"star_of_200", [] { return star(200); },
     [](Stage& stage) { stage.run(kStartMs), stage.reset(7); }, true},
    {"wan_of_100_ms_resumes", [] { return chain(2, 50); }, play_wan},
    {"break_loses_only_control", [] { return chain(3); }, play_control_only},
    {"two_copies_of_a_state_folder", [] { return collision(true); }, play_collision},
    {"hub_id_twice_in_a_partition", [] { return collision(false); }, play_collision},
    {"restart_without_state", [] { return ring(3); }, play_no_state},
    {"loop_of_two_with_block", plan_block_loop, play_block_loop},
    {"costs_differ_at_the_ends", [] { return ring(4); }, play_costs},
    {"node_leaves_as_claims_meet", plan_leaving, play_leaving},
    {"held_goes_before_away", plan_away, play_away},
    {"clock_of_1970", plan_1970, play_1970},
    {"modem_of_1_kb", plan_modem, play_modem},
    {"unknown_flag", [] { return chain(3); }, play_unknown_flag},
    {"move_past_an_older_claim", plan_older_claim, play_older_claim},
    {"halves_with_100_names", plan_halves, play_halves},
};

}  // namespace

std::span<const Scene> scenes() {
  static const std::vector<Scene> all = [] {
    std::vector<Scene> every(std::begin(kScenes), std::end(kScenes));
    for (const std::span<const Scene> more : {load_scenes(), timed_scenes()})
      every.insert(every.end(), more.begin(), more.end());
    return every;
  }();
  return all;
}

}  // namespace gimnet::sim::hubs
