#include "hub/control/state/watches.hpp"

#include <algorithm>

#include "base/log.hpp"
#include "hub/control/state/listing.hpp"

namespace gimnet::hub {
namespace {

using proto::Status;
using std::chrono::milliseconds;
namespace ns = proto::ns;

/// No change is longer: a page that has more room than this takes one more.
constexpr std::size_t kChangeBytesMax = 6 * 1024;
/// No record is shorter: how many fill a page, which takes none once a longest change might not
/// fit.
constexpr std::size_t kRecordBytesLeast = 32;

/// The first of this hub's own that has an id behind `last`.
template <class Map, class Id>
auto own_behind(const Map& all, HubId hub, Id last) {
  if (hub_of(last) > hub) return all.end();
  if (hub_of(last) < hub) return all.begin();
  return all.upper_bound(typename Map::key_type{index_of(last)});
}

}  // namespace

Watches::Watches(HubTitle hub, std::uint64_t epoch, const Limits& limits)
    : hub_(std::move(hub)), limits_(limits), journal_(epoch, limits) {}

void Watches::note(const NodeNoted& noted, const Membership& membership, milliseconds now) {
  // Also of one that was ended while it was connected, whose connection ends for nobody.
  if (noted.kind == ns::ChangeKind::left) connection_ended(noted.index);
  if (!journal_.keeps()) return journal_.pass();
  ns::Change change;
  change.kind = noted.kind;
  change.former_name = noted.former_name;
  const Session* session =
      noted.kind == ns::ChangeKind::left ? nullptr : membership.sessions().find(noted.index);
  if (session != nullptr) {
    change.node = record_of(hub_, *session, membership.services(), now);
  } else {
    change.node.emplace();
    change.node->node = make_id(hub_.id, noted.index);
    change.node->hub = hub_.id;
    change.node->name = noted.name;
  }
  journal_.add(std::move(change));
}

void Watches::note(const ServiceNoted& noted, const Membership& membership, milliseconds /*now*/) {
  if (!journal_.keeps()) return journal_.pass();
  ns::Change change;
  change.kind = noted.kind;
  const Topic* topic = noted.kind == ns::ChangeKind::withdrawn
                           ? nullptr
                           : membership.topics().find_group(noted.group);
  if (topic != nullptr) {
    change.service = record_of(hub_, *topic);
  } else {
    change.service.emplace();
    change.service->group = make_id(hub_.id, noted.group);
    change.service->node = make_id(hub_.id, noted.provider);
    change.service->name = noted.full_name;
  }
  journal_.add(std::move(change));
}

void Watches::note(const NameChange& noted) {
  if (!journal_.keeps()) return journal_.pass();
  journal_.add(change_of(noted, names_->hub_name(noted.hub)));
}

Result<ns::WatchAnswer, proto::Refusal> Watches::watch(NodeIndex node, const ns::Watch& wanted) {
  if (wanted.watch == 0)
    return proto::Refusal{Status::bad_request, "a watch has a number other than 0"};
  Watch watch;
  watch.number = wanted.watch;
  watch.subjects = wanted.subjects;
  if (!wanted.pattern.empty()) watch.pattern = proto::Pattern::parse(wanted.pattern);
  if (!wanted.pattern.empty() && !watch.pattern) {
    return proto::Refusal{Status::bad_request,
                          "'" + escaped(wanted.pattern, kQuotedMax) +
                              "' is no pattern: write a name of at most 16 parts and 255 bytes in "
                              "which a part may be * or **"};
  }
  Watcher& watcher = watchers_[node];
  const auto old = std::ranges::find(watcher.watches, wanted.watch, &Watch::number);
  if (old == watcher.watches.end() &&
      (watcher.watches.size() >= limits_.watches_per_node || watches_ >= limits_.watches)) {
    const bool own = watcher.watches.size() >= limits_.watches_per_node;
    if (watcher.watches.empty()) watchers_.erase(node);
    const std::string limit = own ? "watches_per_node" : "watches";
    const std::string who = own ? "a node" : "this hub";
    return proto::Refusal{Status::limit,
                          who + " has as many watches as it may have (" +
                              std::to_string(own ? limits_.watches_per_node : limits_.watches) +
                              "); end one first, or start the hub with a larger --limit " + limit};
  }
  journal_.begin();
  const bool goes_on = wanted.epoch == journal_.epoch() && journal_.reaches(wanted.version);
  if (goes_on) {
    watch.phase = Phase::live;
    watch.seen = watch.told = wanted.version;
  }
  if (old != watcher.watches.end()) {
    watch.under_way = old->under_way;  // what is on its way will be answered
    *old = std::move(watch);
  } else {
    watcher.watches.push_back(std::move(watch));
    ++watches_;
  }
  return ns::WatchAnswer{!goes_on};
}

std::optional<proto::Refusal> Watches::unwatch(NodeIndex node, std::uint32_t number) {
  const auto unknown = [number] {
    return proto::Refusal{Status::not_found, "this node has no watch " + std::to_string(number)};
  };
  const auto found = watchers_.find(node);
  if (found == watchers_.end()) return unknown();
  Watcher& watcher = found->second;
  const auto watch = std::ranges::find(watcher.watches, number, &Watch::number);
  if (watch == watcher.watches.end()) return unknown();
  watcher.under_way -= watch->under_way;
  watcher.watches.erase(watch);
  --watches_;
  if (watcher.watches.empty()) watchers_.erase(found);
  return std::nullopt;
}

void Watches::taken(NodeIndex node, const ns::WatchTaken& taken) {
  const auto found = watchers_.find(node);
  if (found == watchers_.end()) return;
  const auto watch = std::ranges::find(found->second.watches, taken.watch, &Watch::number);
  if (watch == found->second.watches.end()) return;
  const std::size_t frames = std::min<std::size_t>(taken.frames, watch->under_way);
  watch->under_way -= frames;
  found->second.under_way -= frames;
}

void Watches::start_over(NodeIndex node) {
  const auto found = watchers_.find(node);
  if (found == watchers_.end()) return;
  found->second.under_way = 0;
  for (Watch& watch : found->second.watches) {
    watch.phase = Phase::begin;
    watch.under_way = 0;
  }
}

void Watches::connection_ended(NodeIndex node) {
  const auto found = watchers_.find(node);
  if (found == watchers_.end()) return;
  watches_ -= found->second.watches.size();
  watchers_.erase(found);
}

bool Watches::serve(const Membership& membership, milliseconds now, const Send& send) {
  Turn turn{membership, now, limits_.scan_records};
  for (std::size_t left = watchers_.size(); left > 0; --left) {
    auto next = watchers_.upper_bound(last_served_);
    if (next == watchers_.end()) next = watchers_.begin();
    last_served_ = next->first;
    if (serve_one(next->first, next->second, turn, send)) return true;
  }
  return false;
}

/// True: the work for this turn is done, and this node has more.
bool Watches::serve_one(NodeIndex node, Watcher& watcher, Turn& turn, const Send& send) {
  for (std::size_t idle = 0; idle < watcher.watches.size();) {
    watcher.next = (watcher.next + 1) % watcher.watches.size();
    Watch& watch = watcher.watches[watcher.next];
    if (is_idle(watcher, watch)) {
      ++idle;
      continue;
    }
    if (turn.work == 0) return true;
    idle = 0;
    Page page = next_page(watch, turn);
    if (page.empty()) continue;
    ++watcher.under_way;
    ++watch.under_way;
    send(node, finish(watch, std::move(page)));
  }
  return false;
}

bool Watches::is_full(const Page& page) const {
  return page.bytes.size() + kChangeBytesMax >= limits_.watch_event_bytes;
}

/// Nothing to tell, or not the time to tell it.
bool Watches::is_idle(const Watcher& watcher, const Watch& watch) const {
  if (watch.phase == Phase::live && watch.seen == journal_.version()) return true;
  if (watch.under_way == 0) return false;
  return watch.under_way >= limits_.watch_window ||
         watcher.under_way >= limits_.watch_window_per_node;
}

void Watches::begin(Watch& watch) {
  watch.phase = Phase::nodes;
  watch.last_node = {};
  watch.last_group = {};
  watch.few = true;
  watch.seen = watch.told = journal_.version();
}

/// The changes of what the snapshot has shown come before more of it is shown: so what is shown is
/// true at once, and what was not shown yet need not be told of.
Watches::Page Watches::next_page(Watch& watch, Turn& turn) {
  Page page;
  if (watch.phase != Phase::begin && !journal_.reaches(watch.seen)) {
    ++resyncs_;
    watch.phase = Phase::begin;
  }
  if (watch.phase == Phase::begin) {
    begin(watch);
    add_mark(ns::ChangeKind::begin, page);
  }
  add_changes(watch, page, turn);
  if (watch.seen != journal_.version()) return page;
  if (watch.phase == Phase::nodes) add_nodes(watch, page, turn);
  if (watch.phase == Phase::services) add_services(watch, page, turn);
  if (watch.phase == Phase::end && !page.full) {
    add_mark(ns::ChangeKind::end, page);
    watch.phase = Phase::live;
  }
  return page;
}

void Watches::add_changes(Watch& watch, Page& page, Turn& turn) const {
  for (; watch.seen != journal_.version() && turn.work > 0 && !page.full; --turn.work) {
    const Journal::Note& note = journal_.at(++watch.seen);
    if (!wants(watch, note)) continue;
    page.bytes.insert(page.bytes.end(), note.bytes.begin(), note.bytes.end());
    page.full = is_full(page);
  }
}

void Watches::add_nodes(Watch& watch, Page& page, Turn& turn) const {
  if ((watch.subjects & ns::kWatchNodes) == 0) return next_phase(watch);
  if (add_few(watch, page, turn)) return;
  add_by_id(
      watch, page, turn, watch.last_node, turn.membership.sessions().all(),
      [this](NodeId last) { return names_->node_after(last); },
      [&](const Session& session) {
        if (fits(watch, session.name)) add_node(session, page, turn);
      });
}

void Watches::add_services(Watch& watch, Page& page, Turn& turn) const {
  if ((watch.subjects & ns::kWatchServices) == 0) return next_phase(watch);
  if (add_few(watch, page, turn)) return;
  add_by_id(
      watch, page, turn, watch.last_group, turn.membership.topics().groups(),
      [this](GroupId last) { return names_->group_after(last); },
      [&](const Topic* topic) {
        if (topic->provided() && fits(watch, topic->full_name)) add_service(*topic, page);
      });
}

template <class Id, class Own, class Behind, class Add>
void Watches::add_by_id(Watch& watch, Page& page, Turn& turn, Id& last, const Own& all,
                        Behind behind, Add add_own) const {
  for (; turn.work > 0 && !page.full; --turn.work) {
    const auto own = own_behind(all, hub_.id, last);
    auto other = names_ == nullptr ? std::nullopt : behind(last);
    if (other && other->hub == hub_.id) other = behind(make_id<Id>(hub_.id, kIndexMask));
    if (own != all.end() && (!other || make_id(hub_.id, own->first) < id_of<Id>(*other))) {
      last = make_id(hub_.id, own->first);
      add_own(own->second);
    } else if (other) {
      last = id_of<Id>(*other);
      if (fits(watch, other->name)) add_other(*other, page);
    } else {
      return next_phase(watch);
    }
  }
}

bool Watches::add_few(Watch& watch, Page& page, Turn& turn) const {
  if (!watch.few || !watch.pattern || names_ != nullptr) return false;
  if (page.full || turn.work == 0) return true;  // at another time
  const std::size_t records = (limits_.watch_event_bytes - kChangeBytesMax) / kRecordBytesLeast;
  const proto::Pattern* const pattern = &*watch.pattern;
  const std::size_t work = limits_.scan_records;
  if (watch.phase == Phase::nodes) {
    const auto listed = list_few_nodes(
        turn.membership, {pattern, node_index_of(watch.last_node), false, records, work});
    return add_listed(watch, page, turn, listed, [&](NodeIndex index) {
      watch.last_node = make_id(hub_.id, index);
      add_node(*turn.membership.sessions().find(index), page, turn);
    });
  }
  const Topics& topics = turn.membership.topics();
  const auto listed =
      list_few_services(topics, {pattern, group_index_of(watch.last_group), false, records, work});
  return add_listed(watch, page, turn, listed, [&](GroupIndex index) {
    watch.last_group = make_id(hub_.id, index);
    add_service(*topics.find_group(index), page);
  });
}

template <class List, class Add>
bool Watches::add_listed(Watch& watch, Page& page, Turn& turn, const std::optional<List>& listed,
                         Add add) {
  watch.few = listed.has_value();
  if (!listed) return false;
  turn.work -= std::min(turn.work, listed->looked_at);
  for (const auto index : listed->indices) {
    if (page.full) return true;
    add(index);
  }
  if (!listed->more) next_phase(watch);
  return true;
}

void Watches::next_phase(Watch& watch) {
  watch.phase = watch.phase == Phase::nodes ? Phase::services : Phase::end;
  watch.few = true;
}

void Watches::add_node(const Session& session, Page& page, const Turn& turn) const {
  ns::Change change;
  change.kind = ns::ChangeKind::present;
  change.version = journal_.version();
  change.node = record_of(hub_, session, turn.membership.services(), turn.now);
  add(change, page);
}

void Watches::add_service(const Topic& topic, Page& page) const {
  ns::Change change;
  change.kind = ns::ChangeKind::present;
  change.version = journal_.version();
  change.service = record_of(hub_, topic);
  add(change, page);
}

void Watches::add_other(const KnownName& known, Page& page) const {
  ns::Change change = change_of(ns::ChangeKind::present, known);
  change.version = journal_.version();
  add(change, page);
}

void Watches::add_mark(ns::ChangeKind kind, Page& page) const {
  ns::Change change;
  change.kind = kind;
  change.version = journal_.version();
  add(change, page);
}

void Watches::add(const ns::Change& change, Page& page) const {
  proto::bitestream::Writer writer;
  ns::write_change(writer, change);
  page.bytes.insert(page.bytes.end(), writer.bytes().begin(), writer.bytes().end());
  page.full = is_full(page);
}

proto::Payload Watches::finish(Watch& watch, Page page) const {
  ns::WatchEvents head;
  head.watch = watch.number;
  head.hub = hub_.id;
  head.epoch = journal_.epoch();
  head.after = watch.told;
  head.version = watch.told = watch.seen;
  proto::bitestream::Writer writer;
  head.write_head(writer);
  proto::Payload payload =
      proto::assemble_control({ns::WatchEvents::kOperation, proto::kNoRequest}, writer);
  // A Bitestream is a row of values: the changes go before the head, as WatchEvents::write() has
  // them.
  payload.insert(payload.begin() + proto::kControlHeaderSize, page.bytes.begin(), page.bytes.end());
  return payload;
}

bool Watches::wants(const Watch& watch, const Journal::Note& note) {
  const NodeId* const node = std::get_if<NodeId>(&note.subject);
  const GroupId* const group = std::get_if<GroupId>(&note.subject);
  if ((watch.subjects & (group != nullptr ? ns::kWatchServices : ns::kWatchNodes)) == 0)
    return false;
  // The snapshot will show the names that it has not reached yet as they are then.
  if (watch.phase == Phase::nodes && (node == nullptr || *node > watch.last_node)) return false;
  if (watch.phase == Phase::services && group != nullptr && *group > watch.last_group) return false;
  return fits(watch, note.name) || (!note.former_name.empty() && fits(watch, note.former_name));
}

bool Watches::fits(const Watch& watch, std::string_view name) {
  return !watch.pattern || (!name.empty() && watch.pattern->matches(name));
}

}  // namespace gimnet::hub
