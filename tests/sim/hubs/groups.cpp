#include <utility>

#include "base/ids.hpp"
#include "tests/sim/hubs/world.hpp"

// Looks at a world that was left alone: services whose subscribers are at all hubs.

namespace gimnet::sim::hubs {
namespace {

constexpr std::size_t kServicesMost = 3;
/// A subscription is answered after 1 s at the latest.
constexpr std::uint64_t kAnswerMs = 1'200;

std::uint64_t last_of(const std::vector<std::uint64_t>& heard) {
  return heard.empty() ? 0 : heard.back();
}

}  // namespace

/// The operators subscribe only now, and get what the one at the provider's hub gets.
void Settled::check_groups() {
  const milliseconds way{kAnswerMs + kSlowestMs * distance_.size()};
  std::vector<Given> all;
  for (SimNode& node : world_.nodes_) {
    const bool whole = node.is_up() && node.given() && node.name() == node.plan().name;
    if (!whole || node.name().starts_with("shared")) continue;
    all.push_back({&node, *node.given()});
    if (all.size() == kServicesMost) break;
  }
  if (all.empty()) return;
  // A hub that joined in time of faults, and then all.
  const auto check_parents = [&](bool all_joined) {
    for (const Given& each : all) {
      for (std::size_t hub = 0; hub < distance_.size(); ++hub) {
        const int links = distance_[hub][each.node->at()];
        if (links <= 0 || links > proto::kHopsMax) continue;
        const SimHub& there = *world_.machines_[hub].hub;
        const hub::GroupMembers* const members = there.groups().find_away(each.group);
        const hub::NextHop next = there.routes().find(hub_of(each.group));
        if (members == nullptr && !all_joined) continue;
        if (members == nullptr || members->parent != next.neighbour)
          broken(Checker::parents, "hub " + std::to_string(hub) + " takes group " +
                                       to_string(each.group) + " of another than its next hop");
      }
    }
  };
  check_parents(false);
  const auto check = [&](const char* when) {
    for (const Given& each : all) {
      for (SimNode& person : world_.operators_) {
        const std::uint64_t last = last_of(person.heard(each.group));
        if (!is_near(person, each) || last == each.last) continue;
        broken(Checker::subscribers, std::string{when} + " of group " + to_string(each.group) +
                                         " at hub " + std::to_string(person.plan().hub) + " is " +
                                         std::to_string(last) + ", and not " +
                                         std::to_string(each.last));
      }
    }
  };
  // One after the other: a hub on the way has joined when the next subscriber comes.
  for (SimNode& person : world_.operators_) {
    for (const Given& each : all)
      if (is_near(person, each)) person.subscribe(each.node->name());
    world_.run_until(world_.now() + milliseconds{20});
  }
  world_.run_until(world_.now() + way);
  for (Given& each : all) each.last = last_of(world_.operators_[each.node->at()].heard(each.group));
  check("the last message");
  for (Given& each : all) each.last = each.node->publish();
  world_.run_until(world_.now() + way);
  check("the next message");
  check_parents(true);
  check_counts(all);
  check_missed(all);
}

bool Settled::is_near(const SimNode& person, const Given& each) const {
  const int links = distance_[person.plan().hub][each.node->at()];
  return person.is_up() && links >= 0 && links <= proto::kHopsMax;
}

/// The provider's hub counts the subscribers at all hubs that the service reaches.
void Settled::check_counts(const std::vector<Given>& all) const {
  for (const Given& each : all) {
    std::size_t sum = 0;
    for (std::size_t hub = 0; hub < distance_.size(); ++hub) {
      const int links = distance_[hub][each.node->at()];
      if (links < 0 || links > proto::kHopsMax) continue;
      const hub::Topic* const topic = world_.machines_[hub].hub->topics().find_group(each.group);
      if (topic != nullptr) sum += topic->subscribers.size();
    }
    const hub::Topics& own = world_.machines_[each.node->at()].hub->topics();
    const hub::Topic* const topic = own.find_group(each.group);
    const std::uint32_t counted = topic == nullptr ? 0 : topic->subscriber_count();
    if (counted != sum)
      broken(Checker::subscribers, "group " + to_string(each.group) + " counts " +
                                       std::to_string(counted) + " subscribers, and has " +
                                       std::to_string(sum));
  }
}

/// Each operator is the only one at its hub that says what it missed.
void Settled::check_missed(const std::vector<Given>& all) {
  for (SimNode& person : world_.operators_) {
    for (const Given& each : all)
      if (is_near(person, each)) person.say_missed(each.group, index_of(person.id()));
    for (const Given& each : all)
      if (is_near(person, each)) person.list_service(each.node->name());
  }
  world_.run_until(world_.now() + milliseconds{20});
  for (const Given& each : all) {
    for (SimNode& person : world_.operators_) {
      const std::pair<std::uint64_t, NodeId> told{index_of(person.id()), person.id()};
      if (is_near(person, each) && person.missed(each.group) != told)
        broken(Checker::subscribers, "hub " + std::to_string(person.plan().hub) + " says that " +
                                         std::to_string(person.missed(each.group).first) +
                                         " messages of group " + to_string(each.group) +
                                         " were missed, and not " + std::to_string(told.first));
    }
  }
}

}  // namespace gimnet::sim::hubs
