#include "hub/network/state/name_copies.hpp"

#include <algorithm>

#include "base/check.hpp"

namespace gimnet::hub {
namespace {

namespace route = proto::route;
using route::NameClaim;
using route::NameState;
using std::chrono::milliseconds;

/// Of a record in NAMES, besides the text: heads and numbers of a node's name, and of a service.
constexpr std::size_t kNodeRecordBytes = 64;
constexpr std::size_t kServiceRecordBytes = 144;
/// The rest of NAMES.
constexpr std::size_t kHeadBytes = 128;

std::size_t record_bytes(std::string_view name, const NameClaim& claim) {
  return name.size() + (claim.service ? kServiceRecordBytes : kNodeRecordBytes);
}

}  // namespace

NameCopies::NameCopies(const Options& options) : options_(options) {
  copies_[options.self.hub].instance = options.self.instance;
}

NameCopies::Copy* NameCopies::find_copy(const HubRun& run) {
  const auto found = copies_.find(run.hub);
  return found != copies_.end() && found->second.instance == run.instance ? &found->second
                                                                          : nullptr;
}

KnownName NameCopies::known_name(const NameIndex::Claims::value_type& entry) const {
  const auto& [key, claim] = entry;
  const Copy& copy = copies_.at(key.hub);
  KnownName known{key.name, key.hub, copy.hub_name, &claim, proto::ns::NameStanding::held, {}};
  const bool former = claim.version == 0;
  if (former || copy.unreachable_until) {
    known.standing = proto::ns::NameStanding::unreachable;
    known.until = former && copy.former_until ? *copy.former_until : *copy.unreachable_until;
  } else if (claim.state == NameState::away) {
    known.standing = proto::ns::NameStanding::away;
  }
  return known;
}

void NameCopies::put_own(std::string_view name, const NameClaim& claim) {
  Copy& copy = own();
  NameClaim next = claim;
  next.rank = rank_for(name, claim.node);
  // A node has one name, and a group one full name.
  if (const auto other = index_.holder(claim); other && (*other)->first.name != name)
    remove_own(std::string{(*other)->first.name});
  if (const auto known = index_.find(name, options_.self.hub)) {
    next.version = (*known)->second.version;
    if (next == (*known)->second) return;
  }
  next.version = ++copy.version;
  put(options_.self.hub, copy, name, next);
}

void NameCopies::remove_own(std::string_view name) {
  const auto known = index_.find(name, options_.self.hub);
  if (!known || (*known)->second.state == NameState::deleted) return;
  Copy& copy = own();
  NameClaim mark;
  mark.version = ++copy.version;
  mark.state = NameState::deleted;
  put(options_.self.hub, copy, name, mark);
}

std::uint32_t NameCopies::rank_for(std::string_view name, NodeId node) const {
  std::int64_t over = route::kOrdinaryRank - 1;
  std::int64_t below = std::int64_t{1} << 32;  // no claim has that rank
  for (const auto& entry : index_.claims_to(name)) {
    const auto& [key, claim] = entry;
    if (claim.state == NameState::deleted) continue;
    if (claim.node == node) return claim.rank;
    const auto standing = known_name(entry).standing;
    if (standing == proto::ns::NameStanding::unreachable) {
      below = std::min<std::int64_t>(below, claim.rank);
    } else if (key.hub == options_.self.hub || standing == proto::ns::NameStanding::away) {
      over = std::max<std::int64_t>(over, claim.rank);
    }
  }
  return static_cast<std::uint32_t>(std::max<std::int64_t>(0, std::min(over + 1, below - 1)));
}

void NameCopies::renumber(HubId hub) {
  const std::uint64_t version = own().version;
  drop(options_.self.hub);
  drop(hub);
  options_.self.hub = hub;
  Copy& copy = copies_[hub];
  copy.instance = options_.self.instance;
  // Hubs that knew the id as another process's see another instance. Those that knew this process
  // do not know the id.
  copy.version = copy.forgotten = version;
  lost_.clear();
}

std::vector<KnownName> NameCopies::take_lost() {
  std::vector<KnownName> lost;
  for (const std::string& name : std::exchange(lost_, {})) {
    if (const auto winner = winner_over_own(name)) lost.push_back(*winner);
  }
  return lost;
}

std::vector<HubId> NameCopies::set_reachable(std::span<const HubRun> hubs, milliseconds now) {
  GIMNET_ASSERT(std::ranges::is_sorted(hubs));
  for (auto& [hub, copy] : copies_) {
    const auto found = std::ranges::lower_bound(hubs, hub, {}, &HubRun::hub);
    const bool reachable = found != hubs.end() && found->hub == hub;
    if (hub != options_.self.hub && !reachable && !copy.unreachable_until)
      copy.unreachable_until = now + options_.grace;
  }
  std::vector<HubId> begun;
  for (const HubRun& run : hubs) {
    if (run.hub == options_.self.hub) continue;
    const auto [found, is_new] = copies_.try_emplace(run.hub);
    Copy& copy = found->second;
    if (is_new) {
      copy.instance = run.instance;
    } else if (copy.instance != run.instance) {
      begin_anew(run.hub, copy, run.instance, now);
    } else if (!copy.unreachable_until) {
      continue;
    } else {
      copy.stale = copy.version;
      copy.stale_until = now + kCatchUp;
    }
    copy.unreachable_until.reset();
    begun.push_back(run.hub);
  }
  return begun;
}

/// The names of the process before stay for the grace time, so that its nodes find them free when
/// they come back.
void NameCopies::begin_anew(HubId hub, Copy& copy, proto::HubInstance instance, milliseconds now) {
  drop_former(hub, copy);
  for (const std::uint64_t version : std::set<std::uint64_t>(copy.marks))
    erase(copy, copy.by_version.at(version));
  for (const auto& [version, place] : copy.by_version) place->second.version = 0;
  const auto since = copy.unreachable_until.value_or(now + options_.grace);
  copy = {};
  copy.instance = instance;
  copy.former_until = since;
}

void NameCopies::drop_former(HubId hub, Copy& copy) {
  if (!copy.former_until) return;
  copy.former_until.reset();
  ++dropped_copies_;
  for (const Place& place : index_.live_of(hub)) {
    if (place->second.version == 0) erase(copy, place);
  }
}

void NameCopies::drop(HubId hub) {
  const auto found = copies_.find(hub);
  if (found == copies_.end()) return;
  Copy& copy = found->second;
  drop_former(hub, copy);
  while (!copy.by_version.empty()) erase(copy, copy.by_version.begin()->second);
  copies_.erase(found);
  ++dropped_copies_;
}

void NameCopies::note_let_go(std::string_view name, HubId hub) {
  const auto known = hub == options_.self.hub ? std::nullopt : index_.find(name, hub);
  if (known && (*known)->second.state == NameState::held) (*known)->second.state = NameState::away;
}

void NameCopies::set_hub_name(HubId hub, std::string_view name) {
  const auto found = copies_.find(hub);
  if (found != copies_.end() && found->second.hub_name != name) found->second.hub_name = name;
}

bool NameCopies::forget(milliseconds now) {
  const auto dropped = dropped_copies_;
  std::vector<HubId> gone;
  for (auto& [hub, copy] : copies_) {
    if (copy.unreachable_until && *copy.unreachable_until <= now) {
      gone.push_back(hub);
    } else if (copy.former_until && *copy.former_until <= now) {
      drop_former(hub, copy);
    }
    if (!copy.stale_until || *copy.stale_until > now) continue;
    copy.stale_until.reset();
    for (const Place& place : index_.live_of(hub)) compare_with_own(place->first.name);
  }
  for (const HubId hub : gone) drop(hub);
  return dropped != dropped_copies_;
}

std::optional<milliseconds> NameCopies::next_due() const {
  std::optional<milliseconds> due;
  for (const auto& [hub, copy] : copies_) {
    for (const auto& each : {copy.unreachable_until, copy.former_until, copy.stale_until}) {
      if (each) due = std::min(due.value_or(*each), *each);
    }
  }
  return due;
}

/// It has at most half of all, whatever it sends, so that others have room.
bool NameCopies::has_room(HubId hub, std::size_t bytes) const {
  return counts_of(hub).bytes + bytes <= options_.bytes_max / 2 &&
         bytes_of_others() + bytes <= options_.bytes_max;
}

NameCopies::Taken NameCopies::take(const route::Names& names) {
  Copy* copy = names.hub == options_.self.hub ? nullptr : find_copy({names.hub, names.instance});
  if (copy == nullptr || names.after > copy->version) return Taken::known;
  std::size_t growth = 0;
  for (const route::NameRecord& each : names.records) {
    if (!index_.find(each.name, names.hub)) growth += NameIndex::count_of(each.name);
  }
  if (growth > 0 && !has_room(names.hub, growth)) {
    copy->starved = true;
    ++refused_;
    return Taken::full;
  }
  // A name in this range that the copy has and the message does not was changed since, or deleted.
  std::vector<std::uint64_t> stale;
  for (auto each = copy->by_version.upper_bound(names.after);
       each != copy->by_version.end() && each->first <= names.version; ++each)
    stale.push_back(each->first);
  const auto version_of = [](const route::NameRecord& each) { return each.claim.version; };
  for (const route::NameRecord& each : names.records) put(names.hub, *copy, each.name, each.claim);
  for (const std::uint64_t version : stale) {
    const auto found = copy->by_version.find(version);
    if (found == copy->by_version.end()) continue;
    if (std::ranges::binary_search(names.records, version, {}, version_of)) continue;
    remove(*copy, found->second);
  }
  if (names.after < names.forgotten) copy->forgotten = std::max(copy->forgotten, names.forgotten);
  const bool newer = names.version > copy->version;
  copy->version = std::max(copy->version, names.version);
  return newer ? Taken::changed : Taken::known;
}

void NameCopies::put(HubId hub, Copy& copy, std::string_view name, const NameClaim& claim) {
  const auto known = index_.find(name, hub);
  if (known && (*known)->second.version >= claim.version) return;
  const bool live = claim.state != NameState::deleted;
  if (live && !evict(copy, name, claim)) return;
  // A hub that lies may have given one version to two names.
  if (const auto same = copy.by_version.find(claim.version);
      same != copy.by_version.end() && same->second->first.name != name)
    remove(copy, same->second);
  std::optional<NameClaim> before;
  if (known) {
    before = (*known)->second;
    forget_version(copy, *before);
  }
  const Place place = index_.put(name, hub, claim);
  copy.by_version[claim.version] = place;
  if (!live) copy.marks.insert(claim.version);
  if (hub != options_.self.hub) note_change(place, before);
  // Also an own claim that was granted while a better one was under way.
  if (live) compare_with_own(name);
  forget_marks(copy);
}

bool NameCopies::evict(Copy& copy, std::string_view name, const NameClaim& claim) {
  const auto other = index_.holder(claim);
  if (!other || (*other)->first.name == name) return true;
  if ((*other)->second.version > claim.version) return false;
  remove(copy, *other);
  return true;
}

void NameCopies::remove(Copy& copy, Place place) {
  const auto& [key, claim] = *place;
  if (claim.state != NameState::deleted)
    changes_.push_back({key.name, key.hub, claim, std::nullopt});
  erase(copy, place);
}

void NameCopies::forget_marks(Copy& copy) {
  while (copy.marks.size() > kMarksLeast + (copy.by_version.size() - copy.marks.size())) {
    const std::uint64_t oldest = *copy.marks.begin();
    copy.forgotten = std::max(copy.forgotten, oldest);
    erase(copy, copy.by_version.at(oldest));
  }
}

/// Services go with the names of their nodes.
bool NameCopies::is_lost_to(const KnownName& other) const {
  const auto mine = index_.find(other.name, options_.self.hub);
  if (!mine || other.hub == options_.self.hub ||
      other.standing == proto::ns::NameStanding::unreachable)
    return false;
  const NameClaim& claim = (*mine)->second;
  if (claim.state == NameState::deleted || (claim.service && other.claim->service)) return false;
  const Copy& copy = copies_.at(other.hub);
  if (copy.stale_until && other.claim->version <= copy.stale) return false;
  return wins(*other.claim, claim);
}

void NameCopies::compare_with_own(std::string_view name) {
  if (winner_over_own(name)) lost_.emplace(name);
}

void NameCopies::note_change(Place place, std::optional<NameClaim> before) {
  if (before && before->state == NameState::deleted) before.reset();
  const bool live = place->second.state != NameState::deleted;
  if (!before && !live) return;
  changes_.push_back({place->first.name, place->first.hub, before,
                      live ? std::optional{place->second} : std::nullopt});
}

std::optional<route::Names> NameCopies::next(HubId hub, NamesPosition& at) const {
  const auto found = copies_.find(hub);
  if (found == copies_.end()) return std::nullopt;
  const Copy& copy = found->second;
  if (copy.instance != at.instance || copy.unreachable_until) return std::nullopt;
  // It may have names of which the marks are gone: the whole copy, once for all that are gone now.
  if (at.version < copy.forgotten && at.forgotten != copy.forgotten) {
    at.version = 0;
    at.forgotten = copy.forgotten;
  }
  if (at.version >= copy.version) return std::nullopt;
  route::Names names{hub, at.instance, at.version, copy.version, copy.forgotten, {}};
  std::size_t bytes = kHeadBytes;
  for (auto each = copy.by_version.upper_bound(at.version); each != copy.by_version.end(); ++each) {
    const auto& [key, claim] = *each->second;
    bytes += record_bytes(key.name, claim);
    if (bytes > route::kNamesBytesMax) {
      names.version = names.records.back().claim.version;
      break;
    }
    names.records.push_back({key.name, claim});
  }
  at.version = names.version;
  return names;
}

std::vector<route::NamesKnown::Entry> NameCopies::known() const {
  std::vector<route::NamesKnown::Entry> entries;
  for (const auto& [hub, copy] : copies_) {
    if (const auto entry = known(hub)) entries.push_back(*entry);
  }
  return entries;
}

std::optional<route::NamesKnown::Entry> NameCopies::known(HubId hub) const {
  const auto found = copies_.find(hub);
  if (found == copies_.end() || hub == options_.self.hub || found->second.unreachable_until)
    return std::nullopt;
  return route::NamesKnown::Entry{hub, found->second.instance, found->second.version};
}

/// Room is an eighth of all, so that a copy that does not fit is not asked for again and again.
std::vector<HubId> NameCopies::take_starved() {
  std::vector<HubId> starved;
  for (auto& [hub, copy] : copies_) {
    if (!copy.starved || !has_room(hub, options_.bytes_max / 8)) continue;
    copy.starved = false;
    starved.push_back(hub);
  }
  return starved;
}

HubId NameCopies::largest() const {
  HubId largest{};
  for (const auto& [hub, copy] : copies_) {
    if (hub == options_.self.hub) continue;
    if (largest == HubId{} || counts_of(hub).bytes > counts_of(largest).bytes) largest = hub;
  }
  return largest;
}

std::optional<KnownName> NameCopies::winner_over_own(std::string_view name) const {
  return best_of(name, [this](const KnownName& known) { return is_lost_to(known); });
}

std::optional<KnownName> NameCopies::find(std::string_view name) const {
  return best_of(name, [](const KnownName&) { return true; });
}

}  // namespace gimnet::hub
