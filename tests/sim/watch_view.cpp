#include "tests/sim/watch_view.hpp"

namespace gimnet::sim {

namespace ns = proto::ns;
using ns::ChangeKind;

ns::Watch WatchView::request(std::uint32_t number) const {
  ns::Watch watch;
  watch.watch = number;
  if (!complete_) return watch;
  watch.epoch = epoch_;
  watch.version = version_;
  return watch;
}

void WatchView::take(const ns::WatchEvents& events, Census& census) {
  const bool begins = !events.changes.empty() && events.changes.front().kind == ChangeKind::begin;
  if (!begins) {
    require(!awaits_snapshot_, Checker::events, "a watch does not begin with the snapshot that it was promised");
    require(events.epoch == epoch_ && events.after == version_, Checker::events, "a watch is told changes with a gap");
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
    census.add(Happening::watch_snapshot);
  } else if (change.node) {
    census.add(Happening::watch_change);
    if (change.kind == ChangeKind::left) {
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

void WatchView::require_agreed(const Model& model) const {
  require(complete_ && !awaits_snapshot_, Checker::convergence, "a snapshot does not come to its end");
  require(nodes_.size() == model.sessions().size(), Checker::convergence, "a watch knows other nodes than there are");
  for (const auto& [index, session] : model.sessions()) {
    const auto found = nodes_.find(index);
    if (found == nodes_.end() || found->second.name != session.name || found->second.connected != session.connected) {
      broken(Checker::convergence, "a watch is wrong about node " + std::to_string(index));
    }
  }
  require(services_.size() == model.groups().size(), Checker::convergence,
          "a watch knows other services than there are");
  for (const auto& [group, topic] : model.groups()) {
    const auto found = services_.find(group);
    if (found == services_.end() || found->second.name != topic->first ||
        index_of(found->second.node) != topic->second.service->provider ||
        found->second.metadata != topic->second.service->terms.metadata) {
      broken(Checker::convergence, "a watch is wrong about the service '" + topic->first + "'");
    }
  }
}

}  // namespace gimnet::sim
