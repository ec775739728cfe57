#include "tests/sim/model.hpp"

#include <algorithm>

#include "proto/control/names.hpp"

namespace gimnet::sim {

using proto::GoodbyeCode;
using proto::Role;

namespace {

std::string quoted(const std::string& name) { return "'" + name + "'"; }

/// Which one minds that a HELLO was refused with another code than is due, or let in.
Checker checker_of(GoodbyeCode said, std::optional<GoodbyeCode> due) {
  if (said == GoodbyeCode::draining || due == GoodbyeCode::draining) return Checker::drain;
  return said == GoodbyeCode::hub_full || due == GoodbyeCode::hub_full ? Checker::limits
                                                                       : Checker::names;
}

}  // namespace

Model::Model(const hub::Limits& limits, Census& census, HubId hub, Past past)
    : limits_(limits), census_(census), hub_(hub), past_(std::move(past)) {
  step_over(true);
  for (const Kicked& kicked : past_.kicked) {
    std::uint64_t& least = least_[kicked.index];
    least = std::max(least, kicked.number + 1);
  }
}

std::optional<GoodbyeCode> Model::judge_name(const std::string& name,
                                             std::uint32_t claimant) const {
  if (proto::node_name_fault(name) != nullptr) return GoodbyeCode::bad_name;
  const auto holder = names_.find(name);
  if (holder == names_.end() || holder->second == claimant) return std::nullopt;
  if (sessions_.at(holder->second).connected) return GoodbyeCode::name_taken;
  return std::nullopt;
}

void Model::judge_token(const Hello& hello, Verdict& verdict) const {
  const auto found = past_.tokens.find(hello.hello.token);
  if (found == past_.tokens.end()) return;
  const GivenToken& token = found->second;
  const auto least = least_.find(token.index);
  const bool over = least != least_.end() && token.number < least->second;
  if (over || token.expiry <= hello.wall || token.identity != hello.identity) return;
  const auto moved = moved_.find(token.index);
  const std::uint32_t index = present(token.index);
  const auto holder = sessions_.find(index);
  if (holder == sessions_.end()) {
    if (token.name == hello.hello.name) verdict.former = token;
    return;
  }
  const std::uint64_t number =
      moved == moved_.end() ? holder->second.token_number : moved->second.token_number;
  if (number == token.number && holder->second.token_name == token.name) verdict.session = index;
}

/// Why the token was not honoured, for the census.
void Model::count_token(const Hello& hello, const Verdict& verdict) {
  const auto found = past_.tokens.find(hello.hello.token);
  if (found == past_.tokens.end() || verdict.session != 0) return;
  if (verdict.former) {
    const bool earlier_life = past_.nodes.given.contains(found->second.index);
    return census_.add(earlier_life ? Happening::restored_after_restart
                                    : Happening::restored_after_grace);
  }
  if (found->second.expiry <= hello.wall) return census_.add(Happening::token_expired);
  if (found->second.identity != hello.identity)
    return census_.add(Happening::token_of_another_identity);
  const auto kicked = [&](const Kicked& one) {
    return one.index == found->second.index && one.number >= found->second.number;
  };
  if (std::any_of(past_.kicked.begin(), past_.kicked.end(), kicked))
    census_.add(Happening::kicked_token_refused);
  census_.add(Happening::token_of_the_past);
}

Model::Verdict Model::judge(const Hello& hello) const {
  Verdict verdict;
  if (draining_) {
    verdict.refusal = GoodbyeCode::draining;
    return verdict;
  }
  const bool known_role =
      hello.hello.role == Role::node || (hello.hello.role == Role::admin && hello.may_administer);
  if (!known_role) {
    verdict.refusal = GoodbyeCode::not_allowed;
    return verdict;
  }
  judge_token(hello, verdict);
  if (!hello.hello.name.empty()) verdict.refusal = judge_name(hello.hello.name, verdict.session);
  if (verdict.refusal || verdict.session != 0) return verdict;
  if (is_full_for(hello)) verdict.refusal = GoodbyeCode::hub_full;
  return verdict;
}

void Model::refused(const Hello& hello, const proto::Goodbye& goodbye, milliseconds) {
  const Verdict verdict = judge(hello);
  if (verdict.refusal == goodbye.code) {
    if (goodbye.code == GoodbyeCode::name_taken) census_.add(Happening::name_collision);
    if (goodbye.code == GoodbyeCode::bad_name) census_.add(Happening::bad_name);
    if (goodbye.code == GoodbyeCode::not_allowed) census_.add(Happening::wrong_role);
    if (goodbye.code == GoodbyeCode::hub_full) {
      census_.add(has_half(crowd_of(hello.place, hello.may_administer)) ? Happening::crowd_full
                                                                        : Happening::hub_full);
    }
    if (goodbye.code == GoodbyeCode::draining) census_.add(Happening::refused_draining);
    return;
  }
  const bool newcomer = !verdict.refusal && verdict.session == 0 && !verdict.former;
  if (newcomer && goodbye.code == GoodbyeCode::hub_full && few_nodes_left_) {
    return census_.add(Happening::waits_for_returns);
  }
  broken(checker_of(goodbye.code, verdict.refusal),
         std::string{"a HELLO for the name "} + quoted(hello.hello.name) + " is refused with " +
             proto::goodbye_name(goodbye.code) + " (" + goodbye.sentence + "), where " +
             (verdict.refusal ? std::string{proto::goodbye_name(*verdict.refusal)} + " is due"
                              : "it is to be let in"));
}

void Model::admitted(const Hello& hello, const hub::AttachCommand& attach, milliseconds now) {
  const Verdict verdict = judge(hello);
  const std::uint32_t index = index_of(attach.node);
  if (verdict.refusal) {
    // Its own name stands in nobody's way whose token counts: the hub took one that does not.
    const bool by_token = *verdict.refusal == GoodbyeCode::name_taken && !attach.new_session &&
                          verdict.session != index;
    broken(by_token ? Checker::tokens : checker_of(*verdict.refusal, verdict.refusal),
           "a HELLO for the name " + quoted(hello.hello.name) + " is let in as node " +
               std::to_string(index) + ", where " + proto::goodbye_name(*verdict.refusal) +
               " is due");
  }
  const std::uint32_t due = verdict.former ? verdict.former->index : verdict.session;
  const bool right = attach.new_session ? verdict.session == 0 && (due == 0 || due == index)
                                        : verdict.session == index;
  if (!right) {
    broken(Checker::tokens, "a HELLO whose token is of " +
                                (due == 0 ? std::string{"nobody"} : "node " + std::to_string(due)) +
                                " gets " +
                                (attach.new_session ? "a new session as" : "the session of") +
                                " node " + std::to_string(index));
  }
  count_token(hello, verdict);
  make_way(hello, verdict, now);
  take_session(hello, verdict, index, now);
  Session& session = sessions_.at(index);
  generations_[index] = attach.session.generation;
  if (!hello.hello.name.empty() && hello.hello.name != session.name)
    take_name(index, hello.hello.name, now);
  session.role = hello.hello.role;
  session.description = hello.hello.description;
  session.place = hello.place;
  session.crowd = crowd_of(hello.place, hello.may_administer);
  session.resumes = hello.hello.resume;
  session.token_name = session.name;
  session.identity = hello.identity;
  session.token_expiry = hello.wall + milliseconds{limits_.token_ms};
  session.watches.clear();
  past_.tokens[attach.welcome.token] = {index, session.token_number, session.name, session.identity,
                                        session.token_expiry};
  session.connected = true;
  session.renumbered = false;
  ++session.attachment;
  require(attach.welcome.node == attach.node && attach.welcome.name == session.name, Checker::names,
          "WELCOME says another id or name than the session has");
  require(attach.welcome.last_goodbye_code == session.last_goodbye, Checker::answers,
          "WELCOME does not say how the last connection was closed");
  if (session.last_goodbye != 0) census_.add(Happening::last_goodbye_told);
  session.last_goodbye = 0;
}

void Model::take_session(const Hello& hello, const Verdict& verdict, std::uint32_t index,
                         milliseconds now) {
  if (verdict.session == 0) {
    if (!verdict.former) take_new_index(index, now);
    give_node(index, !verdict.former);
    moved_.erase(index);
    Session& session = sessions_[index];
    session.number = hello.new_session;
    session.token_number = verdict.former ? verdict.former->number : ++past_.token_numbers;
    session.joined = now;
    std::uint64_t& least = least_[index];
    least = std::max(least, session.token_number);
    return census_.add(Happening::joined);
  }
  Session& session = sessions_.at(index);
  census_.add(session.connected ? Happening::came_back_replacing : Happening::came_back);
  if (!former(index).empty()) census_.add(Happening::renumbered_came_back);
  ++session.life;
  begin_away(session);  // the former connection may not have ended before
  session.declares = true;
  session.declare_until = now + milliseconds{limits_.grace_ms};
  session.declare_order = ++orders_;
}

void Model::make_way(const Hello& hello, const Verdict& verdict, milliseconds now) {
  const auto holder = names_.find(hello.hello.name);
  if (!hello.hello.name.empty() && holder != names_.end() && holder->second != verdict.session) {
    census_.add(Happening::name_taken_over);
    end(holder->second, now);
  }
  if (verdict.session != 0) return;
  make_room(crowd_of(hello.place, hello.may_administer), hello.hello.role, now);
}

void Model::take_name(std::uint32_t index, const std::string& name, milliseconds now) {
  Session& session = sessions_.at(index);
  if (!session.name.empty()) {
    census_.add(Happening::name_changed);
    const auto provided = session.provides;
    for (const auto& [full_name, life] : provided) withdraw(full_name, now);
    names_.erase(session.name);
  }
  session.name = name;
  if (!name.empty()) names_[name] = index;
}

void Model::detached(const hub::DetachedEvent& event, milliseconds now) {
  const Session* found = known(event.session, event.node);
  if (found == nullptr || found->attachment != event.attachment || !found->connected) return;
  const std::uint32_t index = present(index_of(event.node));
  Session& session = sessions_.at(index);
  const bool left = event.said_by_peer && event.code == GoodbyeCode::done;
  const bool misconduct =
      !event.said_by_peer &&
      (event.code == GoodbyeCode::malformed || event.code == GoodbyeCode::wrong_source ||
       event.code == GoodbyeCode::not_allowed || event.code == GoodbyeCode::too_many_requests ||
       event.code == GoodbyeCode::oddities);
  if (left) census_.add(Happening::goodbye);
  if (misconduct)
    census_.add(session.name.empty() ? Happening::misconduct_nameless
                                     : Happening::misconduct_named);
  if (left || (misconduct && session.name.empty())) {
    least_[index] = session.token_number + 1;
    for (const std::uint32_t each : former(index)) least_[each] = moved_.at(each).token_number + 1;
    return end(index, now);
  }
  if (session.name.empty() && !session.resumes && !session.renumbered) {
    census_.add(Happening::gone_with_connection);
    return end(index, now);
  }
  if (!event.said_by_peer && event.code != GoodbyeCode::done) {
    session.last_goodbye = static_cast<std::uint16_t>(event.code);
  }
  session.connected = false;
  begin_away(session);
  session.watches.clear();
  session.away_until = now + milliseconds{limits_.grace_ms};
  session.away_order = ++orders_;
}

void Model::stood_still(milliseconds time, milliseconds now) {
  const milliseconds latest = now + milliseconds{limits_.grace_ms};
  const auto put_off = [&](milliseconds& until) { until = std::min(until + time, latest); };
  for (auto& [index, session] : sessions_) {
    const bool was_over = session.away_until <= now;
    put_off(session.away_until);
    if (!session.connected && was_over && session.away_until > now)
      census_.add(Happening::grace_put_off);
    put_off(session.declare_until);
  }
  for (auto& [full_name, topic] : topics_) {
    if (topic.unused_until) put_off(*topic.unused_until);
  }
  put_off(past_.returns_until);
}

void Model::ticked(milliseconds now) {
  std::vector<std::uint32_t> over;
  for (const auto& [index, session] : sessions_) {
    if (!session.connected && session.away_until <= now) over.push_back(index);
  }
  for (const std::uint32_t index : over) {
    census_.add(Happening::grace_expired);
    end(index, now);
  }
  std::vector<std::pair<std::uint64_t, std::uint32_t>> silent;
  for (const auto& [index, session] : sessions_) {
    if (session.declares && session.declare_until <= now)
      silent.emplace_back(session.declare_order, index);
  }
  std::sort(silent.begin(), silent.end());
  for (const auto& [order, index] : silent) {
    sessions_.at(index).declares = false;
    if (sessions_.at(index).connected) drop_undeclared(index, now);
  }
  give_back_unused(now);
}

void Model::end(std::uint32_t index, milliseconds now) {
  const Session session = sessions_.at(index);
  for (const auto& [full_name, life] : session.subscribes) unsubscribe(index, full_name, now);
  for (const auto& [full_name, life] : session.provides) withdraw(full_name, now);
  names_.erase(session.name);
  generations_.erase(index);
  sessions_.erase(index);
  for (const std::uint32_t each : former(index)) {
    std::uint64_t& least = least_[each];
    least = std::max(least, moved_.at(each).token_number + 1);
    moved_.erase(each);
  }
  ended_.push_back(index);
  rest(resting_ids_, index, now);
}

void Model::rest(std::map<std::uint32_t, milliseconds>& resting, std::uint32_t index,
                 milliseconds now) {
  resting[index] =
      now + milliseconds{limits_.grace_ms + std::max(limits_.block_ms, limits_.slow_consumer_ms)};
}

const Model::Session* Model::known(const hub::SessionRef& ref, NodeId node) const {
  const auto found = sessions_.find(present(index_of(node)));
  if (found == sessions_.end() || generations_.at(found->first) != ref.generation) return nullptr;
  return &found->second;
}

std::optional<milliseconds> Model::next_deadline() const {
  std::optional<milliseconds> next;
  for (const auto& [index, session] : sessions_) {
    if (!session.connected && (!next || session.away_until < *next)) next = session.away_until;
    if (session.connected && session.declares && (!next || session.declare_until < *next))
      next = session.declare_until;
  }
  for (const auto& [full_name, topic] : topics_) {
    if (topic.unused_until && (!next || *topic.unused_until < *next)) next = topic.unused_until;
  }
  return next;
}

// A shard that has not heard yet that a node has another id says the former one.
std::uint64_t Model::session_of(std::uint32_t index) const {
  const auto found = sessions_.find(present(index));
  return found == sessions_.end() ? 0 : found->second.number;
}

bool Model::provides(std::uint32_t index, std::uint32_t group) const {
  const auto found = groups_.find(group);
  return found != groups_.end() && found->second->second.service->provider == index;
}

std::uint64_t Model::retained_stream(std::uint32_t group) const {
  const auto found = groups_.find(group);
  if (found == groups_.end()) return 0;
  const Service& service = *found->second->second.service;
  return service.terms.retain ? service.stream : 0;
}

bool Model::subscribes(std::uint32_t index, std::uint32_t group) const {
  const auto found = groups_.find(group);
  return found != groups_.end() && found->second->second.subscribers.contains(present(index));
}

std::size_t Model::provided() const {
  return static_cast<std::size_t>(
      std::count_if(groups_.begin(), groups_.end(),
                    [](const auto& entry) { return entry.second->second.service->provided(); }));
}

std::vector<DueEvent> Model::take_due() {
  std::vector<DueEvent> due;
  const auto tell = [&](std::uint32_t to, std::uint16_t operation, const std::string& name) {
    if (sessions_.at(to).connected) return due.push_back({to, operation, name});
    census_.add(Happening::event_skipped_away);
  };
  for (const std::string& name : std::exchange(moved_services_, {})) {
    const Topic* moved = topic(name);
    if (moved == nullptr) continue;
    for (const auto& [subscriber, asked] : moved->subscribers)
      tell(subscriber, proto::ns::ServiceMoved::kOperation, name);
  }
  for (const std::string& name : std::exchange(resubscribed_, {})) {
    const Service* provided = service(name);
    if (provided != nullptr && provided->provided())
      tell(provided->provider, proto::ns::Subscribers::kOperation, name);
  }
  std::sort(due.begin(), due.end());
  return due;
}

}  // namespace gimnet::sim
