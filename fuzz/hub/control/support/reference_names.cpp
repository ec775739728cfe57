#include <algorithm>

#include "fuzz/hub/control/support/reference.hpp"
#include "fuzz/support/fuzz_input.hpp"
#include "proto/control/ctrl.hpp"
#include "proto/control/names.hpp"
#include "proto/control/ns_register.hpp"

// What the reference makes of requests: names, lists and watches.

namespace gimnet::fuzz {

using proto::GoodbyeCode;
using proto::Kind;
using proto::Status;
using proto::ns::ChangeKind;
namespace ns = proto::ns;

void require_status(std::span<const std::byte> answer, Status status) {
  const proto::Refusal said = proto::read_status(proto::split_control(answer)->body);
  if (said.status != status) {
    std::fprintf(stderr, "answered %s (%s), due is %s\n", proto::status_name(said.status),
                 said.sentence.c_str(), proto::status_name(status));
  }
  FUZZ_MUST(said.status == status);
  FUZZ_MUST(said.sentence.empty() == (status == Status::done));
}

void Reference::asked(const Line& line, Kind kind, std::span<const std::byte> payload, NodeId dst,
                      const std::optional<proto::Payload>& answer, const ControlHub& hub) {
  if (!is_current(line)) {
    FUZZ_MUST(!answer && hub.shards.sent.empty());
    return;
  }
  Session& session = sessions_.at(line.session);
  const auto view = proto::split_control(payload);
  if (!view || (kind != Kind::ns && kind != Kind::ctrl)) {
    FUZZ_MUST(!answer);
    closed_[session.seat] = view ? GoodbyeCode::not_allowed : GoodbyeCode::malformed;
    return;
  }
  FUZZ_MUST(answer.has_value());
  const Asked request{line.session, session, payload, *answer, hub};
  const std::uint16_t operation = view->header.operation;
  if (dst != NodeId{} && dst != id_of(kHubIndex)) {
    require_status(*answer, Status::not_found);
  } else if (kind == Kind::ctrl) {
    dispatch_control(request, operation);
    count_oddity(request);
  } else {
    dispatch_names(request, operation);
    count_oddity(request);
  }
  // An answer with counters was written before its own request counts.
  ++asked_[{kind, operation}];
}

// ---- rates

bool Reference::may_declare(const Asked& asked) {
  // Whatever a node may have it may also declare at once.
  const std::uint64_t quotas = limits_.services_per_node + limits_.subscriptions_per_node;
  const std::uint64_t burst = std::max(limits_.declarations_burst, quotas);
  return asked.session.declarations.spend(limits_.declarations_per_s, burst, asked.hub.now);
}

void Reference::count_oddity(const Asked& asked) {
  const Status said = proto::read_status(proto::split_control(asked.answer)->body).status;
  if (said != Status::bad_request && said != Status::not_supported && said != Status::denied)
    return;
  if (asked.session.oddities.spend(limits_.oddities_per_s, limits_.oddities_burst, asked.hub.now))
    return;
  closed_[asked.session.seat] = GoodbyeCode::oddities;
}

void Reference::dispatch_names(const Asked& asked, std::uint16_t operation) {
  switch (operation) {
    case ns::RegisterName::kOperation:
      return on_register(asked);
    case ns::UnregisterName::kOperation:
      return on_unregister(asked);
    case ns::Resolve::kOperation:
      return on_resolve(asked);
    case ns::Reverse::kOperation:
      return on_reverse(asked);
    case ns::List::kOperation:
      return on_list(asked);
    case ns::Watch::kOperation:
      return on_watch(asked);
    case ns::Unwatch::kOperation:
      return on_unwatch(asked);
    case ns::WatchTaken::kOperation:
      return on_watch_taken(asked);
    default:
      dispatch_services(asked, operation);
  }
}

void Reference::dispatch_services(const Asked& asked, std::uint16_t operation) {
  switch (operation) {
    case ns::Advertise::kOperation:
      return on_advertise(asked);
    case ns::Withdraw::kOperation:
      return on_withdraw(asked);
    case ns::Services::kOperation:
      return on_services(asked);
    case ns::Subscribe::kOperation:
      return on_subscribe(asked);
    case ns::Unsubscribe::kOperation:
      return on_unsubscribe(asked);
    default:
      require_status(asked.answer, Status::not_supported);
  }
}

// ---- names

void Reference::on_register(const Asked& asked) {
  const auto wanted = proto::decode<ns::RegisterName>(asked.payload);
  if (!wanted || wanted->name.empty()) return require_status(asked.answer, Status::bad_request);
  if (wanted->name != asked.session.name) {
    if (!may_declare(asked)) return require_status(asked.answer, Status::rate);
    const std::optional<GoodbyeCode> refusal = judge_name(wanted->name, asked.id);
    if (refusal) {
      return require_status(
          asked.answer, refusal == GoodbyeCode::name_taken ? Status::taken : Status::bad_request);
    }
  }
  require_status(asked.answer, Status::done);
  const auto answer = proto::decode_answer<ns::RegisterNameAnswer>(asked.answer);
  FUZZ_MUST(answer && answer->name == wanted->name && !answer->provisional);
  renamed(asked, wanted->name, answer->token);
}

void Reference::on_unregister(const Asked& asked) {
  if (!proto::decode<ns::UnregisterName>(asked.payload))
    return require_status(asked.answer, Status::bad_request);
  if (asked.session.name.empty()) return require_status(asked.answer, Status::not_found);
  if (!may_declare(asked)) return require_status(asked.answer, Status::rate);
  require_status(asked.answer, Status::done);
  const auto answer = proto::decode_answer<ns::UnregisterNameAnswer>(asked.answer);
  FUZZ_MUST(answer.has_value());
  renamed(asked, "", answer->token);
}

void Reference::renamed(const Asked& asked, const std::string& name,
                        const std::vector<std::byte>& token) {
  Session& session = asked.session;
  if (name != session.name) {
    const auto holder = name.empty() ? names_.end() : names_.find(name);
    if (holder != names_.end()) end(holder->second, asked.hub.now);
    const std::string former = session.name;
    take_name(asked.id, name, asked.hub.now);
    session.token_name = name;
    note_node(ChangeKind::renamed, session, former);
  }
  tokens_[token] = {session.index, session.number, session.token_name, session.identity,
                    session.token_expiry};
}

void Reference::on_resolve(const Asked& asked) const {
  const auto wanted = proto::decode<ns::Resolve>(asked.payload);
  if (!wanted) return require_status(asked.answer, Status::bad_request);
  const auto found = names_.find(wanted->name);
  if (found == names_.end()) return require_status(asked.answer, Status::not_found);
  require_status(asked.answer, Status::done);
  const auto answer = proto::decode_answer<ns::ResolveAnswer>(asked.answer);
  FUZZ_MUST(answer && answer->node == id_of(sessions_.at(found->second).index));
}

void Reference::on_reverse(const Asked& asked) const {
  const auto wanted = proto::decode<ns::Reverse>(asked.payload);
  if (!wanted) return require_status(asked.answer, Status::bad_request);
  const HubId hub = hub_of(wanted->node);
  const bool ours = hub == ControlHub::kHub || hub == kOwnHub;
  const auto answer = proto::decode_answer<ns::ReverseAnswer>(asked.answer);
  if (ours && index_of(wanted->node) == kHubIndex) {
    FUZZ_MUST(answer && answer->name == "fuzzed" && answer->node == id_of(kHubIndex));
    return;
  }
  const auto found = ours ? by_index_.find(index_of(wanted->node)) : by_index_.end();
  if (found == by_index_.end()) return require_status(asked.answer, Status::not_found);
  require_status(asked.answer, Status::done);
  FUZZ_MUST(answer && answer->name == sessions_.at(found->second).name &&
            answer->node == id_of(found->first));
}

// ---- watches

void Reference::on_watch(const Asked& asked) {
  const auto wanted = proto::decode<ns::Watch>(asked.payload);
  const bool legal = wanted && wanted->watch != 0 &&
                     (wanted->pattern.empty() || proto::valid_pattern(wanted->pattern));
  if (!legal) return require_status(asked.answer, Status::bad_request);
  std::size_t all = 0;
  for (const auto& [id, session] : sessions_) all += session.watches.size();
  auto& own = asked.session.watches;
  const auto old = own.find(wanted->watch);
  const bool full = own.size() >= limits_.watches_per_node || all >= limits_.watches;
  if (full && old == own.end()) return require_status(asked.answer, Status::limit);
  require_status(asked.answer, Status::done);
  // What was before the first watch nobody was told of, and nobody can go on from it.
  const std::uint64_t since = version_ - kept_from_.value_or(version_);
  kept_from_ = kept_from_.value_or(version_);
  const std::uint64_t kept = std::min<std::uint64_t>(since, limits_.watch_changes);
  const bool goes_on = wanted->epoch == asked.hub.conductor.watches().journal().epoch() &&
                       wanted->version <= version_ && version_ - wanted->version <= kept;
  const auto answer = proto::decode_answer<ns::WatchAnswer>(asked.answer);
  FUZZ_MUST(answer && answer->snapshot == !goes_on);
  const std::uint32_t under_way = old == own.end() ? 0 : old->second.under_way();
  own.erase(wanted->watch);
  own.emplace(wanted->watch, WatchView(*wanted, answer->snapshot, under_way));
}

void Reference::on_unwatch(const Asked& asked) {
  const auto wanted = proto::decode<ns::Unwatch>(asked.payload);
  if (!wanted) return require_status(asked.answer, Status::bad_request);
  const bool known = asked.session.watches.erase(wanted->watch) != 0;
  require_status(asked.answer, known ? Status::done : Status::not_found);
}

void Reference::on_watch_taken(const Asked& asked) {
  const auto wanted = proto::decode<ns::WatchTaken>(asked.payload);
  require_status(asked.answer, wanted ? Status::done : Status::bad_request);
  if (!wanted) return;
  const auto watch = asked.session.watches.find(wanted->watch);
  if (watch != asked.session.watches.end()) watch->second.taken(wanted->frames);
}

void Reference::served(const ControlHub& hub) {
  for (const auto& [shard, command] : hub.all<hub::SendControlCommand>()) {
    const auto events = proto::decode<ns::WatchEvents>(payload_of(*command));
    FUZZ_MUST(command->answers == 0 && events && events->hub == ControlHub::kHub);
    const std::uint64_t id =
        session_at({shard, command->session.slot.value(), command->session.generation});
    FUZZ_MUST(id != 0 && sessions_.at(id).connected);
    auto& watches = sessions_.at(id).watches;
    const auto watch = watches.find(events->watch);
    FUZZ_MUST(watch != watches.end());
    FUZZ_MUST(events->version <= version_);
    watch->second.take(*events);
  }
}

void Reference::require_agreed_watches() const {
  for (const auto& [id, session] : sessions_) {
    for (const auto& [number, view] : session.watches) {
      if (!session.connected || view.awaits_snapshot()) FUZZ_MUST(!session.connected);
      if (!view.complete())
        continue;  // it went on behind a version, and knows only what came since
      std::size_t nodes = 0;
      for (const auto& [other, each] : sessions_) {
        if (!view.wants(ns::kWatchNodes, each.name)) continue;
        ++nodes;
        const auto known = view.nodes().find(each.index);
        FUZZ_MUST(known != view.nodes().end());
        const ns::NodeRecord& record = known->second;
        FUZZ_MUST(record.name == each.name && record.connected == each.connected &&
                  record.place == each.place && record.description == each.description);
      }
      FUZZ_MUST(view.nodes().size() == nodes);
      std::size_t services = 0;
      for (const auto& [group, full_name] : groups_) {
        if (!view.wants(ns::kWatchServices, full_name)) continue;
        ++services;
        const auto known = view.services().find(group);
        const Service& service = *topics_.at(full_name).service;
        FUZZ_MUST(known != view.services().end());
        FUZZ_MUST(known->second.name == full_name &&
                  known->second.metadata == service.terms.metadata &&
                  known->second.node == id_of(sessions_.at(service.provider).index));
      }
      FUZZ_MUST(view.services().size() == services);
    }
  }
}

}  // namespace gimnet::fuzz
