#include <algorithm>

#include "proto/control/ctrl.hpp"
#include "tests/sim/model.hpp"

// The reference model of administration, and of the rates at which nodes may ask.

namespace gimnet::sim {

using proto::Role;
using proto::Status;
namespace ctrl = proto::ctrl;
namespace ns = proto::ns;

bool Model::may_declare(const Asked& asked, Happening refused) {
  const std::uint64_t quotas = limits_.services_per_node + limits_.subscriptions_per_node;
  const std::uint64_t burst = std::max(limits_.declarations_burst, quotas);
  const bool may = asked.session.declarations.spend(limits_.declarations_per_s, burst, asked.now);
  if (!may) census_.add(refused);
  if (may && asked.session.held_back) census_.add(Happening::rate_over);
  asked.session.held_back = !may;
  return may;
}

void Model::judge_admin(const Asked& asked, std::uint16_t operation) {
  if (asked.session.role != Role::admin) {
    census_.add(Happening::change_denied);
    return require_status(asked, Status::denied, Checker::answers);
  }
  if (operation == ctrl::Kick::kOperation) return judge_kick(asked);
  if (operation == ctrl::Reassign::kOperation) return judge_reassign(asked);
  if (operation == ctrl::Drain::kOperation) return judge_drain(asked);
  judge_reload(asked);
}

std::uint32_t Model::find_node(NodeId node) {
  if (hub_of(node) != hub_ && hub_of(node) != kOwnHub) return 0;
  const std::uint32_t index = present(index_of(node));
  if (!sessions_.contains(index)) return 0;
  if (index != index_of(node)) census_.add(Happening::named_by_former_id);
  return index;
}

void Model::judge_kick(const Asked& asked) {
  const auto wanted = proto::decode<ctrl::Kick>(asked.payload);
  if (!wanted) return require_status(asked, Status::bad_request, Checker::answers);
  const std::uint32_t index = find_node(wanted->node);
  if (index == 0) return require_status(asked, Status::not_found, Checker::answers);
  if (index == asked.index) return require_status(asked, Status::bad_request, Checker::answers);
  require_status(asked, Status::done, Checker::answers);
  census_.add(sessions_.at(index).connected ? Happening::kicked : Happening::kicked_away);
  kick(index, asked.now);
}

void Model::kick(std::uint32_t index, milliseconds now) {
  const Session& session = sessions_.at(index);
  const auto spend = [&](std::uint32_t each, std::uint64_t number) {
    std::uint64_t& least = least_[each];
    least = std::max(least, number + 1);
    past_.kicked.push_back({each, number, session.token_expiry});
  };
  spend(index, session.token_number);
  for (const std::uint32_t each : former(index)) spend(each, moved_.at(each).token_number);
  end(index, now);
}

void Model::judge_reassign(const Asked& asked) {
  const auto wanted = proto::decode<ctrl::Reassign>(asked.payload);
  if (!wanted) return require_status(asked, Status::bad_request, Checker::answers);
  const std::uint32_t index = find_node(wanted->node);
  if (index == 0) return require_status(asked, Status::not_found, Checker::answers);
  const HubId owner = hub_of(wanted->new_node);
  const std::uint32_t to = index_of(wanted->new_node);
  const bool legal = (owner == hub_ || owner == kOwnHub) && to != kHubIndex && to < kEveryIndex;
  if (index == asked.index || !legal)
    return require_status(asked, Status::bad_request, Checker::answers);
  const bool rests = this->rests(resting_ids_, to, asked.now);
  const bool awaiting = asked.now < past_.returns_until;
  const bool awaited = awaiting && past_.nodes.used.contains(to);
  if (sessions_.contains(to) || rests || awaited) {
    if (awaited && !rests && !sessions_.contains(to)) census_.add(Happening::renumbered_to_awaited);
    census_.add(Happening::renumbered_to_taken);
    return require_status(asked, Status::taken, Checker::ids);
  }
  const Status said = proto::peek_status(asked.answer);
  if (keeping_failed_ && said == Status::limit) return census_.add(Happening::renumbering_not_kept);
  require_status(asked, Status::done, Checker::ids);
  if (awaiting) census_.add(Happening::renumbered_while_awaiting);
  census_.add(sessions_.at(index).connected ? Happening::renumbered : Happening::renumbered_away);
  renumber(index, to, asked.now);
}

void Model::renumber(std::uint32_t index, std::uint32_t to, milliseconds now) {
  moved_.erase(to);
  for (const std::uint32_t each : former(index)) moved_.at(each).index = to;
  const auto generation = generations_.extract(index);
  generations_[to] = generation.mapped();
  auto node = sessions_.extract(index);
  node.key() = to;
  Session& session = sessions_.insert(std::move(node)).position->second;
  moved_[index] = {to, session.token_number};
  session.renumbered = true;
  session.token_number = ++past_.token_numbers;
  least_[to] = std::max(least_[to], session.token_number);
  session.watches.clear();
  if (!session.name.empty()) names_[session.name] = to;
  for (const auto& [full_name, life] : session.provides) {
    topics_.at(full_name).service->provider = to;
    touched_.insert(topics_.at(full_name).service->group);
    moved_services_.insert(full_name);
  }
  for (const auto& [full_name, life] : session.subscribes) {
    auto subscriber = topics_.at(full_name).subscribers.extract(index);
    subscriber.key() = to;
    topics_.at(full_name).subscribers.insert(std::move(subscriber));
  }
  rest(resting_ids_, index, now);
  give_node(to, true);  // or the hub had refused it
  renumbered_.emplace_back(index, to);
}

std::uint32_t Model::present(std::uint32_t index) const {
  const auto moved = moved_.find(index);
  return moved == moved_.end() ? index : moved->second.index;
}

std::vector<std::uint32_t> Model::former(std::uint32_t index) const {
  std::vector<std::uint32_t> found;
  for (const auto& [each, moved] : moved_) {
    if (moved.index == index) found.push_back(each);
  }
  return found;
}

void Model::judge_drain(const Asked& asked) {
  if (!proto::decode<ctrl::Drain>(asked.payload))
    return require_status(asked, Status::bad_request, Checker::answers);
  require_status(asked, Status::done, Checker::drain);
  census_.add(Happening::drain_asked_for);
  drain_wanted_ = true;
}

void Model::judge_reload(const Asked& asked) {
  if (!proto::decode<ctrl::Reload>(asked.payload))
    return require_status(asked, Status::bad_request, Checker::answers);
  if (!configuration_) {
    census_.add(Happening::configuration_refused);
    return require_status(asked, Status::bad_request, Checker::answers);
  }
  require_status(asked, Status::done, Checker::answers);
  census_.add(Happening::configuration_changed);
  limits_ = *configuration_;
}

}  // namespace gimnet::sim
