#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/ids.hpp"
#include "base/result.hpp"
#include "hub/control/state/index_pool.hpp"
#include "hub/control/state/place.hpp"
#include "hub/control/state/slot_pool.hpp"
#include "hub/limits.hpp"
#include "proto/control/link.hpp"

namespace gimnet::hub {

/// 32 random bytes that only the session's node knows.
using Secret = std::array<std::byte, 32>;

/// Where a connection came from, as people read it: "tcp" and "127.0.0.1:41234", or "unix" and "pid 77 uid 1000".
struct Origin {
  std::string transport;
  std::string address;
};

/// A node's membership of this hub: outlives its connections by the grace time.
struct Session {
  std::uint32_t index = 0;  ///< of its node id
  Place place;
  Secret secret{};
  proto::Role role{};
  bool connected = false;
  std::uint32_t attachment = 0;  ///< of the latest connection, counted from 1
  std::string name;              ///< "" for a node without one
  std::string description;
  Origin origin;                             ///< of the latest connection
  std::chrono::milliseconds joined{};        ///< when the session began
  std::chrono::milliseconds connected_at{};  ///< when its latest connection was admitted
  /// How the hub closed its last connection; told at its next WELCOME.
  std::optional<proto::GoodbyeCode> close_code;
  std::string close_sentence;
};

/// Why somebody was not let in: what GOODBYE says.
using Refusal = proto::Goodbye;

enum class Placement : std::uint8_t { spread, hint };

/// All sessions of a hub: ids, places, tokens, grace times. Time and randomness are arguments.
/// Thread safety: none. Ownership: a Session& is good until end(). Limits: limits.nodes.
class Sessions {
 public:
  struct Options {
    HubId hub{1};
    std::size_t shards = 1;
    Placement placement = Placement::spread;
  };
  Sessions(const Options& options, const Limits& limits);

  [[nodiscard]] NodeId node_id(const Session& session) const { return make_id<NodeId>(hub_, session.index); }

  /// What a node shows to get its session back: its index and its secret.
  [[nodiscard]] static std::vector<std::byte> token_of(const Session& session);
  /// The session whose token this is, or nullptr. Takes as long for a wrong secret as for the right one.
  [[nodiscard]] Session* claim(std::span<const std::byte> token);

  /// A new session without a connection or a name. `secret` is fresh randomness. Errors: hub_full.
  [[nodiscard]] Result<Session*, Refusal> create(const Secret& secret, std::optional<std::uint16_t> shard_hint,
                                                 std::chrono::milliseconds now);
  /// A connection was admitted for the session.
  void attach(Session& session, std::chrono::milliseconds now);
  /// The session's connection is gone: its grace time begins. REQUIRES: it is connected.
  void begin_grace(Session& session, std::chrono::milliseconds now);
  /// The session is over: its slot is free at once, its index after it has rested.
  void end(Session& session, std::chrono::milliseconds now);

  /// A session whose grace time is over, or nullptr. The caller ends it and asks again.
  [[nodiscard]] Session* next_expired(std::chrono::milliseconds now);
  /// The session without a name that is away longest, or nullptr. The caller ends it.
  [[nodiscard]] Session* longest_away_nameless();
  /// Are there as many sessions as the limit allows?
  [[nodiscard]] bool full() const { return sessions_.size() >= limits_.nodes; }
  /// When to ask next_expired() again; nothing if nobody is away.
  [[nodiscard]] std::optional<std::chrono::milliseconds> next_expiry() const;

  [[nodiscard]] Session* find(std::uint32_t index);
  [[nodiscard]] const Session* find(std::uint32_t index) const;
  /// By ascending index.
  [[nodiscard]] const std::map<std::uint32_t, Session>& all() const { return sessions_; }
  [[nodiscard]] std::size_t connected() const { return connected_; }

 private:
  struct Away {
    std::chrono::milliseconds until;
    std::uint32_t index;
    std::uint32_t generation;
    std::uint32_t attachment;
  };
  /// The next of `away` that is due at `now`, taken off the list, or nullptr.
  [[nodiscard]] Session* take_due(std::deque<Away>& away, std::chrono::milliseconds now);
  /// Is it still the absence that was noted?
  [[nodiscard]] bool still_away(const Away& away) const;

  const Limits& limits_;
  const HubId hub_;
  const Placement placement_;
  IndexPool indices_;
  SlotPool slots_;
  std::map<std::uint32_t, Session> sessions_;
  // Both in the order of `until`, since all grace times are equal. Apart, so that a nameless one is found at once.
  std::deque<Away> away_named_;
  std::deque<Away> away_nameless_;
  std::size_t connected_ = 0;
};

}  // namespace gimnet::hub
