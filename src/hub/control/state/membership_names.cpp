#include "base/id_text.hpp"
#include "hub/control/state/membership.hpp"

// Names of this hub beside those of services and of other hubs.

namespace gimnet::hub {
namespace {

using proto::GoodbyeCode;
using std::chrono::milliseconds;

std::string quoted(std::string_view name) { return "the name '" + std::string{name} + "' "; }

proto::Goodbye taken(std::string sentence) {
  return {GoodbyeCode::name_taken, std::move(sentence) + "; choose another name"};
}

std::string holder_of(const KnownName& known) {
  return "node " + to_string(known.claim->node) + " of hub " + std::to_string(known.hub.value());
}

}  // namespace

std::optional<proto::Goodbye> Membership::name_refusal(std::string_view name,
                                                       const Session* claimant,
                                                       const JoinRequest& request,
                                                       milliseconds now) const {
  if (auto refusal = directory_.refusal(name, claimant, sessions_, now)) return refusal;
  if (claimant != nullptr && claimant->name == name) return std::nullopt;
  return network_refusal(name, request, now);
}

std::optional<proto::Goodbye> Membership::network_refusal(std::string_view name,
                                                          const JoinRequest& request,
                                                          milliseconds now) const {
  if (const Topic* topic = services_.find(name); topic != nullptr && topic->provided())
    return taken(quoted(name) + "is the full name of a service");
  if (names_ == nullptr) return std::nullopt;
  const auto known = names_->find(name);
  if (!known && names_->is_full()) {
    return proto::Goodbye{GoodbyeCode::hub_full,
                          "the names of all hubs together are as many as this hub has room for "
                          "(names_bytes); go on without a name, or try again later"};
  }
  if (!known || known->hub == names_->self().hub) return std::nullopt;
  if (known->claim->service)
    return taken(quoted(name) + "is the full name of a service of " + holder_of(*known));
  if (known->standing == proto::ns::NameStanding::held)
    return taken(quoted(name) + "is held by " + holder_of(*known));
  if (known->standing == proto::ns::NameStanding::away) return std::nullopt;
  // Nobody can be asked for a better proof.
  if (known->claim->node == request.former || request.had_name) return std::nullopt;
  const auto left = std::max<std::int64_t>(1, (known->until - now).count() / 1'000);
  return proto::Goodbye{GoodbyeCode::name_taken,
                        quoted(name) + "is that of " + holder_of(*known) +
                            ", which cannot be reached; it is free in " + std::to_string(left) +
                            " s, unless that hub comes back; wait, or choose another name"};
}

std::optional<proto::Refusal> Membership::service_name_refusal(std::string_view full_name) const {
  std::string holder;
  if (const auto index = directory_.find(full_name)) {
    holder = "node " + to_string(sessions_.node_id(*sessions_.find(*index)));
  } else if (const auto known = names_ == nullptr ? std::nullopt : names_->find(full_name);
             known && !known->claim->service) {
    holder = holder_of(*known);
  }
  if (holder.empty()) return std::nullopt;
  return proto::Refusal{proto::Status::taken, "the full name of the service, '" +
                                                  std::string{full_name} + "', is the name of " +
                                                  holder + "; choose another name"};
}

bool Membership::let_go(const Sessions::Presented& presented, milliseconds now, Effects& effects) {
  const Sessions::Claim claim = sessions_.claim(presented);
  if (!claim.token && claim.session == nullptr) return false;
  if (claim.token) sessions_.spend_token(*claim.token);
  if (claim.session != nullptr) {
    sessions_.spend_token(*claim.session);
    if (claim.session->connected)
      effects.emplace_back(
          CloseDue{claim.session->place, GoodbyeCode::replaced,
                   "another connection has shown the token at another hub of the network, and is "
                   "this node now; do not come back by yourself"});
    end(*claim.session, now, effects);
  }
  // The name is wanted, and need not be that of the token: the asking hub would take it from its
  // holder.
  const Topic* const topic = services_.find(presented.name);
  return !directory_.find(presented.name) && (topic == nullptr || !topic->provided());
}

void Membership::lose_name(const std::string& name, NodeId holder, const std::string& sentence,
                           milliseconds now, Effects& effects) {
  if (const auto index = directory_.find(name)) {
    take_name(*sessions_.find(*index), "", now, effects);
    effects.emplace_back(NameLossDue{*index, name, holder, sentence});
  } else if (const Topic* topic = services_.find(name); topic != nullptr && topic->provided()) {
    const NodeIndex provider = topic->service->provider;
    if (!services_.withdraw(provider, topic->service->group, now, effects))
      effects.emplace_back(NameLossDue{provider, name, holder, sentence});
  }
}

}  // namespace gimnet::hub
