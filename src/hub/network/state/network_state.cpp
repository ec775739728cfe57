#include "hub/network/state/network_state.hpp"

#include <algorithm>
#include <tuple>

#include "base/check.hpp"

namespace gimnet::hub {
namespace {

constexpr std::uint16_t kDrawnFrom = 1024;

}  // namespace

NetworkState::NetworkState(HubIdentity self, HubWords words)
    : own_(self, std::move(words)), map_(self) {}

LinkAdmissionAnswer NetworkState::admit(const HubIdentity& newcomer) const {
  const HubIdentity& self = own_.identity();
  if (newcomer.instance == self.instance) return {LinkAdmission::is_self};
  if (newcomer.key.unique == self.key.unique) return {LinkAdmission::is_copy, self.key};
  for (const auto& [number, link] : links_) {
    const HubIdentity& peer = link.facts.peer;
    if (peer.key.unique == newcomer.key.unique && peer.instance != newcomer.instance)
      return {LinkAdmission::ask_old_link, peer.key, number};
  }
  if (newcomer.key.hub == self.key.hub) {
    // Nobody has verified what it says: hubs of which neither id was configured are told apart at
    // its expense, whatever its unique id.
    const bool gives_way = newcomer.configured && !self.configured;
    return gives_way ? LinkAdmissionAnswer{LinkAdmission::draw_again}
                     : LinkAdmissionAnswer{LinkAdmission::id_taken, self.key};
  }
  std::optional<proto::HubKey> holder;
  bool is_known = false;
  for (const proto::HubKey& hub : map_.reachable()) {
    if (hub == self.key) continue;
    const auto known = identity_of(*store_.find(hub));
    if (!known) continue;
    if (hub.unique == newcomer.key.unique && known->instance != newcomer.instance)
      return {LinkAdmission::is_copy, hub};
    is_known = is_known || hub == newcomer.key;
    if (hub.hub == newcomer.key.hub && hub != newcomer.key) holder = hub;
  }
  // Two parts of a network met: all hubs see which of both keeps the id.
  if (is_known || !holder) return {};
  return {LinkAdmission::id_taken, holder};
}

NetworkState::Link* NetworkState::find(LinkNumber number) {
  const auto found = links_.find(number);
  return found == links_.end() ? nullptr : &found->second;
}

void NetworkState::begin_connection(LinkNumber number, LinkFacts facts,
                                    std::chrono::milliseconds now) {
  say_own(now);
  Link& link = links_[number];
  const HubIdentity& before = link.facts.peer;
  const bool same = before.key == facts.peer.key && before.instance == facts.peer.instance;
  if (!same) link = {};
  link.facts = std::move(facts);
  link.differs_since.reset();
  link.repair_pause = kRepairPauses.first;
  note_links();
  map_changed_ = true;
  for (const PartRef& part : store_.all()) send(number, part);
  static const auto kMark =
      std::make_shared<const proto::Payload>(proto::encode(proto::route::RecordsEnd{}));
  sendings_.push_back({number, kMark});
}

void NetworkState::take_record(LinkNumber number, proto::Payload bytes,
                               std::chrono::milliseconds now) {
  Link* link = find(number);
  if (link == nullptr) return;
  const PartRef part = read_part(std::move(bytes));
  if (part == nullptr) {
    ++malformed_;
    return;
  }
  const StoredRecord* record = store_.find(part->said.hub);
  const PartRef known = record == nullptr ? nullptr : record->part(part->said.part);
  const bool is_own = part->said.hub == own_.identity().key;
  if (!is_own && known != nullptr && !is_newer(*part, *known)) {
    // Repairs leave out what cannot be reached here, and the other side may believe that it can.
    if (record->unreachable_since && is_newer(*known, *part)) send(number, known);
    return;
  }
  if (link->pace.admit(part, now)) take(number, part, now);
}

void NetworkState::take(LinkNumber from, const PartRef& part, std::chrono::milliseconds now) {
  if (part->said.hub == own_.identity().key) {
    own_.hear(part->said);
    const StoredRecord* own = store_.find(part->said.hub);
    const PartRef mine = own == nullptr ? nullptr : own->part(part->said.part);
    if (mine != nullptr && contradict(*mine, *part)) own_.go_on_behind(part->said.sequence);
    // Of a hub and its copy the one with the lower instance stays.
    if (own_.living_copy() > own_.identity().instance) own_.forget_copy();
    return;
  }
  if (has_own_word(from, part->said.hub)) return refuse(from, part, now);
  const std::uint64_t crowded = store_.too_many();
  const auto taken = store_.take(part, now);
  if (store_.too_many() != crowded && now >= crowded_pace_.next()) {
    crowded_pace_.note_done(now);
    crowding_ = from;
  }
  if (taken != RecordStore::Taken::newer) return;
  if (store_.is_near(part->said.hub)) map_changed_ = true;
  flood(part, from);
}

/// Is that hub at the other end of another link, which carries? It alone is believed about itself
/// then.
bool NetworkState::has_own_word(LinkNumber from, const proto::HubKey& hub) const {
  const auto found = links_.find(from);
  const bool is_its_own = found != links_.end() && found->second.facts.peer.key == hub;
  if (is_its_own || !store_.is_linked(hub)) return false;
  return std::ranges::any_of(links_, [&hub](const auto& each) {
    return each.second.has_mark && each.second.facts.peer.key == hub;
  });
}

/// Passes it to the hub that it is of, and to no other: that hub goes on behind it. Hubs further
/// away would keep an invented one otherwise.
void NetworkState::refuse(LinkNumber from, const PartRef& part, std::chrono::milliseconds now) {
  const proto::HubKey& hub = part->said.hub;
  const StoredRecord* record = store_.find(hub);
  const PartRef known = record == nullptr ? nullptr : record->part(part->said.part);
  if (known != nullptr && !is_newer(*part, *known)) return;
  ++hearsay_;
  for (auto& [number, link] : links_) {
    if (link.facts.peer.key != hub) continue;
    send(number, part);
    const bool is_newest = link.refused == nullptr || is_newer(*part, *link.refused);
    if (part->said.part != 0 || !is_newest) continue;
    link.refused = part;
    link.refused_from = from;
  }
  const std::uint64_t lead = part->said.sequence - (known == nullptr ? 0 : known->said.sequence);
  if (lead <= kHonestLead || now < forgery_pace_.next()) return;
  forgery_pace_.note_done(now);
  forgery_ = {from, hub, lead};
}

void NetworkState::take_mark(LinkNumber number) {
  if (Link* link = find(number); link != nullptr && !link->has_mark)
    link->has_mark = links_changed_ = map_changed_ = true;
}

void NetworkState::take_digest(LinkNumber number, std::uint64_t digest,
                               std::chrono::milliseconds now) {
  Link* link = find(number);
  if (link == nullptr || !link->has_mark) return;
  if (digest == store_.digest()) {
    link->differs_since.reset();
    link->repair_pause = kRepairPauses.first;
  } else if (!link->differs_since) {
    link->differs_since = now;
  } else if (now - *link->differs_since >= link->repair_pause) {
    link->differs_since = now;
    link->repair_pause = std::min(2 * link->repair_pause, kRepairPauses.most);
    for (const PartRef& part : store_.reachable()) send(number, part);
  }
}

void NetworkState::set_cost(LinkNumber number, std::uint16_t cost) {
  GIMNET_ASSERT(cost > 0);
  Link* link = find(number);
  if (link == nullptr || link->facts.cost == cost) return;
  link->facts.cost = cost;
  links_changed_ = map_changed_ = true;
}

void NetworkState::set_damped(LinkNumber number, bool damped) {
  Link* link = find(number);
  if (link == nullptr || link->damped == damped) return;
  link->damped = damped;
  links_changed_ = map_changed_ = true;
}

void NetworkState::end_link(LinkNumber number) {
  const auto ended = links_.extract(number);
  if (ended.empty()) return;
  note_links();
  // Its hub may have started again, or was one of two copies: others know more of it now.
  if (ended.mapped().refused != nullptr)
    heard_again_.emplace_back(ended.mapped().refused_from, ended.mapped().refused);
  // Before the pause is over: frames under way go by another link, if there is one.
  map_ = NetworkMap(own_.identity(), store_, carrying_links());
  ++maps_;
  reachable_changed_ = true;
}

void NetworkState::note_links() {
  links_changed_ = true;
  std::vector<proto::HubKey> peers;
  for (const auto& [number, link] : links_) peers.push_back(link.facts.peer.key);
  std::ranges::sort(peers);
  store_.set_linked(std::move(peers));
}

void NetworkState::leave() {
  links_.clear();
  heard_again_.clear();
  note_links();
  sendings_.clear();
  own_.forget_copy();
  map_ = NetworkMap(own_.identity());
  ++maps_;
  reachable_changed_ = true;
}

void NetworkState::renumber(HubId hub) {
  GIMNET_CHECK(links_.empty());
  own_.renumber(hub);
  map_ = NetworkMap(own_.identity());
  ++maps_;
  map_changed_ = true;
}

HubId NetworkState::draw_hub_id(std::uint64_t random) const {
  std::vector<std::uint16_t> free;
  auto next = store_.records().lower_bound(proto::HubKey{HubId{kDrawnFrom}, {}});
  for (std::uint16_t id = kDrawnFrom; id <= kHubIdMax; ++id) {
    while (next != store_.records().end() && next->first.hub.value() < id) ++next;
    if (next == store_.records().end() || next->first.hub.value() != id) free.push_back(id);
  }
  // All taken: some of those records are of hubs that are gone.
  if (free.empty()) return HubId{kDrawnFrom};
  return HubId{free[random % free.size()]};
}

void NetworkState::advance(std::chrono::milliseconds now) {
  for (const auto& [from, part] : std::exchange(heard_again_, {})) take(from, part, now);
  for (auto& [number, link] : links_) {
    for (const PartRef& part : link.pace.take_due(now)) take(number, part, now);
  }
  if (links_changed_) {
    links_changed_ = false;
    std::vector<proto::route::Neighbour> neighbours;
    for (const CarryingLink& each : carrying_links()) neighbours.push_back(each.neighbour);
    for (auto& each : neighbours)
      if (ends_) each.cost = LinkCost::kMost;
    own_.set_neighbours(neighbours);
  }
  say_own(now);
  if (map_changed_ && now >= next_map_at_) compute_map(now);
  if (std::exchange(reachable_changed_, false)) store_.set_reachable(map_.reachable(), now);
  if (now >= forget_pace_.next()) {
    forget_pace_.note_done(now);
    store_.forget(now);
  }
}

void NetworkState::say_own(std::chrono::milliseconds now) {
  for (const PartRef& part : own_.take_due(now)) {
    store_.put_own(part);
    flood(part, LinkNumber{});
  }
}

void NetworkState::compute_map(std::chrono::milliseconds now) {
  map_changed_ = false;
  next_map_at_ = now + kMapPause * (1 + store_.bytes() / (1024 * 1024));
  map_ = NetworkMap(own_.identity(), store_, carrying_links());
  ++maps_;
  reachable_changed_ = true;
}

std::optional<std::chrono::milliseconds> NetworkState::next_due() const {
  auto due = own_.next_due();
  const auto note = [&due](std::chrono::milliseconds time) {
    due = std::min(due.value_or(time), time);
  };
  if (map_changed_) note(next_map_at_);
  if (links_changed_ || reachable_changed_ || !heard_again_.empty())
    note(std::chrono::milliseconds::min());
  for (const auto& [number, link] : links_) {
    if (const auto waits = link.pace.next_due()) note(*waits);
  }
  return due;
}

Verdict NetworkState::verdict() const {
  if (own_.living_copy()) return Verdict::copied;
  return map_.own_id_holder() ? Verdict::id_taken : Verdict::stay;
}

void NetworkState::send(LinkNumber link, const PartRef& part) {
  sendings_.push_back({link, std::shared_ptr<const proto::Payload>(part, &part->bytes)});
}

void NetworkState::flood(const PartRef& part, LinkNumber except) {
  for (const auto& [number, link] : links_) {
    if (number != except) send(number, part);
  }
}

bool NetworkState::carries_rather(const Link& link, const Link& than) const {
  using Rank = std::tuple<std::uint16_t, const proto::HubKey&, const std::string&>;
  const auto rank = [this](const Link& each) {
    const auto& dialler = each.facts.dialled ? own_.identity().key : each.facts.peer.key;
    return Rank(each.cost(), dialler, each.facts.name);
  };
  return rank(link) < rank(than);
}

std::vector<CarryingLink> NetworkState::carrying_links() const {
  std::map<proto::HubKey, std::pair<LinkNumber, const Link*>> best;
  for (const auto& [number, link] : links_) {
    if (!link.has_mark) continue;
    const auto [found, is_new] = best.try_emplace(link.facts.peer.key, number, &link);
    if (!is_new && carries_rather(link, *found->second.second)) found->second = {number, &link};
  }
  std::vector<CarryingLink> carrying;
  for (const auto& [hub, link] : best) carrying.push_back({{hub, link.second->cost()}, link.first});
  return carrying;
}

}  // namespace gimnet::hub
