#include "tools/gimnet/matching_services.hpp"

#include <utility>

namespace gimnet::tool {

std::optional<std::string> MatchingServices::take(const WatchEvent& event) {
  if (event.change == Change::snapshot_begins) {
    for (auto& [name, service] : services_) service.shown = false;
  } else if (event.change == Change::snapshot_ends) {
    on_snapshot_end();
  }
  if (!event.service) return std::nullopt;
  const std::string& name = event.service->name;
  if (event.change == Change::withdrawn) {
    const auto found = services_.find(name);
    if (found == services_.end() || !found->second.there) return std::nullopt;
    const bool late = found->second.late;
    on_gone(found);
    return late ? std::optional(name) : std::nullopt;
  }
  const bool is_there = event.change == Change::present || event.change == Change::advertised;
  if (is_there && event.service->direction == Direction::provides) on_there(name);
  return std::nullopt;
}

void MatchingServices::on_there(const std::string& name) {
  const auto [found, is_new] = services_.try_emplace(name);
  Service& service = found->second;
  service.shown = true;
  if (service.there) return;
  service.there = true;
  // One with a subscription, from the last time, is not late.
  service.late = complete_ && !service.settled;
  service.lateness = service.late;
  if (is_new) {
    wanted_.push_back(name);
  } else {
    std::erase(gone_, name);
  }
}

void MatchingServices::on_gone(Services::iterator found) {
  found->second.there = false;
  gone_.push_back(found->first);
}

void MatchingServices::on_snapshot_end() {
  for (auto service = services_.begin(); service != services_.end(); ++service) {
    if (service->second.there && !service->second.shown) on_gone(service);
  }
  complete_ = true;
}

void MatchingServices::settle(std::string_view name) {
  std::erase(wanted_, name);
  if (const auto found = services_.find(name); found != services_.end())
    found->second.settled = true;
}

void MatchingServices::forget(const std::string& name) {
  std::erase(wanted_, name);
  std::erase(gone_, name);
  services_.erase(name);
}

bool MatchingServices::take_lateness(std::string_view name) {
  const auto found = services_.find(name);
  return found != services_.end() && std::exchange(found->second.lateness, false);
}

}  // namespace gimnet::tool
