#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/compact_text.hpp"
#include "base/ids.hpp"
#include "base/result.hpp"
#include "base/token_bucket.hpp"
#include "hub/control/state/due_list.hpp"
#include "hub/control/state/identity.hpp"
#include "hub/control/state/index_pool.hpp"
#include "hub/control/state/place.hpp"
#include "hub/control/state/session_token.hpp"
#include "hub/control/state/slot_pool.hpp"
#include "hub/limits.hpp"
#include "proto/control/link.hpp"

namespace gimnet::hub {

/// For each node index the least session number whose token may still claim it: lower ones are of
/// sessions that left, or after which somebody else had the index. Thread safety: none. Limits: 8
/// bytes an index, in pages of 4,096, of which there are only those that were written.
class NumberFloor {
 public:
  /// 0 where nothing was raised.
  [[nodiscard]] SessionNumber at(NodeIndex index) const;
  /// From now on tokens below `number` do not claim the index. Never lowers.
  void raise(NodeIndex index, SessionNumber number);

 private:
  static constexpr std::uint32_t kPage = 4'096;
  using Page = std::array<SessionNumber, kPage>;
  std::vector<std::unique_ptr<Page>> pages_;
};

/// A note that a session's grace time began. It is void once the session came back or ended.
struct Absence {
  std::chrono::milliseconds until;
  NodeIndex index;
  std::uint32_t generation;
  std::uint32_t attachment;
};

/// The sessions that come from one address, or are of one user.
struct Crowd {
  std::size_t sessions = 0;
  std::size_t away = 0;       ///< of these, within their grace time
  DueList<Absence> absences;  ///< in the order in which they began; some are void
};

/// Counts the sessions of each crowd. Thread safety: none. Ownership: an Entry is good until its
/// last session has left. Limits: one entry for each session at most.
class Crowds {
 public:
  using Entries = std::map<std::string, Crowd, std::less<>>;
  using Entry = Entries::value_type;

  /// One session more; null for "", which is no crowd.
  [[nodiscard]] Entry* join(std::string_view crowd) {
    if (crowd.empty()) return nullptr;
    Entry& entry = *entries_.try_emplace(std::string{crowd}).first;
    ++entry.second.sessions;
    return &entry;
  }
  /// One session less. Null: it counted in no crowd.
  void leave(Entry* entry, bool away) {
    if (entry == nullptr) return;
    if (away) --entry->second.away;
    if (--entry->second.sessions == 0) entries_.erase(entries_.find(entry->first));
  }
  /// Null: nobody is in it.
  [[nodiscard]] Crowd* find(std::string_view crowd) {
    const auto found = entries_.find(crowd);
    return found == entries_.end() ? nullptr : &found->second;
  }

 private:
  Entries entries_;  ///< Limit: the sessions
};

/// The origin of a connection, as people read it: "tcp" and "127.0.0.1:41234", or "unix" and "pid
/// 77 uid 1000".
struct PeerAddress {
  CompactText transport;
  CompactText address;
};

/// The end of a connection that the hub closed.
struct Closing {
  proto::GoodbyeCode code{};
  std::string sentence;
};

/// A node's membership of this hub: outlives its connections by the grace time. There are as many
/// as nodes, most of them idle: what few of them have takes a pointer, no more.
struct Session {
  NodeIndex index;               ///< of its node id
  std::uint32_t attachment = 0;  ///< of the latest connection, counted from 1
  SessionNumber number = 0;
  Place place;
  proto::Role role{};
  bool connected = false;
  bool renumbered = false;  ///< and has not come back since
  bool came_back = false;   ///< with a token, to this hub or to this hub before its restart
  bool resumes = false;     ///< its latest HELLO asked for resume
  CompactText name;         ///< "" for a node without one
  CompactText description;
  Identity identity;                         ///< who its peer is; nobody else can claim it
  CompactText token_name;                    ///< for which its latest token was written
  PeerAddress origin;                        ///< of the latest connection
  Crowds::Entry* crowd = nullptr;            ///< in which it counts; null: in none
  std::chrono::milliseconds token_expiry{};  ///< since 1970
  std::uint64_t change_seen = 0;             ///< of services, when its latest connection began
  std::chrono::milliseconds joined{};        ///< when the session began
  std::chrono::milliseconds connected_at{};  ///< when its latest connection was admitted
  std::unique_ptr<const Closing>
      closing;  ///< of its last connection, if it was; told at its next WELCOME
  // Over all its connections, so that a new one is no way to get more.
  TokenBucket declarations;  ///< that it begins or changes
  TokenBucket oddities;      ///< requests of no use
};

/// A node for people: "node 7.17 'robot'".
[[nodiscard]] std::string title(NodeId node, const Session& session);

enum class Placement : std::uint8_t { spread, hint };

/// Which places a newcomer may have: also those that are kept for administrators, or not.
enum class Places : std::uint8_t { ordinary, all };

/// Has a node that went away a service or a subscription?
enum class Declared : std::uint8_t { nothing, something };

/// All sessions of a hub: ids, places, tokens, grace times. Time and randomness are arguments.
/// Thread safety: none. Ownership: a Session& is good until end(). Limits: limits.nodes, half of
/// them for one crowd, and limits.administrators beyond them.
class Sessions {
 public:
  struct Options {
    HubId hub{1};
    std::size_t shards = 1;
    Placement placement = Placement::spread;
    Secret secret{};                     ///< proves tokens; the hub keeps it over its restarts
    std::uint64_t boot = 0;              ///< which start of the hub this is
    IndexRange nodes{};                  ///< indices for newcomers
    IndexRange groups{};                 ///< the same for services
    std::vector<SessionToken> kicked{};  ///< not honoured any more
    /// Until then nodes of before a restart may come back under their ids. Nothing: there were
    /// none.
    std::optional<std::chrono::milliseconds> returns_until{};
  };
  Sessions(const Options& options, const Limits& limits);

  [[nodiscard]] NodeId node_id(const Session& session) const {
    return make_id(hub_, session.index);
  }

  /// The token of a node's session. REQUIRES: renew_token() was called for the session.
  [[nodiscard]] std::vector<std::byte> token_of(const Session& session) const;
  /// The session's next token is for its present name and good for limits.token_ms from `wall`
  /// (since 1970) on.
  void renew_token(Session& session, std::chrono::milliseconds wall) const;

  /// A token as it was presented, and by whom.
  struct Presented {
    std::span<const std::byte> token;
    std::string_view name;             ///< that HELLO asks for
    Identity identity;                 ///< as the connection proves it
    std::chrono::milliseconds wall{};  ///< since 1970
  };
  /// The rights that a token gives. Neither member set: it counts as none.
  struct Claim {
    Session* session = nullptr;  ///< that it is for
    std::optional<SessionToken>
        token;  ///< its session is not there, but its index is free: restore()
  };
  /// Takes as long for a wrong token as for the right one.
  [[nodiscard]] Claim claim(const Presented& presented);

  /// A new session without a connection or a name. Errors: hub_full.
  [[nodiscard]] Result<Session*, proto::Goodbye> create(std::optional<std::uint16_t> shard_hint,
                                                        std::chrono::milliseconds now,
                                                        Places places = Places::ordinary);
  /// Why no newcomer can be given an id; nothing: one can.
  [[nodiscard]] std::optional<proto::Goodbye> id_refusal(std::chrono::milliseconds now);
  /// The session of a token whose index is free, under its former id. Errors: hub_full.
  [[nodiscard]] Result<Session*, proto::Goodbye> restore(const SessionToken& token,
                                                         std::optional<std::uint16_t> shard_hint,
                                                         std::chrono::milliseconds now,
                                                         Places places = Places::ordinary);
  /// A connection was admitted for the session. What the node says on it tells that it read
  /// WELCOME.
  void attach(Session& session, std::chrono::milliseconds now);
  /// The session counts in that crowd from now on, and in no other. "": in none.
  void move_to_crowd(Session& session, std::string_view crowd);
  /// The session's connection is gone: its grace time begins. REQUIRES: it is connected.
  void begin_grace(Session& session, std::chrono::milliseconds now,
                   Declared declared = Declared::nothing);
  /// Tokens of the session count as none from now on.
  void spend_token(const Session& session);
  /// The same for a session that is not there.
  void spend_token(const SessionToken& token) { floor_.raise(token.index, token.number + 1); }
  /// The same, also after a restart, for as long as limits.kicked_tokens allows. False: it does not
  /// allow that now.
  [[nodiscard]] bool remember_kicked(const Session& session);
  [[nodiscard]] const std::vector<SessionToken>& kicked() const { return kicked_; }
  /// Keeps where it outlives the hub, at once, which ids are used: "", or why it could not.
  using KeepNow = std::function<std::string()>;
  /// Takes an index for renumber(). Errors: taken (held, at rest, or perhaps that of a node that
  /// has not come back since a restart), bad_request (no index of a node), limit (it cannot be
  /// kept, and the hub could give the index to another node after a restart). nullopt: done.
  [[nodiscard]] std::optional<proto::Refusal> take_index(const Session& session, NodeIndex index,
                                                         std::chrono::milliseconds now,
                                                         const KeepNow& keep);
  /// The session goes on under an index that take_index() took; the former one rests, and leads
  /// here until somebody else has it.
  void renumber(Session& session, NodeIndex index, std::chrono::milliseconds now);
  /// Until when nodes that were here before a restart may still be on their way back, each under an
  /// index that counts as used. Nothing: there were none.
  [[nodiscard]] std::optional<std::chrono::milliseconds> returns_until() const {
    return returns_until_;
  }
  /// The time for which that is still so. Not above 0: no longer.
  [[nodiscard]] std::chrono::milliseconds returns_expected_for(
      std::chrono::milliseconds now) const {
    return returns_until_ ? *returns_until_ - now : std::chrono::milliseconds{0};
  }
  /// The hub stood still for so long, and nobody could come back: grace times, and the time after a
  /// restart, did, too.
  void stood_still(std::chrono::milliseconds time, std::chrono::milliseconds now);
  /// Under which index a node goes on that had this one: the same, unless renumber() gave it
  /// another.
  [[nodiscard]] NodeIndex present_index(NodeIndex index) const;
  /// The indices that the session's node had before.
  [[nodiscard]] std::vector<NodeIndex> former_indices(const Session& session) const;

  /// The session is over: its slot is free at once, its index after it has rested. Tokens of
  /// indices that it had before count as none from now on.
  void end(Session& session, std::chrono::milliseconds now);

  /// A session whose grace time is over, or nullptr. The caller ends it and asks again.
  [[nodiscard]] Session* next_expired(std::chrono::milliseconds now);
  /// The session that is away longest of those that declared nothing, else of all; nullptr: nobody
  /// is away. The caller ends it.
  [[nodiscard]] Session* longest_away();
  /// Sessions within their grace time.
  [[nodiscard]] std::size_t away() const { return sessions_.size() - connected_; }
  /// Why nobody can be taken in, though so many sessions end first; nothing: there is room.
  [[nodiscard]] std::optional<proto::Goodbye> full_refusal(Places places,
                                                           std::size_t ending = 0) const;
  /// The session of that crowd that is away longest, or nullptr. The caller ends it.
  [[nodiscard]] Session* longest_away_of(std::string_view crowd);
  /// Sessions of that crowd within their grace time.
  [[nodiscard]] std::size_t away_of(std::string_view crowd);
  /// Why nobody of that crowd can be taken in, though so many of its sessions end first; nothing:
  /// it has less than half of the places.
  [[nodiscard]] std::optional<proto::Goodbye> crowd_refusal(std::string_view crowd,
                                                            std::size_t ending = 0);
  /// Are there as many sessions as the limit allows?
  [[nodiscard]] bool full() const { return sessions_.size() >= limits_.nodes; }
  /// When to ask next_expired() again; nothing if nobody is away.
  [[nodiscard]] std::optional<std::chrono::milliseconds> next_expiry() const;

  [[nodiscard]] Session* find(NodeIndex index);
  [[nodiscard]] const Session* find(NodeIndex index) const;
  /// By ascending index.
  [[nodiscard]] const std::map<NodeIndex, Session>& all() const { return sessions_; }
  [[nodiscard]] std::size_t connected() const { return connected_; }
  /// Places on the shards, of which links have some, too.
  [[nodiscard]] SlotPool& slots() { return slots_; }
  [[nodiscard]] IndexPool& indices() { return indices_; }
  [[nodiscard]] const IndexPool& indices() const { return indices_; }

 private:
  /// The index that a session moved to, and the number that its tokens had when it was there.
  struct Moved {
    NodeIndex index;
    SessionNumber number = 0;
  };
  /// The next of `away` that is due at `now`, taken off the list, or nullptr.
  [[nodiscard]] Session* take_due(DueList<Absence>& away, std::chrono::milliseconds now);
  Session& put(NodeIndex index, SessionNumber number, std::optional<std::uint16_t> shard_hint,
               std::chrono::milliseconds now);
  /// Why that id cannot be given to another node.
  [[nodiscard]] std::string why_taken(NodeId node, std::chrono::milliseconds now) const;
  /// Is it still the absence that was noted?
  [[nodiscard]] bool still_away(const Absence& away) const;

  const Limits& limits_;
  const HubId hub_;
  const Placement placement_;
  const Secret secret_;
  std::optional<std::chrono::milliseconds> returns_until_;
  SessionNumber last_number_;
  IndexPool indices_;
  NumberFloor floor_;
  std::vector<SessionToken> kicked_;  ///< the latest last
  SlotPool slots_;
  std::map<NodeIndex, Session> sessions_;
  std::map<NodeIndex, Moved> renumbered_;  ///< by former index
  Crowds crowds_;
  // All grace times are equal, so each list is in the order of absence. There are two, so that
  // longest_away() finds one that declared nothing at once.
  DueList<Absence> away_idle_;
  DueList<Absence> away_declared_;
  std::size_t connected_ = 0;
};

}  // namespace gimnet::hub
