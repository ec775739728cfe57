#include "hub/control/state/sessions.hpp"

#include <algorithm>

#include "base/check.hpp"
#include "base/endian.hpp"

namespace gimnet::hub {
namespace {

using std::chrono::milliseconds;

constexpr std::uint32_t kIndexMost = kEveryIndex - 1;
constexpr std::size_t kIndexBytes = sizeof(std::uint32_t);

/// An id that was given back rests for as long as its node might come back and a frame for it might still wait.
milliseconds resting_time(const Limits& limits) {
  return milliseconds{limits.grace_ms + std::max(limits.block_ms, limits.slow_consumer_ms)};
}

/// Looks at every byte whatever it finds, so that the time says nothing about how much of a guess was right.
bool same_secret(std::span<const std::byte> a, const Secret& b) {
  if (a.size() != b.size()) return false;
  std::byte difference{};
  for (std::size_t i = 0; i < b.size(); ++i) difference |= a[i] ^ b[i];
  const volatile std::byte result = difference;
  return result == std::byte{};
}

}  // namespace

Sessions::Sessions(const Options& options, const Limits& limits)
    : limits_(limits),
      hub_(options.hub),
      placement_(options.placement),
      indices_(kIndexMost, resting_time(limits)),
      slots_(options.shards) {}

std::vector<std::byte> Sessions::token_of(const Session& session) {
  std::vector<std::byte> token(kIndexBytes + session.secret.size());
  store_le(token.data(), session.index);
  std::copy(session.secret.begin(), session.secret.end(), token.begin() + kIndexBytes);
  return token;
}

Session* Sessions::claim(std::span<const std::byte> token) {
  if (token.size() != kIndexBytes + std::tuple_size_v<Secret>) return nullptr;
  Session* session = find(load_le<std::uint32_t>(token.data()));
  if (session == nullptr || !same_secret(token.subspan(kIndexBytes), session->secret)) return nullptr;
  return session;
}

Result<Session*, Refusal> Sessions::create(const Secret& secret, std::optional<std::uint16_t> shard_hint,
                                           milliseconds now) {
  if (full()) {
    return Refusal{proto::GoodbyeCode::hub_full, "this hub takes " + std::to_string(limits_.nodes) +
                                                     " nodes and has them; connect to another one, or start it with a "
                                                     "larger --limit nodes"};
  }
  const std::optional<std::uint32_t> index = indices_.take(now);
  if (!index) {
    return Refusal{proto::GoodbyeCode::hub_full,
                   "all node ids of this hub are in use or resting; try again in a minute, or connect to another hub"};
  }
  const bool hinted = placement_ == Placement::hint && shard_hint && *shard_hint < slots_.shards();
  Session& session = sessions_[*index];
  session.index = *index;
  session.place = hinted ? slots_.take_on(ShardIndex{static_cast<std::uint8_t>(*shard_hint)}) : slots_.take();
  session.secret = secret;
  session.joined = now;
  return &session;
}

void Sessions::attach(Session& session, milliseconds now) {
  if (!session.connected) ++connected_;
  session.connected = true;
  session.connected_at = now;
  ++session.attachment;
}

void Sessions::begin_grace(Session& session, milliseconds now) {
  GIMNET_CHECK(session.connected);
  session.connected = false;
  --connected_;
  std::deque<Away>& away = session.name.empty() ? away_nameless_ : away_named_;
  away.push_back({now + milliseconds{limits_.grace_ms}, session.index, session.place.generation, session.attachment});
}

void Sessions::end(Session& session, milliseconds now) {
  if (session.connected) --connected_;
  const std::uint32_t index = session.index;
  slots_.give_back(session.place);
  indices_.give_back(index, now);
  sessions_.erase(index);
}

Session* Sessions::next_expired(milliseconds now) {
  Session* named = take_due(away_named_, now);
  return named != nullptr ? named : take_due(away_nameless_, now);
}

Session* Sessions::longest_away_nameless() { return take_due(away_nameless_, milliseconds::max()); }

Session* Sessions::take_due(std::deque<Away>& away, milliseconds now) {
  while (!away.empty() && away.front().until <= now) {
    const Away due = away.front();
    away.pop_front();
    if (still_away(due)) return find(due.index);
  }
  return nullptr;
}

std::optional<milliseconds> Sessions::next_expiry() const {
  std::optional<milliseconds> expiry;
  for (const std::deque<Away>* away : {&away_named_, &away_nameless_}) {
    if (!away->empty() && (!expiry || away->front().until < *expiry)) expiry = away->front().until;
  }
  return expiry;
}

bool Sessions::still_away(const Away& away) const {
  const Session* session = find(away.index);
  return session != nullptr && !session->connected && session->place.generation == away.generation &&
         session->attachment == away.attachment;
}

Session* Sessions::find(std::uint32_t index) {
  const auto found = sessions_.find(index);
  return found == sessions_.end() ? nullptr : &found->second;
}

const Session* Sessions::find(std::uint32_t index) const {
  const auto found = sessions_.find(index);
  return found == sessions_.end() ? nullptr : &found->second;
}

}  // namespace gimnet::hub
