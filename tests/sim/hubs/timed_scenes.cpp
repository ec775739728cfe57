#include "tests/sim/hubs/timed_scenes.hpp"

#include <algorithm>
#include <optional>
#include <vector>

#include "tests/sim/hubs/scene_plans.hpp"

namespace gimnet::sim::hubs {
namespace {

// A hub is cut off: frames to the other side are reported

/// Within 200 ms after the time for resume is over: that is 300 ms and four round trips of 2 ms.
constexpr std::uint64_t kNoRouteAfterCloseMs = 500 + 8;
/// A link is silent for 1 s until it counts as broken, and 100 ms may pass until that is seen.
constexpr std::uint64_t kNoRouteAfterSilenceMs = 1'000 + kNoRouteAfterCloseMs;

/// Node 0 sends a frame each 10 ms from now on. Its first report of `no_route` comes in time, and
/// none of its frames is without a report.
void expect_no_route(Stage& stage, std::uint64_t within_ms) {
  const milliseconds began = stage.now();
  const NodeId to = stage.node(1).id();
  const std::uint64_t arrived = stage.arrived();
  std::uint64_t sent = 0;
  for (; sent < within_ms / 10 + 10; ++sent) {
    Stage::need(stage.node(0).send_to(to).has_value(), Checker::resumes, "a node may not send");
    stage.run(10);
  }
  const auto first = stage.node(0).first_report(proto::DropReason::no_route);
  Stage::need(first.has_value(), Checker::reachable, "no frame is reported no_route");
  Stage::need(*first <= began + milliseconds{within_ms}, Checker::reachable,
              "no_route comes too late");
  stage.run(200);
  Stage::need(stage.node(0).reported() + (stage.arrived() - arrived) >= sent, Checker::reachable,
              "a frame is neither delivered nor reported");
}

void play_closed_link(Stage& stage) {
  stage.run(kStartMs);
  stage.stop(1);
  expect_no_route(stage, kNoRouteAfterCloseMs);
  stage.start(1);
}

void play_silent_link(Stage& stage) {
  stage.run(kStartMs);
  stage.cut(0);
  expect_no_route(stage, kNoRouteAfterSilenceMs);
  stage.mend(0);
}

// Frames find another way

constexpr std::uint64_t kOtherWayAfterCloseMs = 500;
constexpr std::uint64_t kOtherWayAfterSilenceMs = 1'500;
constexpr std::uint64_t kOnItsWayMs = 20;

/// Frames from hub 0 to hub 2 of a ring of four, which went through hub 1, come in time.
void expect_other_way(Stage& stage, std::uint64_t within_ms) {
  std::vector<std::uint64_t> numbers;
  for (std::uint64_t ms = 0; ms < within_ms; ms += 10) {
    const auto number = stage.node(0).send_to(stage.node(2).id());
    Stage::need(number.has_value(), Checker::resumes, "a node may not send");
    // Frames that had passed hub 1 still come.
    if (ms >= kOnItsWayMs) numbers.push_back(*number);
    stage.run(10);
  }
  stage.run(kOnItsWayMs);
  Stage::need(std::ranges::any_of(numbers, [&](auto each) { return stage.has_arrived(each); }),
              Checker::reachable, "frames do not find another way in time");
}

void play_other_way_after_close(Stage& stage) {
  stage.run(kStartMs);
  stage.stop(1);
  expect_other_way(stage, kOtherWayAfterCloseMs);
  stage.start(1);
}

void play_other_way_after_silence(Stage& stage) {
  stage.run(kStartMs);
  stage.cut(0);
  expect_other_way(stage, kOtherWayAfterSilenceMs);
  stage.mend(0);
}

// A link that breaks often

/// A connection breaks each second, and is back within 50 ms: what was resumed costs nobody a
/// route.
void play_break_each_second(Stage& stage) {
  stage.run(kStartMs);
  for (int i = 0; i < 20; ++i) {
    stage.reset_at_both_ends(0);
    stage.flood(1'000, 100, [](std::size_t from) { return 1 - from; });
    Stage::need(!stage.is_damped(0), Checker::joined, "a link that was resumed is damped");
  }
  stage.all_arrive(1'000);
  Stage::need(!stage.node(0).first_report(proto::DropReason::no_route), Checker::reachable,
              "frames found no way over a link that was resumed");
}

/// Its routes went so often that it is damped: it carries, since no other way leads there.
void play_damped(Stage& stage) {
  constexpr std::uint64_t kComesUpWithinMs = 100;
  stage.run(kStartMs);
  for (int i = 0; i < 5; ++i) {
    stage.cut(0);
    stage.run(2'000);
    stage.mend(0);
    stage.run_until_up(0);
  }
  stage.run(kComesUpWithinMs);
  Stage::need(stage.is_damped(0), Checker::joined, "a link that broke five times is not damped");
  const std::uint64_t arrived = stage.arrived();
  const std::uint64_t sent = stage.sent();
  stage.flood(500, 100, [](std::size_t from) { return 1 - from; });
  stage.run(kOnItsWayMs);
  Stage::need(stage.is_damped(0), Checker::joined, "a link is not damped for long");
  Stage::need(stage.arrived() - arrived == stage.sent() - sent, Checker::reachable,
              "a damped link does not carry what has no other way");
}

// Links of which nobody wants anything

void play_idle(Stage& stage) {
  constexpr std::uint64_t kSeconds = 20;
  constexpr std::uint64_t kFramesMost = 10;  ///< a second and link
  // Costs fall for a while, and each fall is told.
  stage.run(10'000);
  std::uint64_t before[3];
  for (std::size_t wire = 0; wire < 3; ++wire) before[wire] = stage.frames_of(wire);
  stage.run(kSeconds * 1'000);
  for (std::size_t wire = 0; wire < 3; ++wire)
    Stage::need(stage.frames_of(wire) - before[wire] <= kSeconds * kFramesMost, Checker::bounded,
                "an idle link carries more than 10 frames a second");
}

// Pictures over a link that is too slow for all of them

constexpr std::uint32_t kPictureBytes = 200'000;
constexpr std::uint64_t kPictureEveryMs = 33;
constexpr std::uint32_t kPictureRate = 1'000;  ///< bytes a ms: one picture takes 200 ms
constexpr std::uint64_t kPictureDelayMs = 20;
/// Two transmission times and the delay of the way.
constexpr milliseconds kPictureAgeMost{2 * (kPictureBytes / kPictureRate) + kPictureDelayMs};
constexpr std::uint64_t kPicturesMs = 20'000;

void play_pictures(Stage& stage) {
  stage.run(kStartMs);
  for (std::uint64_t ms = 0; ms < kPicturesMs; ms += kPictureEveryMs) {
    stage.node(0).show(stage.node(1).id(), kPictureBytes);
    stage.run(kPictureEveryMs);
  }
  const auto& seen = stage.node(1).pictures();
  // The link carries 5 a second.
  Stage::need(seen.size() >= kPicturesMs / 1'000 * 5 * 8 / 10, Checker::reachable,
              "fewer pictures come than four fifths of what the link carries");
  std::optional<milliseconds> before;
  for (const Pictures::Seen& each : seen) {
    Stage::need(!before || each.shown_at > *before, Checker::reachable, "an older picture comes");
    before = each.shown_at;
    Stage::need(each.came_at - each.shown_at <= kPictureAgeMost, Checker::reachable,
                "a picture is older than two transmission times");
  }
}

// A hub that began anew under another id gives way to nobody for a minute

constexpr std::uint16_t kTwice = 1'030;

/// Hub 0 has the id of hub 1, and both were drawn.
Plan plan_minute() {
  Plan plan = plan_of(3);
  for (const std::size_t hub : {std::size_t{0}, std::size_t{1}}) {
    plan.hubs[hub].hub = kTwice;
    plan.hubs[hub].configured = false;
  }
  wire(plan, 0, 1);
  wire(plan, 2, 0);
  for (std::size_t hub = 0; hub < 3; ++hub) node(plan, hub);
  return plan;
}

void play_minute(Stage& stage) {
  stage.run(2 * kStartMs);
  const HubId anew = stage.hub_id(0);
  Stage::need(anew != HubId{kTwice} && stage.reachable(0) == 3, Checker::joined,
              "the hub that dials has not drawn again");
  stage.stop(2);
  stage.set_hub_id(2, anew);
  stage.start(2);
  stage.run(50'000);
  Stage::need(stage.hub_id(0) == anew && stage.reachable(0) == 2, Checker::joined,
              "a hub that began anew gives way within a minute");
  stage.run(15'000);
  Stage::need(stage.hub_id(0) != anew && stage.reachable(2) == 3, Checker::joined,
              "a hub with a drawn id does not give way to a configured one");
}

constexpr Scene kTimed[] = {
    {"no_route_after_a_closed_link", [] { return chain(2); }, play_closed_link},
    {"no_route_after_a_silent_link", [] { return chain(2); }, play_silent_link},
    {"other_way_after_a_closed_link", [] { return ring(4); }, play_other_way_after_close},
    {"other_way_after_a_silent_link", [] { return ring(4); }, play_other_way_after_silence},
    {"link_breaks_each_second", [] { return chain(2); }, play_break_each_second},
    {"damped_link_carries", [] { return chain(2); }, play_damped},
    {"three_idle_hubs", [] { return ring(3); }, play_idle},
    {"pictures_of_a_slow_link", [] { return chain(2, kPictureDelayMs, kPictureRate); },
     play_pictures},
    {"hub_that_began_anew_stays", plan_minute, play_minute},
};

}  // namespace

std::span<const Scene> timed_scenes() { return kTimed; }

}  // namespace gimnet::sim::hubs
