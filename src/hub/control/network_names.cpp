#include "hub/control/network_names.hpp"

#include <algorithm>
#include <utility>

#include "base/ids.hpp"
#include "base/log.hpp"
#include "hub/control/next_hops.hpp"

namespace gimnet::hub {
namespace {

namespace route = proto::route;
using proto::ns::ChangeKind;
using std::chrono::milliseconds;

constexpr milliseconds kShortagePause = std::chrono::minutes(1);

std::string hub_text(const NameCopies& copies, HubId hub) {
  const std::string_view name = copies.hub_name(hub);
  return "hub " + std::to_string(hub.value()) +
         (name.empty() ? "" : " (" + escaped(name, kQuotedMax) + ")");
}

/// Why that claim of another hub is better than this hub's own.
std::string reason(const route::NameClaim& own, const route::NameClaim& winner) {
  if (own.service) return "names of nodes go before those of services";
  if (own.state != winner.state) return "the node here has lost its connection";
  if (own.rank == winner.rank) return "its id is the lower one, and both claims have one rank";
  return "its claim has rank " + std::to_string(winner.rank) + ", and the one of this hub " +
         std::to_string(own.rank);
}

/// Only whether a service that accepts is away is different.
bool is_acceptance_alone(const NameChange& change) {
  if (!change.before || !change.after || !change.after->service) return false;
  route::NameClaim before = *change.before;
  before.version = change.after->version;
  before.state = change.after->state;
  return before == *change.after;
}

}  // namespace

void NetworkNames::begin_connection(LinkNumber number, milliseconds now) {
  if (!exchange_) begin();
  exchange_->begin_connection(number, now);
}

void NetworkNames::begin() {
  exchange_.emplace(NameCopies::Options{{parts_.facts.id, parts_.facts.instance},
                                        milliseconds{parts_.limits.grace_ms},
                                        parts_.limits.names_bytes});
  for (const auto& [index, session] : parts_.membership.sessions().all()) put(session);
  for (const auto& [group, topic] : parts_.membership.topics().groups()) put(*topic);
  parts_.membership.join_network(exchange_->copies());
  parts_.watches.join_network(exchange_->copies());
}

void NetworkNames::put(const Session& session) {
  // One that is being admitted is told of when it is attached.
  if (session.name.empty() || session.attachment == 0) return;
  route::NameClaim claim;
  claim.node = make_id(parts_.facts.id, session.index);
  claim.state = session.connected ? route::NameState::held : route::NameState::away;
  exchange_->put_own(session.name.str(), claim);
}

void NetworkNames::put(const Topic& topic) {
  if (!topic.provided()) return;
  const ServiceTerms& terms = topic.service->terms;
  const Session* provider = parts_.membership.sessions().find(topic.service->provider);
  route::NameClaim claim;
  claim.node = make_id(parts_.facts.id, topic.service->provider);
  if (topic.service->provider_away) claim.state = route::NameState::away;
  claim.service.emplace();
  claim.service->group = make_id(parts_.facts.id, topic.service->group);
  claim.service->session = provider == nullptr ? 0 : provider->number;
  claim.service->message_type = terms.message_type;
  claim.service->instance = terms.instance;
  claim.service->window = terms.window;
  claim.service->direction = terms.direction;
  claim.service->delivery = terms.delivery;
  claim.service->retain = terms.retain;
  exchange_->put_own(topic.full_name, claim);
}

void NetworkNames::note(const NodeNoted& noted) {
  if (!exchange_) return;
  if (!noted.former_name.empty()) exchange_->remove_own(noted.former_name);
  if (noted.kind == ChangeKind::left) {
    if (!noted.name.empty()) exchange_->remove_own(noted.name);
  } else if (const Session* session = parts_.membership.sessions().find(noted.index)) {
    put(*session);
  }
}

void NetworkNames::note(const ServiceNoted& noted) {
  if (!exchange_) return;
  if (noted.kind == ChangeKind::withdrawn) {
    exchange_->remove_own(noted.full_name);
    withdrawn_.push_back(noted.full_name);
  } else if (const Topic* topic = parts_.membership.topics().find_group(noted.group)) {
    put(*topic);
  }
}

void NetworkNames::note(const AcceptanceChanged& noted) {
  const Topic* topic = exchange_ ? parts_.membership.topics().find_group(noted.group) : nullptr;
  if (topic != nullptr) put(*topic);
}

void NetworkNames::take(LinkNumber number, std::span<const std::byte> payload, milliseconds now) {
  if (exchange_) exchange_->take(number, payload, now);
}

void NetworkNames::end_link(LinkNumber number) {
  if (exchange_) exchange_->end_link(number);
}

void NetworkNames::set_reachable(const NetworkMap& map, const RecordStore& store,
                                 milliseconds now) {
  if (exchange_) exchange_->set_reachable(map, store, now);
}

std::vector<Sending> NetworkNames::take_sendings(milliseconds now) {
  if (!exchange_) return {};
  exchange_->advance(now);
  return exchange_->take_sendings();
}

std::optional<milliseconds> NetworkNames::next_due() const {
  return exchange_ ? exchange_->next_due() : std::nullopt;
}

void NetworkNames::settle(milliseconds now, Effects& effects, const NextHops* hops) {
  if (!exchange_) return;
  log_shortage(now);
  // The look-ups are valid until a name changes: the effects say so only later.
  for (const KnownName& winner : exchange_->take_lost()) let_go(winner, {now, hops}, effects);
  for (const std::string& name : std::exchange(withdrawn_, {})) {
    if (const auto away = away_service(name))
      parts_.membership.topics().note_moved(name, away, now, effects);
  }
  for (const NameChange& change : exchange_->take_changes()) {
    const bool service =
        (change.before && change.before->service) || (change.after && change.after->service);
    if (service) note_service(change, now, effects);
    if (!is_acceptance_alone(change)) parts_.watches.note(change);
  }
  if (std::exchange(dropped_copies_, exchange_->copies().dropped_copies()) !=
      exchange_->copies().dropped_copies()) {
    std::vector<std::string> all;
    for (const auto& [name, topic] : parts_.membership.topics().by_name()) {
      if (!topic.provided()) all.push_back(name);
    }
    for (const std::string& name : all)
      parts_.membership.topics().note_moved(name, away_service(name), now, effects);
    parts_.watches.begin_again();
  }
}

void NetworkNames::log_shortage(milliseconds now) {
  const NameCopies& copies = exchange_->copies();
  const auto starved = copies.starved();
  if (!starved || copies.refused() == logged_refusals_) return;
  if (shortage_logged_at_ && now < *shortage_logged_at_ + kShortagePause) return;
  shortage_logged_at_ = now;
  logged_refusals_ = copies.refused();
  const HubId largest = copies.largest();
  log_warning(
      "no room for all names of " + hub_text(copies, *starved) + ": names of other hubs have " +
      std::to_string(copies.bytes_of_others()) + " of " +
      std::to_string(parts_.limits.names_bytes) + " bytes (names_bytes), most of them " +
      hub_text(copies, largest) + ", " + std::to_string(copies.counts_of(largest).bytes) +
      ", and one hub may have half; its nodes cannot be found by their names here; find out "
      "why that hub has so many names, or raise names_bytes");
}

/// Links may want the group, whether nodes here do or not.
void NetworkNames::note_service(const NameChange& change, milliseconds now, Effects& effects) {
  parts_.membership.topics().note_moved(change.name, away_service(change.name), now, effects);
  for (const auto* claim : {&change.before, &change.after}) {
    if (*claim && (*claim)->service)
      effects.emplace_back(AwayGroupChanged{(*claim)->service->group});
  }
}

std::optional<AwayService> NetworkNames::away_service(std::string_view full_name) const {
  const auto known = exchange_ ? exchange_->copies().find(full_name) : std::nullopt;
  if (!known || known->hub == parts_.facts.id || !known->claim->service) return std::nullopt;
  const route::ServiceClaim& service = *known->claim->service;
  if (service.direction != proto::ns::Direction::provides) return std::nullopt;
  const bool counted = service.delivery == proto::ns::Delivery::sync;
  return AwayService{service.group, known->claim->node, counted ? std::max(1u, service.window) : 0,
                     service.retain};
}

void NetworkNames::let_go(const KnownName& winner, const Told& told, Effects& effects) {
  const std::string name{winner.name};
  const std::string sentence = "node " + to_string(winner.claim->node) + " of " +
                               hub_text(exchange_->copies(), winner.hub) + " has the name, since " +
                               reason(*exchange_->copies().own_claim(name), *winner.claim);
  std::string way;
  if (told.hops != nullptr)
    way = "; that hub is reached over the link to hub " +
          std::to_string(told.hops->find(winner.hub).neighbour.value());
  log_warning("this hub lets go of the name '" + name + "': " + sentence + way);
  parts_.membership.lose_name(name, winner.claim->node, sentence, told.now, effects);
}

}  // namespace gimnet::hub
