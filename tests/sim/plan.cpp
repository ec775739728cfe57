#include "tests/sim/plan.hpp"

#include <algorithm>

namespace gimnet::sim {
namespace {

using namespace std::chrono_literals;

/// 0 in a quarter of the worlds.
std::uint64_t sometimes(Random& random, std::uint64_t most) {
  const bool off = random.chance(250);
  const std::uint64_t value = random.between(1, most);
  return off ? 0 : value;
}

void draw_limits(Random& random, Plan& plan) {
  hub::Limits& limits = plan.limits;
  limits.grace_ms = random.between(700, 2'500);
  limits.block_ms = 500;
  limits.slow_consumer_ms = 1'000;
  // In some worlds tokens run out while their nodes are there.
  const std::uint64_t token_ms = random.between(1'000, 6'000);
  if (random.chance(200)) limits.token_ms = token_ms;
  limits.silent_ms = random.between(300, 2'000);
  limits.requests = random.between(4, 16);
  limits.services_per_node = random.between(2, 6);
  limits.subscriptions_per_node = random.between(2, 8);
  const bool hurried = random.chance(500);
  const std::uint64_t declarations = random.between(1, 8);
  const std::uint64_t per_s = random.between(1, 3);
  if (hurried) limits.declarations_burst = declarations;
  if (hurried) limits.services_per_node = limits.subscriptions_per_node = 2;
  if (hurried) limits.declarations_per_s = per_s;
  const bool strict = random.chance(300);
  const std::uint64_t oddities = random.between(2, 6);
  if (strict) limits.oddities_burst = oddities;
  if (strict) limits.oddities_per_s = 1;
  limits.sync_window = random.between(1, 5);
  limits.subscription_depth = random.between(1, 4);
  limits.subscription_rate_hz = 200;
  limits.watches = random.between(1, 3);
  limits.watches_per_node = random.between(1, 2);
  const bool forgetful = random.chance(500);
  limits.watch_changes = forgetful ? random.between(5, 100) : random.between(1'000, 3'000);
  limits.scan_records = 64;
  limits.page_records = random.between(4, 40);
  // Half of the worlds have too small a hub.
  const bool crowded = random.chance(500);
  const std::uint64_t room = random.between(60, 95);
  limits.nodes = crowded ? std::max<std::uint64_t>(2, plan.nodes * room / 100) : 4 * plan.nodes;
  limits.administrators = 1;
}

}  // namespace

Plan Plan::draw(Random& random, std::size_t nodes) {
  Plan plan;
  plan.nodes = nodes;
  plan.shards = static_cast<std::size_t>(random.between(1, 4));
  draw_limits(random, plan);
  plan.names =
      static_cast<std::uint32_t>(std::max<std::uint64_t>(1, nodes * random.between(70, 200) / 100));
  plan.nameless = random.between(0, 300);
  plan.waits_away = random.between(0, 1'000);
  plan.acts_ms = static_cast<std::uint32_t>(random.between(400, 1'500));
  plan.faults_until = 6s;
  plan.end = plan.faults_until +
             std::chrono::milliseconds{3 * plan.limits.grace_ms + plan.limits.silent_ms} + 5s;
  plan.latency_most = Time{random.between(200, 100'000)};
  plan.crash = sometimes(random, 40);
  plan.vanish = sometimes(random, 30);
  plan.hang = sometimes(random, 30);
  plan.goodbye = sometimes(random, 30);
  plan.twin = sometimes(random, 20);
  plan.misconduct = sometimes(random, 15);
  plan.flood = sometimes(random, 20);
  plan.administers = sometimes(random, 500);
  plan.bad_token = sometimes(random, 200);
  plan.lost_token = sometimes(random, 500);
  plan.rename = sometimes(random, 150);
  plan.slow_reader = sometimes(random, 400);
  plan.bad_configuration = sometimes(random, 500);
  plan.latest = sometimes(random, 300);
  plan.sync = sometimes(random, 600);
  plan.retain = sometimes(random, 500);
  plan.terms = sometimes(random, 500);
  plan.late_credit = sometimes(random, 900);
  plan.queue_messages = random.between(2, 64);
  plan.stall = sometimes(random, 300);
  plan.clog = sometimes(random, 20);
  plan.shard_pause = sometimes(random, 5);
  plan.conductor_pause = sometimes(random, 5);
  plan.disk_full = sometimes(random, 500);
  plan.hub_kills = random.chance(300) ? random.between(1, 2) : 0;
  plan.hub_drains = random.chance(200) ? random.between(1, 2) : 0;
  plan.missed_event = sometimes(random, 100);
  // Half of the worlds tell in the smallest pieces.
  const std::uint64_t told = random.between(1, 3);
  if (random.chance(500)) plan.limits.told_at_once = told;
  return plan;
}

}  // namespace gimnet::sim
