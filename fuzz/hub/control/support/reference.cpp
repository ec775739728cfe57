#include "fuzz/hub/control/support/reference.hpp"

#include <algorithm>

#include "fuzz/support/fuzz_input.hpp"
#include "proto/control/names.hpp"

// Sessions, tokens and names of the reference.

namespace gimnet::fuzz {

using proto::GoodbyeCode;
using proto::Role;
using proto::ns::ChangeKind;

// ---- what a HELLO is worth

std::optional<GoodbyeCode> Reference::judge_name(const std::string& name,
                                                 std::uint64_t claimant) const {
  if (proto::node_name_fault(name) != nullptr) return GoodbyeCode::bad_name;
  const auto holder = names_.find(name);
  if (holder == names_.end() || holder->second == claimant) return std::nullopt;
  if (sessions_.at(holder->second).connected) return GoodbyeCode::name_taken;
  return std::nullopt;
}

std::uint64_t Reference::holder_of(std::uint32_t index) const {
  const auto moved = moved_.find(index);
  if (moved != moved_.end()) return moved->second.session;
  const auto found = by_index_.find(index);
  return found == by_index_.end() ? 0 : found->second;
}

void Reference::judge_token(const Stranger& who, milliseconds wall, Verdict& verdict) const {
  const auto found = tokens_.find(who.hello.token);
  if (found == tokens_.end()) return;
  const Token& token = found->second;
  const auto least = least_.find(token.index);
  const bool over = least != least_.end() && token.number < least->second;
  if (over || token.expiry <= wall || token.identity != who.identity) return;
  const std::uint64_t holder = holder_of(token.index);
  if (holder == 0) {
    if (token.name == who.hello.name) verdict.former = token;
    return;
  }
  const auto moved = moved_.find(token.index);
  const Session& session = sessions_.at(holder);
  const std::uint64_t number = moved != moved_.end() ? moved->second.number : session.number;
  if (number == token.number) {
    if (session.token_name == token.name) verdict.session = holder;
  }
}

Reference::Verdict Reference::judge(const Stranger& who, milliseconds wall) const {
  Verdict verdict;
  const Role role = who.hello.role;
  if (draining_) {
    verdict.refusal = GoodbyeCode::draining;
  } else if (role != Role::node && (role != Role::admin || !who.may_administer)) {
    verdict.refusal = GoodbyeCode::not_allowed;
  }
  if (verdict.refusal) return verdict;
  judge_token(who, wall, verdict);
  if (!who.hello.name.empty()) verdict.refusal = judge_name(who.hello.name, verdict.session);
  if (verdict.refusal || verdict.session != 0) return verdict;
  // Whoever is away under that name makes way, then the one that is away longest.
  const auto named = names_.find(who.hello.name);
  const std::uint64_t holder = named != names_.end() ? named->second : 0;
  const std::size_t stay = sessions_.size() - (holder != 0 ? 1 : 0);
  const std::size_t away = stay >= limits_.nodes && longest_away(holder) != 0 ? 1 : 0;
  if (stay - away >= places_for(role)) verdict.refusal = GoodbyeCode::hub_full;
  // All strangers come from one address, and those who may administer the hub count for none.
  const auto in_crowd = std::ranges::count_if(sessions_, [holder](const auto& entry) {
    return entry.second.in_crowd && entry.first != holder;
  });
  if (!who.may_administer && static_cast<std::uint64_t>(in_crowd) >= (limits_.nodes + 1) / 2)
    verdict.refusal = GoodbyeCode::hub_full;
  return verdict;
}

std::uint64_t Reference::places_for(Role role) const {
  return limits_.nodes + (role == Role::admin ? limits_.administrators : 0);
}

std::uint64_t Reference::longest_away(std::uint64_t but) const {
  const auto rank = [](const Session& session) {
    return std::pair{!session.provides.empty() || !session.subscribes.empty(), session.away_order};
  };
  std::uint64_t found = 0;
  for (const auto& [id, session] : sessions_) {
    if (session.connected || id == but) continue;
    if (found == 0 || rank(session) < rank(sessions_.at(found))) found = id;
  }
  return found;
}

// ---- joining

std::uint64_t Reference::came(const Stranger& who, const ControlHub& hub,
                              const std::optional<proto::Goodbye>& refusal) {
  const Verdict verdict = judge(who, hub.wall());
  FUZZ_MUST(refusal.has_value() == verdict.refusal.has_value());
  if (refusal) {
    FUZZ_MUST(refusal->code == *verdict.refusal && !refusal->sentence.empty());
    FUZZ_MUST(hub.shards.sent.empty());
    return 0;
  }
  const auto attached = hub.all<hub::AttachCommand>();
  FUZZ_MUST(attached.size() == 1);
  const hub::AttachCommand& attach = *attached.front().second;
  const std::uint32_t index = index_of(attach.node);
  FUZZ_MUST(attach.new_session == (verdict.session == 0));
  if (verdict.session != 0) FUZZ_MUST(sessions_.at(verdict.session).index == index);
  if (verdict.former) FUZZ_MUST(verdict.former->index == index);
  const auto holder = names_.find(who.hello.name);
  if (!who.hello.name.empty() && holder != names_.end() && holder->second != verdict.session) {
    end(holder->second, hub.now);
  }
  const std::uint64_t id = take_in(verdict, attach, hub);
  Session& session = sessions_.at(id);
  if (!who.hello.name.empty() && who.hello.name != session.name) {
    const std::string former = session.name;
    take_name(id, who.hello.name, hub.now);
    if (verdict.session != 0) note_node(ChangeKind::renamed, session, former);
  }
  note_node(verdict.session != 0 ? ChangeKind::back : ChangeKind::joined, session);
  session.seat = {attached.front().first, attach.session.slot.value(), attach.session.generation};
  session.role = who.hello.role;
  session.description = who.hello.description;
  session.place = who.place;
  session.in_crowd = !who.may_administer;
  session.resumes = who.hello.resume;
  session.identity = who.identity;
  session.token_name = session.name;
  session.token_expiry = hub.wall() + milliseconds{limits_.token_ms};
  session.watches.clear();
  session.connected = true;
  session.renumbered = false;
  FUZZ_MUST(attach.attachment == ++session.attachment);
  const proto::Welcome& welcome = attach.welcome;
  FUZZ_MUST(welcome.node == attach.node && welcome.name == session.name &&
            !welcome.name_provisional);
  FUZZ_MUST(welcome.last_goodbye_code == session.last_goodbye);
  FUZZ_MUST(hub_of(attach.node) == ControlHub::kHub && welcome.hub == ControlHub::kHub);
  session.last_goodbye = 0;
  tokens_[welcome.token] = {session.index, session.number, session.name, session.identity,
                            session.token_expiry};
  return id;
}

std::uint64_t Reference::take_in(const Verdict& verdict, const hub::AttachCommand& attach,
                                 const ControlHub& hub) {
  const std::uint32_t index = index_of(attach.node);
  if (verdict.session != 0) {
    Session& session = sessions_.at(verdict.session);
    ++session.life;
    session.declare_until = hub.now + milliseconds{limits_.grace_ms};
    return verdict.session;
  }
  if (sessions_.size() >= limits_.nodes) {
    if (const std::uint64_t away = longest_away(0); away != 0) end(away, hub.now);
  }
  FUZZ_MUST(index != kHubIndex && index < kEveryIndex && !by_index_.contains(index));
  if (!verdict.former) FUZZ_MUST(is_free(resting_nodes_, index, hub.now));
  resting_nodes_.erase(index);
  const std::uint64_t id = ++ids_;
  Session& session = sessions_[id];
  session.index = index;
  session.number = verdict.former ? verdict.former->number : ++numbers_;
  session.joined = hub.now;
  by_index_[index] = id;
  nodes_given_.insert(index);
  moved_.erase(index);
  least_[index] = std::max(least_[index], session.number);
  return id;
}

void Reference::take_name(std::uint64_t id, const std::string& name, milliseconds now) {
  Session& session = sessions_.at(id);
  if (!session.name.empty()) {
    const auto provided = session.provides;
    for (const auto& [full_name, life] : provided) withdraw(full_name, now);
    names_.erase(session.name);
  }
  session.name = name;
  if (!name.empty()) names_[name] = id;
}

// ---- leaving

bool Reference::is_current(const Line& line) const {
  const auto found = sessions_.find(line.session);
  return found != sessions_.end() && found->second.attachment == line.attachment;
}

void Reference::ended(const Line& line, bool said_by_peer, GoodbyeCode code,
                      const ControlHub& hub) {
  if (!is_current(line) || !sessions_.at(line.session).connected) return;
  Session& session = sessions_.at(line.session);
  const bool misconduct =
      !said_by_peer && (code == GoodbyeCode::malformed || code == GoodbyeCode::wrong_source ||
                        code == GoodbyeCode::not_allowed ||
                        code == GoodbyeCode::too_many_requests || code == GoodbyeCode::oddities);
  if ((said_by_peer && code == GoodbyeCode::done) || (misconduct && session.name.empty())) {
    spend_tokens(session);
    return end(line.session, hub.now);
  }
  if (session.name.empty() && !session.resumes && !session.renumbered)
    return end(line.session, hub.now);
  if (!said_by_peer && code != GoodbyeCode::done)
    session.last_goodbye = static_cast<std::uint16_t>(code);
  session.connected = false;
  session.watches.clear();
  session.away_until = hub.now + milliseconds{limits_.grace_ms};
  session.away_order = ++orders_;
  note_node(ChangeKind::away, session);
}

void Reference::spend_tokens(const Session& session) {
  least_[session.index] = std::max(least_[session.index], session.number + 1);
  for (const auto& [index, moved] : moved_) {
    if (sessions_.at(moved.session).index == session.index)
      least_[index] = std::max(least_[index], moved.number + 1);
  }
}

void Reference::passed(const ControlHub& hub) {
  std::vector<std::uint64_t> over;
  for (const auto& [id, session] : sessions_) {
    if (!session.connected && session.away_until <= hub.now) over.push_back(id);
  }
  for (const std::uint64_t id : over) end(id, hub.now);
  for (auto& [id, session] : sessions_) {
    if (!session.declare_until || *session.declare_until > hub.now) continue;
    session.declare_until.reset();
    if (session.connected) drop_undeclared(id, hub.now);
  }
}

void Reference::drop_undeclared(std::uint64_t id, milliseconds now) {
  const Session session = sessions_.at(id);
  for (const auto& [full_name, life] : session.subscribes) {
    if (life != session.life) unsubscribe(id, full_name);
  }
  for (const auto& [full_name, life] : session.provides) {
    if (life != session.life) withdraw(full_name, now);
  }
}

void Reference::end(std::uint64_t id, milliseconds now) {
  const Session session = sessions_.at(id);
  for (const auto& [full_name, life] : session.subscribes) unsubscribe(id, full_name);
  for (const auto& [full_name, life] : session.provides) withdraw(full_name, now);
  note_node(ChangeKind::left, session);
  names_.erase(session.name);
  by_index_.erase(session.index);
  std::erase_if(moved_, [this, id](const auto& entry) {
    const auto& [index, moved] = entry;
    if (moved.session != id) return false;
    least_[index] = std::max(least_[index], moved.number + 1);
    return true;
  });
  released_.push_back(session.seat);
  resting_nodes_[session.index] = rests_until(now);
  sessions_.erase(id);
}

milliseconds Reference::rests_until(milliseconds now) const {
  return now +
         milliseconds{limits_.grace_ms + std::max(limits_.block_ms, limits_.slow_consumer_ms)};
}

bool Reference::is_free(const std::map<std::uint32_t, milliseconds>& resting, std::uint32_t index,
                        milliseconds now) const {
  const auto found = resting.find(index);
  return found == resting.end() || found->second <= now;
}

void Reference::note_node(ChangeKind kind, const Session& session, const std::string& former_name) {
  notes_.emplace_back(static_cast<std::uint8_t>(kind), false, session.index, session.name,
                      former_name);
}

void Reference::note_service(ChangeKind kind, std::uint32_t group, const std::string& full_name) {
  notes_.emplace_back(static_cast<std::uint8_t>(kind), true, group, full_name, std::string{});
}

std::uint64_t Reference::session_at(const Seat& seat) const {
  for (const auto& [id, session] : sessions_) {
    if (session.seat == seat) return id;
  }
  return 0;
}

}  // namespace gimnet::fuzz
