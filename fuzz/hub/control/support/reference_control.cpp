#include <algorithm>

#include "base/log.hpp"
#include "fuzz/hub/control/support/reference.hpp"
#include "fuzz/support/fuzz_input.hpp"
#include "hub/control/counter_names.hpp"
#include "proto/control/ctrl.hpp"
#include "proto/control/names.hpp"

// HubCtrl of the reference: who may, and what has to follow.

namespace gimnet::fuzz {

using proto::Kind;
using proto::Role;
using proto::Status;
using proto::ns::ChangeKind;
namespace ns = proto::ns;
namespace ctrl = proto::ctrl;

namespace {

template <class Id>
std::optional<std::uint32_t> own_index(Id id) {
  if (hub_of(id) == ControlHub::kHub || hub_of(id) == kOwnHub) return index_of(id);
  return std::nullopt;
}

bool changes_the_hub(std::uint16_t operation) {
  return operation == ctrl::Kick::kOperation || operation == ctrl::Reassign::kOperation ||
         operation == ctrl::Drain::kOperation || operation == ctrl::Reload::kOperation ||
         operation == ctrl::SetLogLevel::kOperation;
}

/// A request without a body of its own.
template <class Message>
bool readable(std::span<const std::byte> payload, std::span<const std::byte> answer) {
  const bool fits = proto::decode<Message>(payload).has_value();
  require_status(answer, fits ? Status::done : Status::bad_request);
  return fits;
}

}  // namespace

void Reference::dispatch_control(const Asked& asked, std::uint16_t operation) {
  if (changes_the_hub(operation) && asked.session.role != Role::admin) {
    return require_status(asked.answer, Status::denied);
  }
  switch (operation) {
    case ctrl::HubInfo::kOperation:
      return on_hub_info(asked);
    case ctrl::Statistics::kOperation:
      return on_statistics(asked);
    case ctrl::Connections::kOperation:
      return on_connections(asked);
    case ctrl::Routes::kOperation:
      return on_routes(asked);
    case ctrl::Kick::kOperation:
      return on_kick(asked);
    case ctrl::Reassign::kOperation:
      return on_reassign(asked);
    case ctrl::Drain::kOperation:
      return on_drain(asked);
    case ctrl::Reload::kOperation:
      return on_reload(asked);
    case ctrl::SetLogLevel::kOperation:
      return on_log_level(asked);
    default:
      require_status(asked.answer, Status::not_supported);
  }
}

// ---- questions

void Reference::on_hub_info(const Asked& asked) const {
  if (!readable<ctrl::HubInfo>(asked.payload, asked.answer)) return;
  const auto answer = proto::decode_answer<ctrl::HubInfoAnswer>(asked.answer);
  FUZZ_MUST(answer && answer->hub == ControlHub::kHub && answer->hub_name == "fuzzed" &&
            answer->version == "0");
  FUZZ_MUST(answer->shards == ControlHub::kShards && answer->nodes == sessions_.size());
  FUZZ_MUST(answer->services == groups_.size());
  FUZZ_MUST(answer->uptime_ms == static_cast<std::uint64_t>(asked.hub.now.count()));
}

void Reference::on_statistics(const Asked& asked) const {
  if (!readable<ctrl::Statistics>(asked.payload, asked.answer)) return;
  const auto answer = proto::decode_answer<ctrl::StatisticsAnswer>(asked.answer);
  FUZZ_MUST(answer && answer->shards.size() >= ControlHub::kShards);
  std::map<std::string, std::uint64_t> due;
  for (const auto& [asked_kind, count] : asked_) {
    const auto [kind, operation] = asked_kind;
    const bool about_names = kind == Kind::ns;
    const char* name =
        about_names ? ns::operation_name(operation) : ctrl::operation_name(operation);
    due[(about_names ? "names." : "ctrl.") + std::string{name != nullptr ? name : "unknown"}] +=
        count;
  }
  std::map<std::string, std::uint64_t> said;
  for (const ctrl::ShardRecord& record : answer->shards) {
    if (record.shard != ctrl::kConductorRecord) continue;
    for (const ctrl::Counter& counter : record.counters) said[counter.name] = counter.value;
  }
  for (const auto& [name, count] : due) FUZZ_MUST(said.contains(name) && said.at(name) == count);
}

void Reference::on_connections(const Asked& asked) const {
  const auto wanted = proto::decode<ctrl::Connections>(asked.payload);
  if (!wanted) return require_status(asked.answer, Status::bad_request);
  require_status(asked.answer, Status::done);
  const auto answer = proto::decode_answer<ctrl::ConnectionsAnswer>(asked.answer);
  const std::size_t room = std::clamp<std::size_t>(wanted->records_max, 1, limits_.page_records);
  FUZZ_MUST(answer && answer->connections.size() <= room);
  auto entry = by_index_.upper_bound(index_of(wanted->after));
  for (const ctrl::ConnectionRecord& record : answer->connections) {
    FUZZ_MUST(entry != by_index_.end() && record.node == id_of(entry->first));
    const Session& session = sessions_.at(entry->second);
    FUZZ_MUST(record.name == session.name && record.connected == session.connected &&
              record.peer == session.place && record.shard == session.seat.shard &&
              record.transport == "tcp");
    ++entry;
  }
  FUZZ_MUST(answer->more == (entry != by_index_.end()) &&
            (!answer->more || answer->connections.size() == room));
}

void Reference::on_routes(const Asked& asked) const {
  if (!readable<ctrl::Routes>(asked.payload, asked.answer)) return;
  const auto answer = proto::decode_answer<ctrl::RoutesAnswer>(asked.answer);
  FUZZ_MUST(answer && answer->routes.size() == 1);
  const ctrl::RouteRecord& own = answer->routes.front();
  FUZZ_MUST(own.hub == ControlHub::kHub && own.next_hop == ControlHub::kHub && own.cost == 0);
  FUZZ_MUST(own.nodes == sessions_.size());
}

void Reference::on_list(const Asked& asked) const {
  const auto wanted = proto::decode<ns::List>(asked.payload);
  const bool legal = wanted && (wanted->pattern.empty() || proto::valid_pattern(wanted->pattern));
  if (!legal) return require_status(asked.answer, Status::bad_request);
  require_status(asked.answer, Status::done);
  const auto answer = proto::decode_answer<ns::ListAnswer>(asked.answer);
  const std::size_t room = std::clamp<std::size_t>(wanted->records_max, 1, limits_.page_records);
  FUZZ_MUST(answer && answer->nodes.size() <= room);
  // A page speaks of all up to where the next one begins.
  const std::uint32_t last = answer->more ? index_of(answer->next) : UINT32_MAX;
  FUZZ_MUST(last > index_of(wanted->after));
  auto record = answer->nodes.begin();
  for (auto entry = by_index_.upper_bound(index_of(wanted->after));
       entry != by_index_.end() && entry->first <= last; ++entry) {
    const Session& session = sessions_.at(entry->second);
    if (!wanted->pattern.empty() && !proto::matches(wanted->pattern, session.name)) continue;
    if (wanted->connected_only && !session.connected) continue;
    FUZZ_MUST(record != answer->nodes.end());
    FUZZ_MUST(record->node == id_of(entry->first) && record->name == session.name &&
              record->place == session.place);
    FUZZ_MUST(record->connected == session.connected && record->description == session.description);
    FUZZ_MUST(record->services == session.provides.size());
    FUZZ_MUST(record->joined_ms ==
              static_cast<std::uint64_t>((asked.hub.now - session.joined).count()));
    ++record;
  }
  FUZZ_MUST(record == answer->nodes.end());
}

void Reference::on_services(const Asked& asked) const {
  const auto wanted = proto::decode<ns::Services>(asked.payload);
  const bool legal = wanted && (wanted->pattern.empty() || proto::valid_pattern(wanted->pattern));
  if (!legal) return require_status(asked.answer, Status::bad_request);
  require_status(asked.answer, Status::done);
  const auto answer = proto::decode_answer<ns::ServicesAnswer>(asked.answer);
  const std::size_t room = std::clamp<std::size_t>(wanted->records_max, 1, limits_.page_records);
  FUZZ_MUST(answer && answer->services.size() <= room);
  const std::uint32_t last = answer->more ? index_of(answer->next) : UINT32_MAX;
  FUZZ_MUST(last > index_of(wanted->after));
  auto record = answer->services.begin();
  for (auto entry = groups_.upper_bound(index_of(wanted->after));
       entry != groups_.end() && entry->first <= last; ++entry) {
    if (!wanted->pattern.empty() && !proto::matches(wanted->pattern, entry->second)) continue;
    const Topic& topic = topics_.at(entry->second);
    const ns::Advertise& terms = topic.service->terms;
    FUZZ_MUST(record != answer->services.end());
    FUZZ_MUST(record->group == group_id(entry->first) && record->name == entry->second);
    FUZZ_MUST(record->node == id_of(sessions_.at(topic.service->provider).index));
    FUZZ_MUST(record->message_type == terms.message_type && record->instance == terms.instance);
    FUZZ_MUST(record->direction == terms.direction && record->delivery == terms.delivery);
    FUZZ_MUST(record->metadata == terms.metadata && record->retain == terms.retain);
    FUZZ_MUST(record->subscribers == topic.subscribers.size());
    const std::uint32_t window =
        terms.delivery == ns::Delivery::sync ? std::max(1u, terms.window) : 0;
    FUZZ_MUST(record->window == window);
    ++record;
  }
  FUZZ_MUST(record == answer->services.end());
}

// ---- changes

void Reference::on_kick(const Asked& asked) {
  const auto wanted = proto::decode<ctrl::Kick>(asked.payload);
  if (!wanted) return require_status(asked.answer, Status::bad_request);
  const std::optional<std::uint32_t> index = own_index(wanted->node);
  const std::uint64_t id = index ? holder_of(*index) : 0;
  if (id == 0) return require_status(asked.answer, Status::not_found);
  if (id == asked.id) return require_status(asked.answer, Status::bad_request);
  require_status(asked.answer, Status::done);
  const Session& session = sessions_.at(id);
  closed_[session.seat] = proto::GoodbyeCode::kicked;
  spend_tokens(session);
  end(id, asked.hub.now);
}

void Reference::on_reassign(const Asked& asked) {
  const auto wanted = proto::decode<ctrl::Reassign>(asked.payload);
  if (!wanted) return require_status(asked.answer, Status::bad_request);
  const std::optional<std::uint32_t> index = own_index(wanted->node);
  const std::uint64_t id = index ? holder_of(*index) : 0;
  if (id == 0) return require_status(asked.answer, Status::not_found);
  const std::optional<std::uint32_t> target = own_index(wanted->new_node);
  const bool legal = target && id != asked.id && *target != kHubIndex && *target < kEveryIndex;
  if (!legal) return require_status(asked.answer, Status::bad_request);
  const bool free = !by_index_.contains(*target) &&
                    is_free(resting_nodes_, *target, asked.hub.now) && !sessions_.at(id).renumbered;
  require_status(asked.answer, free ? Status::done : Status::taken);
  if (free) renumber(id, *target, asked.hub.now);
}

void Reference::renumber(std::uint64_t id, std::uint32_t index, milliseconds now) {
  Session& session = sessions_.at(id);
  const std::uint32_t former = session.index;
  note_node(ChangeKind::left, session);
  moved_.erase(index);
  moved_[former] = {id, session.number};
  by_index_.erase(former);
  by_index_[index] = id;
  resting_nodes_[former] = rests_until(now);
  resting_nodes_.erase(index);
  nodes_given_.insert(index);
  session.index = index;
  session.renumbered = true;
  session.number = ++numbers_;
  session.watches.clear();
  least_[index] = std::max(least_[index], session.number);
  note_node(ChangeKind::joined, session);
  for (const auto& [full_name, life] : session.provides) {
    note_service(ChangeKind::changed, topics_.at(full_name).service->group, full_name);
  }
  for (const auto& [full_name, life] : session.subscribes) {
    const auto& service = topics_.at(full_name).service;
    if (service && service->provider == id) continue;
    const std::size_t count = topics_.at(full_name).subscribers.size();
    tell_provider(full_name, index, true, count);
    tell_provider(full_name, former, false, count);
  }
  renumbered_.emplace_back(session.seat, index);
}

void Reference::on_drain(const Asked& asked) {
  if (readable<ctrl::Drain>(asked.payload, asked.answer)) drain_wanted_ = true;
}

void Reference::on_reload(const Asked& asked) {
  if (!proto::decode<ctrl::Reload>(asked.payload))
    return require_status(asked.answer, Status::bad_request);
  FUZZ_MUST(next_reload_.has_value());
  const hub::Reloading& found = *next_reload_;
  require_status(asked.answer, found.faults.empty() ? Status::done : Status::bad_request);
  if (!found.faults.empty()) return;
  reloaded_ = true;
  limits_ = found.limits;
  level_ = found.log_level;
  const auto answer = proto::decode_answer<ctrl::ReloadAnswer>(asked.answer);
  const std::size_t fit = std::min<std::size_t>(found.changes.size(), limits_.page_records);
  FUZZ_MUST(answer && answer->changes.size() == fit &&
            answer->more == (fit < found.changes.size()));
  for (std::size_t i = 0; i < fit; ++i) {
    const hub::Reloading::Change& due = found.changes[i];
    FUZZ_MUST(
        (answer->changes[i] == ctrl::ChangeRecord{due.key, due.from, due.to, due.needs_restart}));
  }
}

void Reference::on_log_level(const Asked& asked) {
  const auto wanted = proto::decode<ctrl::SetLogLevel>(asked.payload);
  constexpr std::string_view kLevels[] = {"error", "warning", "info", "debug", "off"};
  const auto* found =
      wanted ? std::find(std::begin(kLevels), std::end(kLevels), wanted->level) : std::end(kLevels);
  const bool legal = found != std::end(kLevels);
  require_status(asked.answer, legal ? Status::done : Status::bad_request);
  if (!legal) return;
  const auto answer = proto::decode_answer<ctrl::SetLogLevelAnswer>(asked.answer);
  FUZZ_MUST(answer && answer->before == kLevels[static_cast<std::size_t>(level_)]);
  level_ = static_cast<LogLevel>(found - std::begin(kLevels));
}

}  // namespace gimnet::fuzz
