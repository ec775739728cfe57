#include "tests/sim/model.hpp"

// The reference model of places: the nodes that find one, and the nodes that make way.

namespace gimnet::sim {

using proto::Role;

std::string Model::crowd_of(const std::string& place, bool may_administer) {
  if (may_administer || place.starts_with("127.")) return {};
  const std::size_t user = place.find("uid ");
  return user != std::string::npos ? place.substr(user) : place.substr(0, place.rfind(':'));
}

std::size_t Model::size_of(const std::string& crowd) const {
  std::size_t count = 0;
  for (const auto& [index, session] : sessions_) count += session.crowd == crowd ? 1 : 0;
  return count;
}

bool Model::has_half(const std::string& crowd) const {
  return !crowd.empty() && size_of(crowd) >= limits_.nodes - limits_.nodes / 2;
}

std::uint64_t Model::places_for(Role role) const {
  return limits_.nodes + (role == Role::admin ? limits_.administrators : 0);
}

bool Model::is_full_for(const Hello& hello) const {
  const auto named = names_.find(hello.hello.name);
  const std::uint32_t holder = named == names_.end() ? 0 : named->second;
  // The holder goes first; with an administrator beyond the limit more would have to go than make
  // way.
  const std::size_t going = (holder != 0 ? 1u : 0u) + (longest_away(holder) ? 1u : 0u);
  if (sessions_.size() - going >= places_for(hello.hello.role)) return true;
  const std::string crowd = crowd_of(hello.place, hello.may_administer);
  const bool joins_its_own = holder != 0 && sessions_.at(holder).crowd == crowd;
  if (crowd.empty()) return false;
  const std::size_t own = (joins_its_own ? 1u : 0u) + (longest_away_of(crowd, holder) ? 1u : 0u);
  return size_of(crowd) - own >= limits_.nodes - limits_.nodes / 2;
}

void Model::make_room(const std::string& crowd, Role role, milliseconds now) {
  if (has_half(crowd)) {
    const std::optional<std::uint32_t> own = longest_away_of(crowd, 0);
    require(own.has_value(), Checker::limits, "a crowd is let in beyond its half of the places");
    census_.add(Happening::crowd_made_room);
    end(*own, now);
  }
  if (sessions_.size() < limits_.nodes) return;
  const std::optional<std::uint32_t> away = longest_away(0);
  if (!away && sessions_.size() < places_for(role)) return;
  require(away.has_value(), Checker::limits, "somebody is let in beyond the limit on nodes");
  census_.add(declares_something(*away) ? Happening::declarer_made_room : Happening::room_made);
  end(*away, now);
}

bool Model::declares_something(std::uint32_t index) const {
  const Session& session = sessions_.at(index);
  return !session.provides.empty() || !session.subscribes.empty();
}

std::optional<std::uint32_t> Model::longest_away(std::uint32_t but) const {
  const auto rank = [this](std::uint32_t index) {
    return std::pair{declares_something(index), sessions_.at(index).away_order};
  };
  std::optional<std::uint32_t> found;
  for (const auto& [index, session] : sessions_) {
    if (session.connected || index == but) continue;
    if (!found || rank(index) < rank(*found)) found = index;
  }
  return found;
}

std::optional<std::uint32_t> Model::longest_away_of(const std::string& crowd,
                                                    std::uint32_t but) const {
  std::optional<std::uint32_t> found;
  for (const auto& [index, session] : sessions_) {
    if (session.connected || index == but || session.crowd != crowd) continue;
    if (!found || session.away_order < sessions_.at(*found).away_order) found = index;
  }
  return found;
}

}  // namespace gimnet::sim
