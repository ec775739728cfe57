#include "hub/network/state/name_exchange.hpp"

#include <algorithm>

#include "base/check.hpp"

namespace gimnet::hub {
namespace {

namespace route = proto::route;
using std::chrono::milliseconds;

}  // namespace

NameExchange::Link* NameExchange::find(LinkNumber number) {
  const auto found = links_.find(number);
  return found == links_.end() ? nullptr : &found->second;
}

template <class Message>
void NameExchange::send(LinkNumber number, const Message& message) {
  sendings_.push_back({number, std::make_shared<const proto::Payload>(proto::encode(message))});
}

void NameExchange::begin_connection(LinkNumber number, milliseconds now) {
  links_[number] = {};
  begin_learning(now);
  tell_known(copies_.known(), number);
}

void NameExchange::begin_learning(milliseconds now) { learning_until_ = now + kLearning; }

void NameExchange::end_link(LinkNumber number) {
  links_.erase(number);
  std::erase_if(sendings_, [number](const Sending& each) { return each.link == number; });
}

void NameExchange::take(LinkNumber number, std::span<const std::byte> bytes, milliseconds /*now*/) {
  Link* link = find(number);
  const auto view = proto::split_control(bytes);
  if (link == nullptr || !view) return;
  const auto read = [&](auto&& message) {
    if (message) {
      take(number, *link, *message);
    } else {
      ++malformed_;
    }
  };
  switch (static_cast<route::RouteOperation>(view->header.operation)) {
    case route::RouteOperation::names_known:
      return read(proto::decode<route::NamesKnown>(bytes));
    case route::RouteOperation::names:
      return read(proto::decode<route::Names>(bytes));
    case route::RouteOperation::names_taken:
      if (const auto taken = proto::decode<route::NamesTaken>(bytes)) {
        link->under_way -= std::min<std::size_t>(link->under_way, taken->messages);
        work_ = true;
      } else {
        ++malformed_;
      }
      return;
    default:
      return;
  }
}

void NameExchange::take(LinkNumber /*number*/, Link& link, const route::NamesKnown& known) {
  for (const auto& each : known.hubs) {
    link.wants[each.hub] = {each.instance, each.version, 0};
    link.behind.insert(each.hub);
  }
  work_ = true;
}

void NameExchange::take(LinkNumber number, Link& link, const route::Names& names) {
  send(number, route::NamesTaken{});
  const auto taken = copies_.take(names);
  // The other side has what it sends.
  const auto wanted = link.wants.find(names.hub);
  if (wanted != link.wants.end() && wanted->second.instance == names.instance)
    wanted->second.version = std::max(wanted->second.version, names.version);
  if (taken == NameCopies::Taken::changed) note_change(names.hub);
}

void NameExchange::note_change(HubId hub) {
  for (auto& [number, link] : links_) {
    if (link.wants.contains(hub)) link.behind.insert(hub);
  }
  work_ = true;
}

void NameExchange::set_reachable(const NetworkMap& map, const RecordStore& store,
                                 milliseconds now) {
  std::vector<HubRun> hubs;
  for (const Way& way : map.ways()) {
    if (const auto identity = identity_of(*store.find(way.hub)))
      hubs.push_back({way.hub.hub, identity->instance});
  }
  set_reachable(hubs, now);
  for (const HubRun& run : hubs) {
    const auto way = std::ranges::lower_bound(map.ways(), run.hub, {},
                                              [](const Way& each) { return each.hub.hub; });
    if (const auto* head = store.find(way->hub)->head()) copies_.set_hub_name(run.hub, head->name);
  }
}

void NameExchange::set_reachable(std::span<const HubRun> hubs, milliseconds now) {
  const std::vector<HubId> begun = copies_.set_reachable(hubs, now);
  for (const HubId hub : begun) note_change(hub);
  tell_known_to_all(begun);
}

void NameExchange::put_own(std::string_view name, const route::NameClaim& claim) {
  copies_.put_own(name, claim);
  note_change(copies_.self().hub);
}

void NameExchange::remove_own(std::string_view name) {
  copies_.remove_own(name);
  note_change(copies_.self().hub);
}

void NameExchange::renumber(HubId hub) {
  GIMNET_CHECK(links_.empty());
  copies_.renumber(hub);
}

void NameExchange::advance(milliseconds now) {
  copies_.forget(now);
  tell_known_to_all(copies_.take_starved());
  if (!std::exchange(work_, false)) return;
  for (auto& [number, link] : links_) send_due(number, link);
}

std::optional<milliseconds> NameExchange::next_due() const {
  return work_ ? milliseconds::min() : copies_.next_due();
}

/// The hubs take turns.
void NameExchange::send_due(LinkNumber number, Link& link) {
  while (link.under_way < route::kNamesWindow && !link.behind.empty()) {
    auto next = link.behind.upper_bound(link.last_sent);
    if (next == link.behind.end()) next = link.behind.begin();
    link.last_sent = *next;
    if (const auto names = copies_.next(*next, link.wants.at(*next))) {
      send(number, *names);
      ++link.under_way;
    } else {
      link.behind.erase(next);
    }
  }
}

void NameExchange::tell_known(std::span<const route::NamesKnown::Entry> entries,
                              LinkNumber number) {
  while (!entries.empty()) {
    const auto some = entries.first(std::min(entries.size(), route::kNamesKnownMax));
    send(number, route::NamesKnown{{some.begin(), some.end()}});
    entries = entries.subspan(some.size());
  }
}

void NameExchange::tell_known_to_all(std::span<const HubId> hubs) {
  std::vector<route::NamesKnown::Entry> entries;
  for (const HubId hub : hubs) {
    if (const auto known = copies_.known(hub)) entries.push_back(*known);
  }
  for (const auto& [number, link] : links_) tell_known(entries, number);
}

}  // namespace gimnet::hub
