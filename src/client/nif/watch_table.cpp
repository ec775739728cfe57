#include "client/nif/watch_table.hpp"

#include <algorithm>
#include <memory>
#include <utility>

#include "client/nif/answer_status.hpp"
#include "client/nif/inbound.hpp"
#include "client/nif/record_list.hpp"

namespace gimnet::nif {

namespace ns = proto::ns;

namespace {

/// The memory that nif_incoming.watched points to.
struct OwnedChange final : WatchedChange {
  explicit OwnedChange(const ns::WatchEvents& events, const ns::Change& told) : change(told) {
    view.watch = events.watch;
    view.change = static_cast<std::uint32_t>(change.kind);
    view.hub_id = events.hub.value();
    view.epoch = events.epoch;
    view.version = change.version;
    view.former_name = change.former_name.c_str();
    if (change.node) {
      node = view_of(*change.node);
      view.node = &node;
    }
    if (change.service) {
      service = view_of(*change.service);
      view.service = &service;
    }
  }
  ns::Change change;
  nif_node_record node{};
  nif_service_record service{};
};

}  // namespace

Record* make_watched(const ns::WatchEvents& events, const ns::Change& change) {
  std::unique_ptr<Record> record(make_event(NIF_WATCHED, ""));
  record->watched = std::make_unique<OwnedChange>(events, change);
  record->watched->view.last = &change == &events.changes.back() ? 1 : 0;
  record->finish();
  return record.release();
}

WatchTable::~WatchTable() {
  for (const Item& item : events_) item.storage->release();
}

ns::Watch WatchTable::add(std::string pattern, std::uint8_t subjects, bool by_hand) {
  const MutexLock lock(mutex_);
  do {
    ++last_number_;
  } while (last_number_ == 0 || watches_.contains(last_number_));
  ns::Watch request;
  request.watch = last_number_;
  request.pattern = std::move(pattern);
  request.subjects = subjects;
  watches_.emplace(last_number_, Watch{.request = request, .by_hand = by_hand});
  return request;
}

ns::Watch WatchTable::again(std::uint32_t number) {
  const MutexLock lock(mutex_);
  const auto found = watches_.find(number);
  if (found == watches_.end()) return {};
  found->second.request.epoch = found->second.request.version = 0;
  found->second.has_begun = false;
  return found->second.request;
}

bool WatchTable::remove(std::uint32_t number) {
  const MutexLock lock(mutex_);
  return watches_.erase(number) > 0;
}

bool WatchTable::on_events(const ns::WatchEvents& events) {
  bool by_hand = false;
  const bool wanted = follows(events, by_hand);
  if (!wanted || !by_hand) taken(events.watch);
  return wanted;
}

bool WatchTable::tell_taken(std::uint32_t number, std::uint32_t frames) {
  // It is a request like all others to the hub, so it has a number that is counted until the
  // answer, which says nothing.
  return requests_.ask_later(proto::Kind::ns, proto::encode(ns::WatchTaken{number, frames}),
                             [](const proto::Payload&) {});
}

void WatchTable::taken(std::uint32_t number) {
  const MutexLock lock(mutex_);
  const auto found = watches_.find(number);
  // Of a watch that ended here and not yet at the hub: where no number is free, the hub may go
  // without.
  if (found == watches_.end()) return static_cast<void>(tell_taken(number, 1));
  Watch& watch = found->second;
  ++watch.untold;
  if (tell_taken(number, watch.untold)) watch.untold = 0;
}

void WatchTable::tell_all_taken() {
  const MutexLock lock(mutex_);
  for (auto& [number, watch] : watches_) {
    if (watch.untold == 0) continue;
    if (!tell_taken(number, watch.untold)) return;
    watch.untold = 0;
  }
}

bool WatchTable::follows(const ns::WatchEvents& events, bool& by_hand) {
  {
    const MutexLock lock(mutex_);
    const auto found = watches_.find(events.watch);
    if (found == watches_.end()) return false;
    Watch& watch = found->second;
    by_hand = watch.by_hand;
    const bool begins =
        !events.changes.empty() && events.changes.front().kind == ns::ChangeKind::begin;
    const bool continues = watch.has_begun && events.epoch == watch.request.epoch &&
                           events.after == watch.request.version;
    if (begins || continues) {
      watch.has_begun = true;
      watch.request.epoch = events.epoch;
      watch.request.version = events.version;
      return true;
    }
    if (!watch.has_begun) return false;
    watch.has_begun = false;
    watch.request.epoch = watch.request.version = 0;
  }
  if (std::ranges::find(due_, events.watch) == due_.end()) due_.push_back(events.watch);
  go_on();
  return false;
}

void WatchTable::declare_again() {
  due_.clear();
  {
    const MutexLock lock(mutex_);
    for (auto& [number, watch] : watches_) {
      due_.push_back(number);
      watch.untold = 0;  // what was under way ended with the connection
    }
  }
  go_on();
}

void WatchTable::go_on() {
  while (!due_.empty() && declare(due_.front())) due_.pop_front();
  tell_all_taken();
}

bool WatchTable::declare(std::uint32_t number) {
  ns::Watch request;
  {
    const MutexLock lock(mutex_);
    const auto found = watches_.find(number);
    if (found == watches_.end()) return true;  // ended meanwhile
    request = found->second.request;
  }
  return requests_.ask_later(
      proto::Kind::ns, proto::encode(request),
      [this, number](const proto::Payload& payload) { on_answer(number, payload); });
}

void WatchTable::on_answer(std::uint32_t number, const proto::Payload& payload) {
  const auto answer = proto::decode_answer<ns::WatchAnswer>(payload);
  if (answer || !remove(number)) return;
  ns::WatchEvents events;
  events.watch = number;
  events.changes.resize(1);
  events.changes[0].kind = static_cast<ns::ChangeKind>(NIF_WATCH_ENDED);
  Record* record = make_watched(events, events.changes[0]);
  record->text = answer.error().sentence;
  record->incoming.reason = static_cast<std::uint32_t>(status_of(answer.error().status));
  record->finish();
  events_.push_back(item_of(record, record->text.size()));
}

std::vector<Item> WatchTable::take_events() { return std::exchange(events_, {}); }

}  // namespace gimnet::nif
