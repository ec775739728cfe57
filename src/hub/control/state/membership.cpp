#include "hub/control/state/membership.hpp"

#include <algorithm>

#include "base/check.hpp"
#include "base/ids.hpp"

namespace gimnet::hub {
namespace {
using proto::GoodbyeCode;
using proto::ns::ChangeKind;
using std::chrono::milliseconds;

/// Did the hub close the connection for what the node sent?
bool is_misconduct(const Membership::Ending& ending) {
  if (ending.said_by_peer) return false;
  return ending.code == GoodbyeCode::malformed || ending.code == GoodbyeCode::wrong_source ||
         ending.code == GoodbyeCode::not_allowed || ending.code == GoodbyeCode::too_many_requests ||
         ending.code == GoodbyeCode::oddities;
}

/// check() has seen that who asks as an administrator is one.
Places places_for(const JoinRequest& request) {
  return request.role == proto::Role::admin ? Places::all : Places::ordinary;
}

}  // namespace

Membership::Membership(const Sessions::Options& options, const Limits& limits)
    : limits_(limits),
      sessions_(options, limits),
      topics_(options.hub, limits, options.groups),
      services_(topics_, limits),
      directory_(sessions_, topics_) {}

Result<Membership::Joined, proto::Goodbye> Membership::join(const JoinRequest& request,
                                                            milliseconds now, Effects& effects) {
  if (std::optional<proto::Goodbye> refusal = check(request)) return std::move(*refusal);
  const Sessions::Claim claim =
      sessions_.claim({request.token, request.name, request.identity, request.wall});
  if (!request.name.empty()) {
    if (std::optional<proto::Goodbye> refusal = directory_.refusal(
            request.name, {claim.session, request.former, request.had_name}, now)) {
      return std::move(*refusal);
    }
  }
  if (claim.session == nullptr) {
    if (keeping_due(now)) effects.emplace_back(StateDue{});
    if (std::optional<proto::Goodbye> refusal = room_refusal(request, claim, now))
      return std::move(*refusal);
  }
  if (!request.name.empty()) end_absent_holder(request.name, claim.session, now, effects);
  const Result<Joined, proto::Goodbye> found = session_for(request, claim, now, effects);
  if (!found) return found.error();
  Session& session = *found->session;
  if (!request.name.empty() && request.name != session.name)
    take_name(session, request.name, now, effects);
  session.role = request.role;
  session.description = request.description;
  session.identity = request.identity;
  session.origin = request.origin;
  session.resumes = request.resumes;
  sessions_.move_to_crowd(session, request.crowd);
  sessions_.renew_token(session, request.wall);
  sessions_.attach(session, now);
  effects.emplace_back(
      NodeNoted{found->new_session ? ChangeKind::joined : ChangeKind::back, session.index, {}, {}});
  if (!found->new_session) {
    redeclaring_.add({now + milliseconds{limits_.grace_ms}, session.index, session.place.generation,
                      session.attachment},
                     sessions_.all().size(),
                     [this](const Redeclaring& each) { return !still_redeclares(each); });
  }
  return *found;
}

Result<Membership::Joined, proto::Goodbye> Membership::session_for(const JoinRequest& request,
                                                                   const Sessions::Claim& claim,
                                                                   milliseconds now,
                                                                   Effects& effects) {
  if (claim.session != nullptr) {
    services_.node_returned(claim.session->index, effects);
    claim.session->came_back = true;
    return Joined{claim.session, false};
  }
  make_room(request.crowd, now, effects);
  const Result<Session*, proto::Goodbye> created =
      claim.token ? sessions_.restore(*claim.token, request.shard_hint, now, places_for(request))
                  : sessions_.create(request.shard_hint, now, places_for(request));
  if (!created) return created.error();
  (*created)->came_back = claim.token.has_value();
  if (keeping_due(now)) effects.emplace_back(StateDue{});
  return Joined{*created, true};
}

void Membership::connection_ended(Session& session, const Ending& ending, milliseconds now,
                                  Effects& effects) {
  const bool left = ending.said_by_peer && ending.code == GoodbyeCode::done;
  if (left || ends_with_connection(session, ending)) {
    // Its token is good for its id otherwise, as after a grace time.
    if (left || is_misconduct(ending)) sessions_.spend_token(session);
    end(session, now, effects);
    return;
  }
  if (!ending.said_by_peer && ending.code != GoodbyeCode::done) {
    session.closing = std::make_unique<Closing>(Closing{ending.code, ending.sentence});
  }
  sessions_.begin_grace(
      session, now, services_.declares(session.index) ? Declared::something : Declared::nothing);
  services_.node_away(session.index, effects);
  effects.emplace_back(NodeNoted{ChangeKind::away, session.index, {}, {}});
}

/// Others know a node without a name by its id alone. Sessions that are kept for those who send
/// rubbish would fill the hub. A node that was given another id has to come back to learn it.
bool Membership::ends_with_connection(const Session& session, const Ending& ending) {
  if (!session.name.empty()) return false;
  return is_misconduct(ending) || (!session.resumes && !session.renumbered);
}

std::optional<proto::Refusal> Membership::rename(Session& session, const std::string& name,
                                                 milliseconds now, Effects& effects) {
  if (name == session.name) return std::nullopt;
  if (!name.empty()) {
    if (const std::optional<proto::Goodbye> refusal = directory_.refusal(name, {&session}, now)) {
      const proto::Status status = refusal->code == GoodbyeCode::name_taken
                                       ? proto::Status::taken
                                       : proto::Status::bad_request;
      return proto::Refusal{status, refusal->sentence};
    }
    end_absent_holder(name, &session, now, effects);
  }
  take_name(session, name, now, effects);
  session.token_name = name;
  return std::nullopt;
}

std::string Membership::kick(Session& session, const std::string& sentence, milliseconds now,
                             Effects& effects, const KeepNow& keep) {
  const bool remembered = sessions_.remember_kicked(session);
  std::string failure;
  if (keep) {
    failure = keep();
  } else {
    effects.emplace_back(StateDue{});
  }
  if (failure.empty() && !remembered) {
    failure =
        "its limit kicked_tokens is " + std::to_string(limits_.kicked_tokens) + "; make it larger";
  }
  effects.emplace_back(CloseDue{session.place, GoodbyeCode::kicked, sentence});
  end(session, now, effects);
  return failure;
}

bool Membership::keeping_due(milliseconds now) const {
  return sessions_.indices().keeping_due(now) || topics_.group_indices().keeping_due(now);
}

Durable Membership::durable(milliseconds now) const {
  return {sessions_.indices().next_grant(now), topics_.group_indices().next_grant(now),
          sessions_.kicked()};
}

void Membership::state_not_kept() {
  sessions_.indices().keeping_failed();
  topics_.group_indices().keeping_failed();
}

void Membership::state_kept(const Durable& durable) {
  sessions_.indices().grant(durable.nodes);
  topics_.group_indices().grant(durable.groups);
}

std::optional<proto::Refusal> Membership::renumber(Session& session, NodeIndex index,
                                                   milliseconds now, Effects& effects,
                                                   const KeepNow& keep) {
  if (auto refusal = sessions_.take_index(session, index, now, keep)) return refusal;
  const NodeIndex former = session.index;
  sessions_.renumber(session, index, now);
  if (keeping_due(now)) effects.emplace_back(StateDue{});
  directory_.remove(session.name);
  if (!session.name.empty()) directory_.put(session.name, index);
  for (Redeclaring& due : redeclaring_) {
    if (due.index == former && due.generation == session.place.generation) due.index = index;
  }
  // The new id leads to the node before the old one says that it moved.
  effects.emplace_back(NodeChanged{index});
  effects.emplace_back(NodeChanged{former});
  // A node that hears of the new id may send to it at once. By then no frame goes to the connection
  // on which this node has the old one.
  effects.emplace_back(RenumberDue{session.place, former, index,
                                   "an administrator gave this node the id " +
                                       to_string(sessions_.node_id(session)) +
                                       "; come back with the token"});
  effects.emplace_back(NodeNoted{ChangeKind::left, former, session.name.str(), {}});
  effects.emplace_back(NodeNoted{ChangeKind::joined, index, {}, {}});
  services_.node_renumbered(former, index, effects);
  return std::nullopt;
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
  return !directory_.in_use(presented.name);
}

void Membership::lose_name(const std::string& name, NodeId holder, const std::string& sentence,
                           milliseconds now, Effects& effects) {
  if (const auto index = directory_.find(name)) {
    take_name(*sessions_.find(*index), "", now, effects);
    effects.emplace_back(NameLossDue{*index, name, holder, sentence});
  } else if (const Topic* topic = topics_.find(name); topic != nullptr && topic->provided()) {
    const NodeIndex provider = topic->service->provider;
    if (!services_.withdraw(provider, topic->service->group, now, effects))
      effects.emplace_back(NameLossDue{provider, name, holder, sentence});
  }
}

void Membership::stood_still(milliseconds time, milliseconds now) {
  const milliseconds latest = now + milliseconds{limits_.grace_ms};
  sessions_.stood_still(time, now);
  redeclaring_.put_off(time, latest);
  topics_.put_off(time, latest);
}

void Membership::tick(milliseconds now, Effects& effects) {
  while (Session* expired = sessions_.next_expired(now)) end(*expired, now, effects);
  while (!redeclaring_.empty() && redeclaring_.front().until <= now) {
    const Redeclaring due = redeclaring_.front();
    redeclaring_.pop_front();
    if (still_redeclares(due)) services_.drop_undeclared(due.index, now, effects);
  }
  topics_.tick(now, effects);
}

bool Membership::still_redeclares(const Redeclaring& due) const {
  const Session* session = sessions_.find(due.index);
  return session != nullptr && session->place.generation == due.generation &&
         session->attachment == due.attachment && session->connected;
}

std::optional<milliseconds> Membership::next_deadline() const {
  std::optional<milliseconds> deadline = sessions_.next_expiry();
  const std::optional<milliseconds> redeclaring =
      redeclaring_.empty() ? std::nullopt : std::optional{redeclaring_.front().until};
  for (const std::optional<milliseconds>& other : {redeclaring, topics_.next_deadline()}) {
    if (other && (!deadline || *other < *deadline)) deadline = other;
  }
  return deadline;
}

std::optional<proto::Goodbye> Membership::check(const JoinRequest& request) const {
  if (request.role == proto::Role::hub) {
    return proto::Goodbye{GoodbyeCode::not_allowed,
                          "this hub takes no links from other hubs; connect as a node"};
  }
  if (request.role == proto::Role::admin && !request.rights.administer) {
    // By another way it would not be told apart from nobody, by this one it is told as whom it
    // came.
    if (request.identity.is_user()) {
      return proto::Goodbye{GoodbyeCode::not_allowed,
                            "only root and the user that runs the hub administer it, and this is " +
                                request.identity.text() + "; run the command as one of them"};
    }
    return proto::Goodbye{GoodbyeCode::not_allowed,
                          "administrators connect over the hub's Unix socket, as root or as the "
                          "user that runs the hub"};
  }
  if (request.role != proto::Role::node && request.role != proto::Role::admin) {
    return proto::Goodbye{GoodbyeCode::not_allowed,
                          "there is no role " + std::to_string(static_cast<int>(request.role)) +
                              "; connect as a node (0)"};
  }
  return std::nullopt;
}

void Membership::end_absent_holder(const std::string& name, const Session* claimant,
                                   milliseconds now, Effects& effects) {
  const std::optional<NodeIndex> holder = directory_.find(name);
  if (!holder || (claimant != nullptr && claimant->index == *holder)) return;
  end(*sessions_.find(*holder), now, effects);
}

std::optional<proto::Goodbye> Membership::room_refusal(const JoinRequest& request,
                                                       const Sessions::Claim& claim,
                                                       milliseconds now) {
  // The limit may have been lowered, so that more would have to go than make way. The absent holder
  // of the name goes first, and one more at most.
  const std::optional<NodeIndex> index = directory_.find(request.name);
  const Session* holder = index ? sessions_.find(*index) : nullptr;
  const std::size_t held = holder != nullptr ? 1 : 0;
  const std::size_t others = sessions_.away() > held ? 1 : 0;
  if (auto refusal = sessions_.full_refusal(places_for(request), held + others)) return refusal;
  if (!request.crowd.empty()) {
    const bool of_crowd =
        holder != nullptr && holder->crowd != nullptr && holder->crowd->first == request.crowd;
    // The same holds within its crowd.
    const std::size_t own = of_crowd ? 1 : 0;
    const std::size_t more = sessions_.away_of(request.crowd) > own ? 1 : 0;
    if (auto refusal = sessions_.crowd_refusal(request.crowd, own + more)) return refusal;
  }
  return claim.token ? std::nullopt : sessions_.id_refusal(now);
}

void Membership::make_room(std::string_view crowd, milliseconds now, Effects& effects) {
  if (!crowd.empty() && sessions_.crowd_refusal(crowd)) {
    if (Session* away = sessions_.longest_away_of(crowd)) end(*away, now, effects);
  }
  if (!sessions_.full()) return;
  if (Session* away = sessions_.longest_away()) end(*away, now, effects);
}

void Membership::take_name(Session& session, const std::string& name, milliseconds now,
                           Effects& effects) {
  const std::string former = std::exchange(session.name, CompactText(name)).str();
  if (!former.empty()) {
    services_.node_renamed(session.index, now, effects);
    directory_.remove(former);
  }
  if (!name.empty()) directory_.put(name, session.index);
  // A node that has not been attached yet has nothing to change: it will be told of as one that
  // joined.
  if (session.attachment > 0)
    effects.emplace_back(NodeNoted{ChangeKind::renamed, session.index, {}, former});
}

void Membership::end(Session& session, milliseconds now, Effects& effects) {
  services_.node_left(session.index, now, effects);
  directory_.remove(session.name);
  const std::vector<NodeIndex> former = sessions_.former_indices(session);
  effects.emplace_back(NodeChanged{session.index});
  effects.emplace_back(SessionEnded{session.place});
  if (session.attachment > 0)
    effects.emplace_back(NodeNoted{ChangeKind::left, session.index, session.name.str(), {}});
  for (const NodeIndex index : former) effects.emplace_back(NodeChanged{index});
  sessions_.end(session, now);
}

}  // namespace gimnet::hub
