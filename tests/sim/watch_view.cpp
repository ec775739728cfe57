#include "tests/sim/watch_view.hpp"

#include "proto/control/names.hpp"

namespace gimnet::sim {

namespace ns = proto::ns;
using ns::ChangeKind;

ns::Watch WatchView::request(std::uint32_t number) const {
  ns::Watch watch;
  watch.watch = number;
  watch.pattern = pattern_;
  watch.subjects = subjects_;
  if (!complete_) return watch;
  watch.epoch = epoch_;
  watch.version = version_;
  return watch;
}

void WatchView::take(const ns::WatchEvents& events, Census& census) {
  const bool begins = !events.changes.empty() && events.changes.front().kind == ChangeKind::begin;
  if (!begins) {
    require(!awaits_snapshot_, Checker::events,
            "a watch does not begin with the snapshot that it was promised");
    require(events.epoch == epoch_ && events.after == version_, Checker::events,
            "a watch is told changes with a gap");
  } else if (!awaits_snapshot_ && complete_) {
    census.add(Happening::watch_began_again);
  }
  awaits_snapshot_ = false;
  epoch_ = events.epoch;
  version_ = events.version;
  for (const ns::Change& change : events.changes) take_one(change, census);
}

void WatchView::take_one(const ns::Change& change, Census& census) {
  if (change.kind == ChangeKind::begin) {
    nodes_.clear();
    services_.clear();
    complete_ = false;
  } else if (change.kind == ChangeKind::end) {
    complete_ = true;
    census.add(pattern_.empty() ? Happening::watch_snapshot : Happening::watch_snapshot_by_pattern);
  } else if (change.node) {
    census.add(Happening::watch_change);
    // One that was renamed may fit no more.
    if (change.kind == ChangeKind::left || !fits(change.node->name)) {
      nodes_.erase(index_of(change.node->node));
    } else {
      nodes_[index_of(change.node->node)] = *change.node;
    }
  } else if (change.service) {
    if (change.kind == ChangeKind::withdrawn) {
      services_.erase(index_of(change.service->group));
    } else {
      services_[index_of(change.service->group)] = *change.service;
    }
  }
}

bool WatchView::fits(const std::string& name) const {
  return pattern_.empty() || (!name.empty() && proto::matches(pattern_, name));
}

void WatchView::require_agreed(const Model& model) const {
  require(complete_ && !awaits_snapshot_, Checker::convergence,
          "a snapshot does not come to its end");
  require_nodes(model);
  require_services(model);
}

void WatchView::require_nodes(const Model& model) const {
  std::size_t due = 0;
  for (const auto& [index, session] : model.sessions()) {
    if ((subjects_ & ns::kWatchNodes) == 0 || !fits(session.name)) continue;
    ++due;
    const auto found = nodes_.find(index);
    if (found == nodes_.end() || found->second.name != session.name ||
        found->second.connected != session.connected) {
      broken(Checker::convergence, "a watch is wrong about node " + std::to_string(index));
    }
  }
  require(nodes_.size() == due, Checker::convergence, "a watch knows other nodes than there are");
}

void WatchView::require_services(const Model& model) const {
  std::size_t due = 0;
  for (const auto& [group, topic] : model.groups()) {
    if ((subjects_ & ns::kWatchServices) == 0 || !fits(topic->first)) continue;
    if (!topic->second.service->provided()) continue;
    ++due;
    const auto found = services_.find(group);
    if (found == services_.end() || found->second.name != topic->first ||
        index_of(found->second.node) != topic->second.service->provider ||
        found->second.metadata != topic->second.service->terms.metadata) {
      broken(Checker::convergence, "a watch is wrong about the service '" + topic->first + "'");
    }
  }
  require(services_.size() == due, Checker::convergence,
          "a watch knows other services than there are");
}

}  // namespace gimnet::sim
