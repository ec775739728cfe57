#include "hub/control/state/sessions.hpp"

#include <algorithm>
#include <utility>

#include "base/check.hpp"
#include "base/ids.hpp"

namespace gimnet::hub {

SessionNumber NumberFloor::at(NodeIndex index) const {
  const std::size_t page = index.value() / kPage;
  if (page >= pages_.size() || pages_[page] == nullptr) return 0;
  return (*pages_[page])[index.value() % kPage];
}

void NumberFloor::raise(NodeIndex index, SessionNumber number) {
  const std::size_t page = index.value() / kPage;
  if (page >= pages_.size()) pages_.resize(page + 1);
  if (pages_[page] == nullptr) pages_[page] = std::make_unique<Page>();
  SessionNumber& floor = (*pages_[page])[index.value() % kPage];
  floor = std::max(floor, number);
}

namespace {

using std::chrono::milliseconds;

}  // namespace

std::string title(NodeId node, const Session& session) {
  return "node " + to_string(node) +
         (session.name.empty() ? std::string{} : " '" + session.name.str() + "'");
}

Sessions::Sessions(const Options& options, const Limits& limits)
    : limits_(limits),
      hub_(options.hub),
      placement_(options.placement),
      secret_(options.secret),
      returns_until_(options.returns_until),
      last_number_(first_number(options.boot)),
      indices_(kIndexMost, index_resting_time(limits), options.nodes,
               options.returns_until.value_or(milliseconds{0})),
      kicked_(options.kicked),
      slots_(options.shards) {
  for (const SessionToken& token : kicked_) floor_.raise(token.index, token.number + 1);
}

std::vector<std::byte> Sessions::token_of(const Session& session) const {
  return write_token({session.index, session.number, session.token_expiry},
                     {hub_, session.token_name, session.identity}, secret_);
}

void Sessions::renew_token(Session& session, milliseconds wall) const {
  session.token_name = session.name;
  session.token_expiry = wall + milliseconds{limits_.token_ms};
}

Sessions::Claim Sessions::claim(const Presented& presented) {
  const std::optional<SessionToken> token = read_token(presented.token);
  if (!token) return {};
  const auto moved = renumbered_.find(token->index);
  Session* holder = find(present_index(token->index));
  const SessionNumber number = moved != renumbered_.end() ? moved->second.number
                               : holder != nullptr        ? holder->number
                                                          : 0;
  const bool holds = holder != nullptr && number == token->number;
  const std::string_view name = holds ? std::string_view{holder->token_name} : presented.name;
  // The proof comes first: what else is wrong with a token is nobody's business who cannot show
  // one.
  if (!is_genuine(presented.token, {hub_, name, presented.identity}, secret_)) return {};
  if (token->expiry <= presented.wall) return {};
  if (token->number < floor_.at(token->index)) return {};
  if (holds) return {holder, std::nullopt};
  if (holder != nullptr || indices_.held(token->index.value())) return {};
  return {nullptr, token};
}

Result<Session*, proto::Goodbye> Sessions::create(std::optional<std::uint16_t> shard_hint,
                                                  milliseconds now, Places places) {
  if (std::optional<proto::Goodbye> refusal = full_refusal(places)) return std::move(*refusal);
  if (std::optional<proto::Goodbye> refusal = id_refusal(now)) return std::move(*refusal);
  const std::optional<std::uint32_t> index = indices_.take(now);
  GIMNET_CHECK(index.has_value());
  return &put(NodeIndex{*index}, ++last_number_, shard_hint, now);
}

std::optional<proto::Goodbye> Sessions::id_refusal(milliseconds now) {
  if (indices_.ready(now)) return std::nullopt;
  return proto::Goodbye{proto::GoodbyeCode::hub_full,
                        indices_.shortage("node ids", now) + ", or connect to another hub"};
}

Result<Session*, proto::Goodbye> Sessions::restore(const SessionToken& token,
                                                   std::optional<std::uint16_t> shard_hint,
                                                   milliseconds now, Places places) {
  if (std::optional<proto::Goodbye> refusal = full_refusal(places)) return std::move(*refusal);
  const bool taken = indices_.take_back(token.index.value());
  GIMNET_CHECK(taken);
  return &put(token.index, token.number, shard_hint, now);
}

std::optional<proto::Goodbye> Sessions::full_refusal(Places places, std::size_t ending) const {
  const std::uint64_t most = limits_.nodes + (places == Places::all ? limits_.administrators : 0);
  if (sessions_.size() - ending < most) return std::nullopt;
  const std::string limit = places == Places::all ? "administrators" : "nodes";
  return proto::Goodbye{proto::GoodbyeCode::hub_full,
                        "this hub has as many nodes as it takes (" + std::to_string(most) +
                            "); connect to another one, or start it with a larger --limit " +
                            limit};
}

std::optional<proto::Goodbye> Sessions::crowd_refusal(std::string_view crowd, std::size_t ending) {
  // Rounded up, so that a hub of one place is of use to others.
  const std::uint64_t most = (limits_.nodes + 1) / 2;
  const Crowd* found = crowds_.find(crowd);
  if (found == nullptr || found->sessions < most + ending) return std::nullopt;
  return proto::Goodbye{proto::GoodbyeCode::hub_full,
                        "nodes of " + std::string{crowd} + " have half of this hub's places (" +
                            std::to_string(most) + " of " + std::to_string(limits_.nodes) +
                            "), and no address or user may have more; end some of them, or start "
                            "the hub with a larger --limit nodes"};
}

Session& Sessions::put(NodeIndex index, SessionNumber number,
                       std::optional<std::uint16_t> shard_hint, milliseconds now) {
  const bool hinted = placement_ == Placement::hint && shard_hint && *shard_hint < slots_.shards();
  renumbered_.erase(index);
  Session& session = sessions_[index];
  session.index = index;
  session.number = number;
  session.place =
      hinted ? slots_.take_on(ShardIndex{static_cast<std::uint8_t>(*shard_hint)}) : slots_.take();
  session.joined = now;
  floor_.raise(index, number);
  return session;
}

bool Sessions::remember_kicked(const Session& session) {
  spend_token(session);
  std::vector<SessionToken> tokens;
  for (const NodeIndex former : former_indices(session)) {
    tokens.push_back({former, renumbered_.at(former).number, session.token_expiry});
  }
  tokens.push_back({session.index, session.number, session.token_expiry});
  kicked_.insert(kicked_.end(), tokens.begin(), tokens.end());
  while (kicked_.size() > limits_.kicked_tokens) kicked_.erase(kicked_.begin());
  return tokens.size() <= limits_.kicked_tokens;
}

void Sessions::attach(Session& session, milliseconds now) {
  if (!session.connected) ++connected_;
  session.connected = true;
  session.connected_at = now;
  ++session.attachment;
}

void Sessions::move_to_crowd(Session& session, std::string_view crowd) {
  crowds_.leave(std::exchange(session.crowd, nullptr), !session.connected);
  session.crowd = crowds_.join(crowd);
}

void Sessions::begin_grace(Session& session, milliseconds now, Declared declared) {
  GIMNET_CHECK(session.connected);
  session.connected = false;
  --connected_;
  DueList<Absence>& away = declared == Declared::nothing ? away_idle_ : away_declared_;
  const Absence absence{now + milliseconds{limits_.grace_ms}, session.index,
                        session.place.generation, session.attachment};
  const auto is_void = [this](const Absence& each) { return !still_away(each); };
  away.add(absence, sessions_.size(), is_void);
  if (session.crowd == nullptr) return;
  Crowd& crowd = session.crowd->second;
  ++crowd.away;
  crowd.absences.add(absence, crowd.sessions, is_void);
}

void Sessions::stood_still(milliseconds time, milliseconds now) {
  const milliseconds latest = now + milliseconds{limits_.grace_ms};  // nothing began later than now
  away_idle_.put_off(time, latest);
  away_declared_.put_off(time, latest);
  if (returns_until_) returns_until_ = std::min(*returns_until_ + time, latest);
  indices_.put_off_returns(time, latest);
}

std::optional<proto::Refusal> Sessions::take_index(const Session& session, NodeIndex index,
                                                   milliseconds now, const KeepNow& keep) {
  if (index.value() == kHubIndex || index.value() >= kEveryIndex) {
    return proto::Refusal{proto::Status::bad_request,
                          "a node's id ends in a number from 1 to " + std::to_string(kIndexMost)};
  }
  if (index == session.index) {
    return proto::Refusal{
        proto::Status::taken,
        "this node has the id " + to_string(node_id(session)) + " already; choose a free one"};
  }
  const bool awaited = find(index) == nullptr && indices_.used(index.value()) &&
                       returns_expected_for(now) > milliseconds{0};
  const NodeId node = make_id(hub_, index);
  if (awaited || !indices_.take_free(index.value(), now))
    return proto::Refusal{proto::Status::taken, why_taken(node, now)};
  if (!keep || !indices_.unkept()) return std::nullopt;
  const std::string failure = keep();
  if (failure.empty()) return std::nullopt;
  indices_.let_go(index.value());
  return proto::Refusal{proto::Status::limit,
                        "the hub cannot keep that a node has the id " + to_string(node) +
                            ", and would give it to another one after a restart: " + failure +
                            "; mend that and try again"};
}

std::string Sessions::why_taken(NodeId node, milliseconds now) const {
  const std::string id = to_string(node);
  if (const Session* holder = find(node_index_of(node))) {
    const std::string held = holder->name.empty() ? "" : " '" + holder->name.str() + "'";
    return "the id " + id + " is that of another node" + held + "; choose a free one";
  }
  if (const milliseconds left = returns_expected_for(now); left > milliseconds{0}) {
    return "the hub was restarted a moment ago, and if a node had the id " + id +
           ", its node has not come back yet; try again in " +
           std::to_string((left.count() + 999) / 1'000) + " s";
  }
  return "the id " + id +
         " rests, since a node had it a moment ago; choose another one, or try again in a minute";
}

void Sessions::renumber(Session& session, NodeIndex index, milliseconds now) {
  GIMNET_CHECK(indices_.held(index.value()) && !sessions_.contains(index));
  const NodeIndex former = session.index;
  renumbered_.erase(index);
  for (auto& [earlier, moved] : renumbered_) {
    if (moved.index == former) moved.index = index;
  }
  renumbered_[former] = {index, session.number};
  DueList<Absence>* of_crowd = session.crowd == nullptr ? nullptr : &session.crowd->second.absences;
  for (DueList<Absence>* list : {&away_idle_, &away_declared_, of_crowd}) {
    if (list == nullptr) continue;
    for (Absence& away : *list) {
      if (away.index == former && away.generation == session.place.generation) away.index = index;
    }
  }
  // The session stays where it is in memory: others hold references to it.
  auto node = sessions_.extract(former);
  node.key() = index;
  sessions_.insert(std::move(node));
  session.index = index;
  session.renumbered = true;
  // Not older than any that had this index before.
  session.number = ++last_number_;
  floor_.raise(index, session.number);
  indices_.give_back(former.value(), now);
}

NodeIndex Sessions::present_index(NodeIndex index) const {
  const auto found = renumbered_.find(index);
  return found == renumbered_.end() ? index : found->second.index;
}

std::vector<NodeIndex> Sessions::former_indices(const Session& session) const {
  std::vector<NodeIndex> former;
  for (const auto& [earlier, moved] : renumbered_) {
    if (moved.index == session.index) former.push_back(earlier);
  }
  return former;
}

void Sessions::spend_token(const Session& session) {
  floor_.raise(session.index, session.number + 1);
  for (const NodeIndex former : former_indices(session))
    floor_.raise(former, renumbered_.at(former).number + 1);
}

void Sessions::end(Session& session, milliseconds now) {
  // It may come back under the id that it had last, and no other: else one node could be two.
  for (const NodeIndex former : former_indices(session)) {
    floor_.raise(former, renumbered_.at(former).number + 1);
    renumbered_.erase(former);
  }
  if (session.connected) --connected_;
  crowds_.leave(session.crowd, !session.connected);
  const NodeIndex index = session.index;
  slots_.give_back(session.place);
  indices_.give_back(index.value(), now);
  sessions_.erase(index);
}

Session* Sessions::next_expired(milliseconds now) {
  Session* idle = take_due(away_idle_, now);
  return idle != nullptr ? idle : take_due(away_declared_, now);
}

Session* Sessions::longest_away() { return next_expired(milliseconds::max()); }

std::size_t Sessions::away_of(std::string_view crowd) {
  const Crowd* found = crowds_.find(crowd);
  return found == nullptr ? 0 : found->away;
}

Session* Sessions::longest_away_of(std::string_view crowd) {
  Crowd* found = crowds_.find(crowd);
  return found == nullptr ? nullptr : take_due(found->absences, milliseconds::max());
}

Session* Sessions::take_due(DueList<Absence>& away, milliseconds now) {
  while (!away.empty() && away.front().until <= now) {
    const Absence due = away.front();
    away.pop_front();
    if (still_away(due)) return find(due.index);
  }
  return nullptr;
}

std::optional<milliseconds> Sessions::next_expiry() const {
  std::optional<milliseconds> expiry;
  for (const DueList<Absence>* away : {&away_idle_, &away_declared_}) {
    if (!away->empty() && (!expiry || away->front().until < *expiry)) expiry = away->front().until;
  }
  return expiry;
}

bool Sessions::still_away(const Absence& away) const {
  const Session* session = find(away.index);
  return session != nullptr && !session->connected &&
         session->place.generation == away.generation && session->attachment == away.attachment;
}

Session* Sessions::find(NodeIndex index) {
  const auto found = sessions_.find(index);
  return found == sessions_.end() ? nullptr : &found->second;
}

const Session* Sessions::find(NodeIndex index) const {
  const auto found = sessions_.find(index);
  return found == sessions_.end() ? nullptr : &found->second;
}

}  // namespace gimnet::hub
