#include "fuzz/hub/control/support/watch_view.hpp"

#include "fuzz/support/fuzz_input.hpp"
#include "proto/control/names.hpp"

namespace gimnet::fuzz {

namespace ns = proto::ns;
using ns::ChangeKind;

namespace {

constexpr std::uint32_t kUnderWayMost = 4;

bool is_snapshot(ChangeKind kind) {
  return kind == ChangeKind::begin || kind == ChangeKind::present || kind == ChangeKind::end;
}

}  // namespace

bool WatchView::wants(std::uint8_t subject, const std::string& name) const {
  if ((wanted_.subjects & subject) == 0) return false;
  return wanted_.pattern.empty() || (!name.empty() && proto::matches(wanted_.pattern, name));
}

void WatchView::take(const ns::WatchEvents& events) {
  FUZZ_MUST(events.epoch != 0 && !events.changes.empty());
  FUZZ_MUST(++under_way_ <= kUnderWayMost);
  const bool begins = events.changes.front().kind == ChangeKind::begin;
  if (!begins) {
    FUZZ_MUST(!awaits_snapshot_);
    const std::uint64_t epoch = told_ ? epoch_ : wanted_.epoch;
    const std::uint64_t version = told_ ? version_ : wanted_.version;
    FUZZ_MUST(events.epoch == epoch && events.after == version);
  }
  awaits_snapshot_ = false;
  told_ = true;
  FUZZ_MUST(events.version >= events.after);
  last_change_ = events.after;
  for (const ns::Change& change : events.changes) take_one(change, events);
  epoch_ = events.epoch;
  version_ = events.version;
}

void WatchView::take_one(const ns::Change& change, const ns::WatchEvents& events) {
  FUZZ_MUST(change.version <= events.version);
  if (!is_snapshot(change.kind)) {
    // Each change once, in order.
    FUZZ_MUST(change.version > last_change_);
    last_change_ = change.version;
  }
  switch (change.kind) {
    case ChangeKind::begin:
      FUZZ_MUST(&change == &events.changes.front());
      nodes_.clear();
      services_.clear();
      complete_ = false;
      began_ = true;
      return;
    case ChangeKind::end:
      FUZZ_MUST(began_);
      began_ = false;
      complete_ = true;
      return;
    default:
      if (change.kind == ChangeKind::present) FUZZ_MUST(began_);
      FUZZ_MUST(change.node.has_value() != change.service.has_value());
      if (change.node) return take_node(change);
      take_service(change);
  }
}

void WatchView::take_node(const ns::Change& change) {
  const ns::NodeRecord& node = *change.node;
  const std::uint32_t index = index_of(node.node);
  const bool fits = wants(ns::kWatchNodes, node.name);
  FUZZ_MUST(fits || wants(ns::kWatchNodes, change.former_name));
  if (change.kind == ChangeKind::present) FUZZ_MUST(!nodes_.contains(index));
  if (change.kind == ChangeKind::left || !fits) {
    nodes_.erase(index);
  } else {
    nodes_[index] = node;
  }
}

void WatchView::take_service(const ns::Change& change) {
  const ns::ServiceRecord& service = *change.service;
  const std::uint32_t index = index_of(service.group);
  FUZZ_MUST(wants(ns::kWatchServices, service.name));
  if (change.kind == ChangeKind::present) FUZZ_MUST(!services_.contains(index));
  if (change.kind == ChangeKind::withdrawn) {
    services_.erase(index);
  } else {
    services_[index] = service;
  }
}

}  // namespace gimnet::fuzz
