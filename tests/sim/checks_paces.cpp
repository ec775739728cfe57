#include <utility>

#include "tests/sim/checks.hpp"

// Compares the paces that the shards were told with those that the reference model owes to
// subscribers.

namespace gimnet::sim {

void Checks::paces() {
  for (const SimShards::Sent& sent : subject_.shards.sent()) {
    const auto seat_of = [&sent](const hub::SessionRef& session) {
      return Seat{sent.shard.value(), session.slot.value(), session.generation};
    };
    if (const auto* pace = std::get_if<hub::PaceCommand>(sent.command)) {
      const std::uint32_t group = index_of(pace->group);
      paces_[group][seat_of(pace->session)] = {pace->terms, pace->retained};
      touched_.insert(group);
    } else if (const auto* end = std::get_if<hub::EndPaceCommand>(sent.command)) {
      const std::uint32_t group = index_of(end->group);
      paces_[group].erase(seat_of(end->session));
      touched_.insert(group);
    } else if (const auto* release = std::get_if<hub::ReleaseCommand>(sent.command)) {
      for (auto& [group, told] : paces_) told.erase(seat_of(release->session));
    }
  }
  // Those that have yet to be told are not paced yet.
  untold_.insert(touched_.begin(), touched_.end());
  if (conductor_->tells_later()) return;
  for (const std::uint32_t group : std::exchange(untold_, {})) {
    const auto found = model_.groups().find(group);
    if (found != model_.groups().end()) pace_of(group, found->second->second);
  }
}

void Checks::pace_of(std::uint32_t group, const Model::Topic& topic) const {
  std::map<Seat, Pace> due;
  for (const auto& [index, subscriber] : topic.subscribers) {
    const auto pace = Model::pace_of(topic, index);
    if (!pace) continue;
    const hub::Place& place = places_.at(index);
    due[{place.shard.value(), place.slot.value(), place.generation}] = {
        {pace->window, pace->depth, pace->interval_us}, topic.service->terms.retain};
  }
  const auto told = paces_.find(group);
  const bool right = told == paces_.end() ? due.empty() : told->second == due;
  if (!right)
    broken(Checker::pace, "the shards are told another pace for group " + std::to_string(group));
}

}  // namespace gimnet::sim
