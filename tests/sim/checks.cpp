#include "tests/sim/checks.hpp"

#include <algorithm>
#include <set>

namespace gimnet::sim {

namespace ns = proto::ns;
using hub::NodePlace;

namespace {

/// A conductor that pauses may be so late.
constexpr milliseconds kLate{3'000};

bool changes_groups(std::uint16_t answer) {
  return answer == ns::AdvertiseAnswer::kOperation || answer == ns::WithdrawAnswer::kOperation ||
         answer == ns::SubscribeAnswer::kOperation || answer == ns::UnsubscribeAnswer::kOperation;
}

std::string text_of(const DueEvent& event) {
  const bool moved = event.operation == ns::ServiceMoved::kOperation;
  return "to node " + std::to_string(event.to) + ": " + (moved ? "SERVICE_MOVED" : "SUBSCRIBERS") +
         " of '" + event.name + "'";
}

}  // namespace

void Checks::before_it_leaves(ShardIndex shard, const hub::ShardCommand& command) {
  if (conductor_ == nullptr || !out_of_order_.empty()) return;
  if (const auto* attach = std::get_if<hub::AttachCommand>(&command)) {
    const NodePlace place = subject_.nodes.find(index_of(attach->node));
    if (place.generation != attach->session.generation)
      out_of_order_ = "WELCOME leaves before its node is published";
  } else if (const auto* control = std::get_if<hub::SendControlCommand>(&command)) {
    const auto view = proto::split_control(std::span{control->frame}.subspan(proto::kHeaderSize));
    if (control->answers != 0 && changes_groups(view->header.operation)) out_of_order_ = stale();
  } else if (const auto* released = std::get_if<hub::ReleaseCommand>(&command)) {
    for (const auto& [index, place] : places_) {
      const bool same = place.shard == shard && place.generation == released->session.generation &&
                        place.slot == released->session.slot;
      if (same && subject_.nodes.find(index).generation == place.generation) {
        out_of_order_ = "a session is released before its node is taken out of the table";
      }
    }
  }
}

std::string Checks::stale() const {
  for (const auto& [group, topic] : conductor_->membership().topics().groups()) {
    const hub::GroupMembers* members = subject_.groups.find(group.value());
    std::size_t count = 0;
    for (std::size_t i = 0; members != nullptr && i < members->by_shard.size(); ++i) {
      count += members->by_shard[i].size();
      if (!members->paced_by_shard.empty()) count += members->paced_by_shard[i].size();
    }
    const bool all_joined = conductor_->tells_later() || count == topic->subscribers.size();
    if (members == nullptr || !all_joined) {
      return "an answer leaves before the table of groups is right";
    }
  }
  return {};
}

void Checks::after_drain() const {
  std::vector<std::size_t> told(subject_.shards.shards());
  for (const SimShards::Sent& sent : subject_.shards.sent()) {
    if (std::holds_alternative<hub::DrainCommand>(*sent.command)) ++told[sent.shard.value()];
  }
  const bool once =
      std::all_of(told.begin(), told.end(), [](std::size_t times) { return times == 1; });
  require(once, Checker::drain, "the hub drains, and a shard is not told to have its nodes leave");
}

void Checks::after_step(milliseconds now) {
  ++steps_;
  touched_ = model_.take_touched();
  sessions();
  names();
  node_table();
  group_table();
  if (!out_of_order_.empty()) broken(Checker::order, out_of_order_);
  events();
  commands();
  paces();
  deadline(now);
  require(conductor_->drain_wanted() == model_.drain_wanted(), Checker::drain,
          "the hub is to drain, and no administrator asked for it, or the reverse");
}

std::vector<DueEvent> Checks::told_events() const {
  std::vector<DueEvent> told;
  for (const SimShards::Sent& sent : subject_.shards.sent()) {
    const auto* control = std::get_if<hub::SendControlCommand>(sent.command);
    if (control == nullptr || control->answers != 0) continue;
    const proto::Payload payload(control->frame.begin() + proto::kHeaderSize, control->frame.end());
    const std::uint32_t to = index_of(NodeId{proto::load_header(control->frame.data()).dst});
    const std::uint16_t operation = proto::split_control(payload)->header.operation;
    if (operation == ns::ServiceMoved::kOperation) {
      told.push_back({to, operation, told_moved(payload, to)});
    } else if (operation == ns::Subscribers::kOperation) {
      told.push_back({to, operation, told_subscribers(payload)});
    }
  }
  std::sort(told.begin(), told.end());
  told.erase(std::unique(told.begin(), told.end()), told.end());
  return told;
}

void Checks::events() {
  told_again();
  const std::vector<DueEvent> told = told_events();
  for (const auto& [former, present] : model_.take_renumbered()) {
    if (auto place = places_.extract(former); !place.empty()) {
      place.key() = present;
      places_.insert(std::move(place));
    }
  }
  const std::vector<DueEvent> due = model_.take_due();
  owed_.insert(owed_.end(), due.begin(), due.end());
  std::sort(owed_.begin(), owed_.end());
  for (const DueEvent& event : told) {
    const bool again = tells_later_ && event.operation == ns::ServiceMoved::kOperation;
    if (!again && !std::binary_search(owed_.begin(), owed_.end(), event))
      broken(Checker::events, "told for nothing " + text_of(event));
  }
  std::erase_if(owed_, [&](const DueEvent& event) {
    return std::binary_search(told.begin(), told.end(), event) || !may_wait(event);
  });
  tells_later_ = conductor_->tells_later();
  for (const DueEvent& event : owed_) {
    if (!tells_later_ || event.operation != ns::ServiceMoved::kOperation)
      broken(Checker::events, "not told " + text_of(event));
  }
}

bool Checks::may_wait(const DueEvent& event) const {
  if (event.operation != ns::ServiceMoved::kOperation) return true;
  const Model::Topic* topic = model_.topic(event.name);
  const auto session = model_.sessions().find(event.to);
  return topic != nullptr && topic->subscribers.contains(event.to) &&
         session != model_.sessions().end() && session->second.connected;
}

void Checks::told_again() const {
  for (const SimShards::Sent& sent : subject_.shards.sent()) {
    const auto* again = std::get_if<hub::TellAgainCommand>(sent.command);
    if (again == nullptr) continue;
    for (const Bytes& frame : split_frames(again->frames)) {
      const proto::Payload payload(frame.begin() + proto::kHeaderSize, frame.end());
      if (proto::split_control(payload)->header.operation == ns::ServiceMoved::kOperation) {
        static_cast<void>(
            told_moved(payload, index_of(NodeId{proto::load_header(frame.data()).dst})));
      } else {
        static_cast<void>(told_subscribers(payload));
      }
    }
  }
}

/// An event tells the present state. Returns the service's name.
std::string Checks::told_moved(const proto::Payload& payload, std::uint32_t to) const {
  auto event = proto::decode<ns::ServiceMoved>(payload);
  if (!event) broken(Checker::events, "an event cannot be read: " + event.error().sentence);
  const Model::Topic* topic = model_.topic(event->name);
  require(topic != nullptr && topic->subscribers.contains(to), Checker::events,
          "a node is told of a service that it did not subscribe to");
  require((event->session != 0) == (event->provider != NodeId{}), Checker::events,
          "SERVICE_MOVED names a provider without its session, or the reverse");
  event->session = 0;  // the hub's own number
  if (static_cast<const ns::ServiceState&>(*event) != model_.state_of(*topic, to))
    broken(Checker::events, "SERVICE_MOVED tells of '" + event->name + "' what is not so");
  return event->name;
}

std::string Checks::told_subscribers(const proto::Payload& payload) const {
  const auto event = proto::decode<ns::Subscribers>(payload);
  if (!event) broken(Checker::events, "an event cannot be read: " + event.error().sentence);
  const auto group = model_.groups().find(index_of(event->group));
  require(group != model_.groups().end(), Checker::events, "SUBSCRIBERS is of no service");
  require(event->subscribers == group->second->second.subscribers.size(), Checker::events,
          "SUBSCRIBERS tells a wrong number");
  return group->second->first;
}

void Checks::sessions() const {
  const auto& all = conductor_->membership().sessions().all();
  require(all.size() <= subject_.limits.nodes + subject_.limits.administrators, Checker::limits,
          "the hub has more nodes than its limit");
  auto actual = all.begin();
  for (const auto& [index, expected] : model_.sessions()) {
    if (actual != all.end() && actual->first.value() < index) break;
    if (actual == all.end() || actual->first.value() != index) {
      broken(Checker::grace, "the session of node " + std::to_string(index) + " is gone too early");
    }
    if (actual->second.connected != expected.connected) {
      broken(Checker::grace,
             "node " + std::to_string(index) + " counts as " +
                 (expected.connected ? "away, and is connected" : "connected, and is away"));
    }
    ++actual;
  }
  if (actual != all.end()) {
    broken(Checker::grace,
           "the session of node " + std::to_string(actual->first.value()) + " ought to be over");
  }
}

void Checks::names() const {
  const hub::Membership& membership = conductor_->membership();
  std::size_t named = 0;
  auto expected = model_.sessions().begin();
  for (const auto& [node, session] : membership.sessions().all()) {
    const std::uint32_t index = node.value();
    const std::string& name = (expected++)->second.name;
    if (session.name != name) {
      broken(Checker::names, "node " + std::to_string(index) + " has the name '" +
                                 session.name.str() + "', not '" + name + "'");
    }
    if (name.empty()) continue;
    ++named;
    if (membership.directory().find(name) != node) {
      broken(Checker::names, "the directory says of '" + name + "' another owner than node " +
                                 std::to_string(index));
    }
  }
  require(membership.directory().size() == named, Checker::names,
          "the directory has a name that nobody has");
}

void Checks::node_table() const {
  const auto& all = conductor_->membership().sessions().all();
  for (const auto& [index, session] : all) {
    const NodePlace place = subject_.nodes.find(index.value());
    const hub::Place& right = session.place;
    if (!place.exists())
      broken(Checker::node_table, "the table lacks node " + std::to_string(index.value()));
    require(place.shard == right.shard && place.slot == right.slot &&
                place.generation == right.generation,
            Checker::node_table, "the table has a node in another place than it is");
  }
  for (const std::uint32_t index : model_.nodes_given()) {
    if (subject_.nodes.find(index).exists() && !all.contains(NodeIndex{index})) {
      broken(Checker::node_table,
             "the table has node " + std::to_string(index) + ", which is not there");
    }
  }
}

bool Checks::is_right(const hub::GroupMembers* members, const Model::Topic* topic) const {
  if (topic == nullptr || members == nullptr) return topic == nullptr && members == nullptr;
  if (index_of(members->provider) != topic->service->provider) return false;
  if (!(members->provider_place == subject_.nodes.find(topic->service->provider))) return false;
  if (members->accepts != (topic->service->terms.direction == proto::ns::Direction::accepts))
    return false;
  std::size_t count = 0;
  for (const auto& list : members->by_shard) count += list.size();
  for (const auto& list : members->paced_by_shard) count += list.size();
  // Those that have yet to be told have yet to join.
  if (conductor_->tells_later()) return count <= topic->subscribers.size();
  if (count != topic->subscribers.size()) return false;
  return std::all_of(
      topic->subscribers.begin(), topic->subscribers.end(), [&](const auto& subscriber) {
        const NodePlace place = subject_.nodes.find(subscriber.first);
        if (!Model::pace_of(*topic, subscriber.first)) {
          const hub::GroupMember* member = members->by_shard[place.shard.value()].find(place.slot);
          return member != nullptr && member->generation == place.generation;
        }
        if (members->paced_by_shard.empty()) return false;
        const hub::PacedMember* member =
            members->paced_by_shard[place.shard.value()].find(place.slot);
        return member != nullptr && member->generation == place.generation &&
               member->was_plain == subscriber.second.once_plain;
      });
}

void Checks::group_table() {
  // All of them now and then, in case that something changes with nobody asking for it.
  constexpr std::uint64_t kWhole = 32;
  const bool whole = steps_ % kWhole == 0;
  for (const auto& [group, topic] : model_.groups()) {
    const hub::GroupMembers* members = subject_.groups.find(group);
    const hub::GroupMembers*& seen = seen_[group];
    if (!whole && seen == members && !touched_.contains(group)) continue;
    seen = conductor_->tells_later() ? nullptr : members;
    if (!is_right(members, &topic->second)) {
      broken(Checker::group_table, "the table is wrong about group " + std::to_string(group) +
                                       ", '" + topic->first + "'");
    }
  }
  const auto gone = [this](std::uint32_t group) {
    const hub::GroupMembers* members = subject_.groups.find(group);
    if (members != nullptr && !model_.groups().contains(group)) {
      broken(Checker::group_table,
             "the table has group " + std::to_string(group) + ", which stands for nothing");
    }
  };
  for (const std::uint32_t group : touched_) gone(group);
  if (!whole) return;
  for (const std::uint32_t group : model_.groups_given()) gone(group);
}

void Checks::commands() {
  std::set<std::uint32_t> released;
  for (const SimShards::Sent& sent : subject_.shards.sent()) {
    if (const auto* attach = std::get_if<hub::AttachCommand>(sent.command)) {
      places_[index_of(attach->node)] = {sent.shard, attach->session.slot,
                                         attach->session.generation};
    } else if (const auto* release = std::get_if<hub::ReleaseCommand>(sent.command)) {
      require(released.insert(release->session.generation).second, Checker::seam,
              "a session is released twice");
    }
  }
  for (const std::uint32_t index : model_.take_ended()) {
    const auto entry = places_.find(index);
    if (released.erase(entry->second.generation) == 0) {
      broken(Checker::seam, "the shard of node " + std::to_string(index) +
                                " is not told that its session is over");
    }
    // It may have an heir in the same step.
    if (!model_.sessions().contains(index)) places_.erase(entry);
  }
  require(released.empty(), Checker::seam,
          "a session is released that goes on, or that no shard was given");
}

void Checks::deadline(milliseconds now) const {
  const std::optional<milliseconds> due = model_.next_deadline();
  if (!due) return;
  const std::optional<milliseconds> next = conductor_->next_deadline();
  require(next.has_value() && *next <= *due, Checker::grace,
          "the conductor does not want to wake when a time runs out");
  require(*due + kLate > now, Checker::grace, "a time ran out long ago, and nothing came of it");
}

}  // namespace gimnet::sim
