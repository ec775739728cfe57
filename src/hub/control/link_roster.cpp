#include "hub/control/link_roster.hpp"

#include <algorithm>
#include <string>
#include <utility>

#include "base/check.hpp"

namespace gimnet::hub {
namespace {

/// Of a link that the other side dialled.
std::string shown_name(const HubLink& link) {
  return "from hub " + std::to_string(link.peer()->hub.hub.value());
}

}  // namespace

HubLink* LinkRoster::find(LinkNumber number) const {
  const auto found = links_.find(number);
  return found == links_.end() ? nullptr : found->second.get();
}

HubLink* LinkRoster::find(const SessionRef& session) const {
  const auto found = by_generation_.find(session.generation);
  return found == by_generation_.end() ? nullptr : find(found->second);
}

HubLink* LinkRoster::find(std::string_view name) const {
  HubLink* accepted = nullptr;
  for (const auto& [number, link] : links_) {
    const bool named = link->name() == name;
    if (named && link->is_dialled()) return link.get();
    if (named || (!link->is_dialled() && link->peer() && name == shown_name(*link)))
      accepted = link.get();
  }
  return accepted;
}

HubLink* LinkRoster::find_accepted(const proto::UniqueId& dialler, std::string_view name) const {
  for (const auto& [number, link] : links_) {
    const bool same = !link->is_dialled() && link->name() == name && link->peer() &&
                      link->peer()->hub.unique == dialler;
    if (same) return link.get();
  }
  return nullptr;
}

Result<HubLink*> LinkRoster::to_change(std::string_view name) const {
  HubLink* const link = find(name);
  if (link == nullptr)
    return Error{"there is no link '" + std::string{name} + "'; see gimnet links"};
  if (link->is_dialled()) return link;
  const std::string there = link->peer() ? link->title() : "the other side";
  // The other side chose that name: it is shown, and is no word of a command to repeat.
  std::string names;
  for (const auto& [number, each] : links_) {
    const bool meant =
        each.get() == link || (!each->is_dialled() && each->peer() && name == shown_name(*each));
    if (meant) names += (names.empty() ? "'" : " or '") + each->name() + "'";
  }
  return Error{there + " dials that link; change it there, as " + names};
}

HubLink& LinkRoster::add(DialledLink dialled) {
  const LinkNumber number{++last_number_};
  return *(links_[number] = std::make_unique<HubLink>(number, std::move(dialled)));
}

HubLink& LinkRoster::add_accepted(std::string_view name) {
  const LinkNumber number{++last_number_};
  return *(links_[number] = std::make_unique<HubLink>(number, std::string{name}));
}

void LinkRoster::give_place(HubLink& link, Place place) {
  link.place = place;
  by_generation_[place.generation] = link.number();
}

Place LinkRoster::take_place(HubLink& link) {
  GIMNET_CHECK(link.place.has_value());
  const Place place = *std::exchange(link.place, std::nullopt);
  by_generation_.erase(place.generation);
  return place;
}

std::vector<LinkNumber> LinkRoster::long_ended(std::chrono::milliseconds now) const {
  std::vector<std::pair<std::chrono::milliseconds, LinkNumber>> ended;
  for (const auto& [number, link] : links_)
    if (link->is_over()) ended.emplace_back(link->over_since(now), number);
  std::ranges::sort(ended);
  std::vector<LinkNumber> gone;
  for (std::size_t i = 0; i < ended.size(); ++i) {
    const auto& [since, number] = ended[i];
    if (ended.size() - i > kEndedMost || since + HubLink::kEndedShown <= now)
      gone.push_back(number);
  }
  return gone;
}

}  // namespace gimnet::hub
