#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "hub/control/state/directory.hpp"
#include "hub/control/state/due_list.hpp"
#include "hub/control/state/effects.hpp"
#include "hub/control/state/identity.hpp"
#include "hub/control/state/index_pool.hpp"
#include "hub/control/state/services.hpp"
#include "hub/control/state/session_token.hpp"
#include "hub/control/state/sessions.hpp"
#include "hub/control/state/topics.hpp"

namespace gimnet::hub {

/// The part of the state machines that is to outlive the hub. A value type.
struct Durable {
  IndexPool::Grant nodes;
  IndexPool::Grant groups;
  std::vector<SessionToken> kicked;
};

/// The request of a HELLO, and its sender.
struct JoinRequest {
  proto::Role role{};
  std::string name;                  ///< "": none, or the one that the session has
  std::span<const std::byte> token;  ///< empty: none
  Identity identity;                 ///< who the peer is, as its connection proves it
  Rights rights;                     ///< of the peer
  std::string description;
  std::optional<std::uint16_t> shard_hint;
  PeerAddress origin;
  std::string crowd;     ///< that the peer counts in: its address, or its user; "": none
  bool resumes = false;  ///< it asks for resume
  std::chrono::milliseconds wall{};  ///< since 1970: tokens expire by it
  NodeId former;  ///< the id that the node had; at this hub or another one; 0: none
  /// The hub of `former` let go of it, and it had the best claim to the name: older claims, of hubs
  /// that cannot be reached, do not count.
  bool had_name = false;
};

/// The state of one hub without its neighbours: its nodes, their names and services. Makes sure
/// that sessions, names and services agree with each other. Thread safety: none. Time and
/// randomness are arguments; the effects that it returns are to be carried out.
class Membership {
 public:
  Membership(const Sessions::Options& options, const Limits& limits);

  struct Joined {
    Session* session = nullptr;
    bool new_session = false;  ///< also one that a token brought back under its former id
  };
  /// Admits a connection, for a new session or for the one whose token it shows. The caller
  /// attaches it at its shard and publishes its place after the effects were carried out. Errors:
  /// what GOODBYE says.
  [[nodiscard]] Result<Joined, proto::Goodbye> join(const JoinRequest& request,
                                                    std::chrono::milliseconds now,
                                                    Effects& effects);

  /// The end of a connection.
  struct Ending {
    bool said_by_peer = false;
    proto::GoodbyeCode code{};
    std::string sentence;
  };
  /// A connection of the session ended. The session ends with it if the node said so, or if the
  /// node has no name and did not ask for resume or was closed for what it sent. Else its grace
  /// time begins. REQUIRES: connected.
  void connection_ended(Session& session, const Ending& ending, std::chrono::milliseconds now,
                        Effects& effects);

  /// Keeps durable(). None: a StateDue among the effects asks for it.
  using KeepNow = Sessions::KeepNow;
  /// Ends the session for good: its id and name are free, its token counts as none, also after a
  /// restart, unless the answer says why not. `sentence` tells its node who did it and what to do.
  std::string kick(Session& session, const std::string& sentence, std::chrono::milliseconds now,
                   Effects& effects, const KeepNow& keep = {});

  /// A node of this hub has shown its token to another hub, and is its node from now on: its
  /// session ends, and its token counts as none. False: the token is not honoured here, or another
  /// node of this hub, or a service, has the name.
  [[nodiscard]] bool let_go(const Sessions::Presented& presented, std::chrono::milliseconds now,
                            Effects& effects);

  /// The session's node goes on under another index, with name, services, subscriptions and token.
  /// Errors: taken (held, at rest, or perhaps that of a node that has not come back since a
  /// restart), bad_request (no index of a node), limit (it cannot be kept, and the hub could give
  /// the index to another node after a restart). nullopt: done.
  [[nodiscard]] std::optional<proto::Refusal> renumber(Session& session, NodeIndex index,
                                                       std::chrono::milliseconds now,
                                                       Effects& effects, const KeepNow& keep = {});

  /// The state that has to outlive the hub. A StateDue among the effects asks to keep it. A
  /// newcomer gets only indices that state_kept() or the start granted, so that no crash makes two
  /// nodes of one id.
  [[nodiscard]] Durable durable(std::chrono::milliseconds now) const;
  /// Is there reason to keep it although nothing happened that asks for it?
  [[nodiscard]] bool keeping_due(std::chrono::milliseconds now) const;
  /// That was kept where it outlives the hub. REQUIRES: durable() answered it, and nothing happened
  /// since.
  void state_kept(const Durable& durable);
  /// It could not be.
  void state_not_kept();
  /// The node takes that name in place of the one it has, or, for "", goes on without one. A rival
  /// is judged as when it joins. What the node provides is withdrawn, as its full names were the
  /// old one's: it advertises anew. Errors: taken, bad_request. nullopt: done.
  [[nodiscard]] std::optional<proto::Refusal> rename(Session& session, const std::string& name,
                                                     std::chrono::milliseconds now,
                                                     Effects& effects);

  /// The network of hubs has these names from now on: nobody gets one that another hub holds.
  /// Lifetime: they outlive this.
  void join_network(const NameCopies& names) { directory_.join_network(names); }
  /// A node of another hub has the better claim to a name of this hub: its node goes on without
  /// one, or its service ends. Nothing happens for a name that nobody here has.
  void lose_name(const std::string& name, NodeId holder, const std::string& sentence,
                 std::chrono::milliseconds now, Effects& effects);

  /// The hub stood still for so long until now, and nobody could come back or declare anything:
  /// what would have run out meanwhile has its time again. To be said before tick().
  void stood_still(std::chrono::milliseconds time, std::chrono::milliseconds now);
  /// Ends what is overdue.
  void tick(std::chrono::milliseconds now, Effects& effects);
  /// When tick() has something to do; nothing while nothing runs out.
  [[nodiscard]] std::optional<std::chrono::milliseconds> next_deadline() const;

  [[nodiscard]] Sessions& sessions() { return sessions_; }
  [[nodiscard]] const Sessions& sessions() const { return sessions_; }
  [[nodiscard]] const Directory& directory() const { return directory_; }
  [[nodiscard]] Topics& topics() { return topics_; }
  [[nodiscard]] const Topics& topics() const { return topics_; }
  [[nodiscard]] Services& services() { return services_; }
  [[nodiscard]] const Services& services() const { return services_; }

 private:
  struct Redeclaring {
    std::chrono::milliseconds until;
    NodeIndex index;
    std::uint32_t generation;
    std::uint32_t attachment;
  };
  /// Is it still the return that was noted?
  [[nodiscard]] bool still_redeclares(const Redeclaring& due) const;
  [[nodiscard]] std::optional<proto::Goodbye> check(const JoinRequest& request) const;
  /// The session that the request is for: the one whose token it shows, or a new one.
  [[nodiscard]] Result<Joined, proto::Goodbye> session_for(const JoinRequest& request,
                                                           const Sessions::Claim& claim,
                                                           std::chrono::milliseconds now,
                                                           Effects& effects);
  /// Is nobody waiting for the session's node to come back?
  [[nodiscard]] static bool ends_with_connection(const Session& session, const Ending& ending);
  /// A name's holder within its grace time makes way for `claimant`. REQUIRES: directory_.refusal()
  /// saw no reason.
  void end_absent_holder(const std::string& name, const Session* claimant,
                         std::chrono::milliseconds now, Effects& effects);
  /// Why there is no room for that newcomer even when all made way who have to: before any of them
  /// does.
  [[nodiscard]] std::optional<proto::Goodbye> room_refusal(const JoinRequest& request,
                                                           const Sessions::Claim& claim,
                                                           std::chrono::milliseconds now);
  /// At the limit on nodes, the session that is away longest makes way for a newcomer: first of
  /// those that declared nothing, then of all.
  void make_room(std::string_view crowd, std::chrono::milliseconds now, Effects& effects);
  void take_name(Session& session, const std::string& name, std::chrono::milliseconds now,
                 Effects& effects);
  void end(Session& session, std::chrono::milliseconds now, Effects& effects);

  const Limits& limits_;
  Sessions sessions_;
  Topics topics_;
  Services services_;
  Directory directory_;
  DueList<Redeclaring> redeclaring_;
};

}  // namespace gimnet::hub
