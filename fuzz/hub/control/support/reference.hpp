#pragma once

#include <compare>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include "fuzz/hub/control/support/control_hub.hpp"
#include "fuzz/hub/control/support/watch_view.hpp"
#include "tests/hub/control/support/allowance.hpp"

namespace gimnet::fuzz {

/// What a hub owes its nodes, in maps, written from docs/protocol.md. It follows each step of a hub
/// and ends in an abort at the first difference. It shares nothing with the hub but the messages,
/// names and patterns (src/proto) and the limits; where the hub may choose (the id of a newcomer)
/// the choice is taken over, if it was allowed.
class Reference {
 public:
  explicit Reference(const hub::Limits& limits) : limits_(limits) {}

  struct Terms {
    std::uint32_t window = 0;
    std::uint32_t depth = 1;
    std::uint32_t interval_us = 0;
    friend auto operator<=>(const Terms&, const Terms&) = default;
  };
  struct Session {
    std::uint32_t index = 0;
    std::uint64_t number = 0;  ///< in its tokens
    Seat seat;
    bool connected = false;
    bool renumbered = false;  ///< and not heard of since it was welcomed
    std::uint32_t attachment = 0;
    proto::Role role{};
    std::string name;
    std::string description;
    std::string place;
    bool in_crowd = false;  ///< counts for its address
    bool resumes = false;   ///< asked for it, the last time
    std::string identity;
    std::string token_name;
    milliseconds token_expiry{};
    milliseconds joined{};
    milliseconds away_until{};  ///< while it is not connected
    std::uint64_t away_order = 0;
    std::optional<milliseconds> declare_until;  ///< after a return
    std::uint64_t life = 0;                     ///< counts its returns
    std::map<std::string, std::uint64_t>
        provides;  ///< full name: the life in which it was declared last
    std::map<std::string, std::uint64_t> subscribes;  ///< the same
    std::map<std::uint32_t, WatchView> watches;
    std::uint16_t last_goodbye = 0;
    // Of the session, so that a new connection is no way to get more
    hub::Allowance declarations;
    hub::Allowance oddities;
  };
  struct Service {
    std::uint32_t group = 0;
    std::uint64_t provider = 0;
    proto::ns::Advertise terms;
    friend bool operator==(const Service&, const Service&) = default;
  };
  struct Topic {
    std::optional<Service> service;
    std::map<std::uint64_t, Terms> subscribers;
    /// Those that changed their terms in this group: they got everything and are paced now, or the
    /// reverse.
    std::set<std::uint64_t> once_plain;
    std::set<std::uint64_t> once_paced;
  };

  // ---- steps that were done; each looks at what came of it

  /// Returns the session that was let in, 0: none.
  std::uint64_t came(const Stranger& who, const ControlHub& hub,
                     const std::optional<proto::Goodbye>& refusal);
  void ended(const Line& line, bool said_by_peer, proto::GoodbyeCode code, const ControlHub& hub);
  void passed(const ControlHub& hub);
  /// `after` is the hub's answer, if it gave one.
  void asked(const Line& line, proto::Kind kind, std::span<const std::byte> payload, NodeId dst,
             const std::optional<proto::Payload>& answer, const ControlHub& hub);
  void served(const ControlHub& hub);
  void draining() { draining_ = true; }
  /// The configuration that the next RELOAD finds.
  void expect_reload(const hub::Reloading& reloading) { next_reload_ = reloading; }

  /// Compares everything else that the step did: tables, commands, events, notes for those who
  /// watch.
  void compare(const ControlHub& hub);
  /// Each watch agrees with what there is, now that it was told everything.
  void require_agreed_watches() const;

  [[nodiscard]] const std::map<std::uint64_t, Session>& sessions() const { return sessions_; }
  [[nodiscard]] const std::map<std::uint32_t, std::string>& groups() const { return groups_; }
  /// A proof that was given for a group: of those for that index, and of all, the latest. Empty:
  /// none was.
  [[nodiscard]] const std::vector<std::byte>& proof_of(std::uint32_t group) {
    return latest_proofs_[group];
  }
  [[nodiscard]] const std::vector<std::byte>& latest_proof() const { return latest_proof_; }
  [[nodiscard]] const hub::Limits& limits() const { return limits_; }
  [[nodiscard]] LogLevel level() const { return level_; }
  [[nodiscard]] bool drain_wanted() const { return drain_wanted_; }

 private:
  struct Token {
    std::uint32_t index = 0;
    std::uint64_t number = 0;
    std::string name;
    std::string identity;
    milliseconds expiry{};
  };
  struct Moved {
    std::uint64_t session = 0;
    std::uint64_t number = 0;
  };
  struct Verdict {
    std::optional<proto::GoodbyeCode> refusal;
    std::uint64_t session = 0;         ///< whose token it is
    std::optional<Token> former = {};  ///< of a session that is over
  };
  /// What somebody has to be told, numbers apart: those who go in one step may be told of in any
  /// order.
  using Event = std::tuple<std::uint64_t, std::uint16_t, std::string, std::uint32_t, std::uint32_t,
                           std::uint32_t>;
  using Count = std::tuple<std::uint64_t, std::uint32_t, std::uint32_t>;
  /// What those who watch have to hear: kind, node or group, name, former name.
  using Note = std::tuple<std::uint8_t, bool, std::uint32_t, std::string, std::string>;
  struct Asked {
    std::uint64_t id = 0;
    Session& session;
    std::span<const std::byte> payload;
    std::span<const std::byte> answer;
    const ControlHub& hub;
  };

  // Sessions and names
  [[nodiscard]] Verdict judge(const Stranger& who, milliseconds wall) const;
  void judge_token(const Stranger& who, milliseconds wall, Verdict& verdict) const;
  [[nodiscard]] std::optional<proto::GoodbyeCode> judge_name(const std::string& name,
                                                             std::uint64_t claimant) const;
  [[nodiscard]] std::uint64_t longest_away(std::uint64_t but) const;
  [[nodiscard]] std::uint64_t places_for(proto::Role role) const;
  std::uint64_t take_in(const Verdict& verdict, const hub::AttachCommand& attach,
                        const ControlHub& hub);
  void take_name(std::uint64_t id, const std::string& name, milliseconds now);
  void end(std::uint64_t id, milliseconds now);
  void spend_tokens(const Session& session);
  void drop_undeclared(std::uint64_t id, milliseconds now);
  [[nodiscard]] bool is_free(const std::map<std::uint32_t, milliseconds>& resting,
                             std::uint32_t index, milliseconds now) const;
  [[nodiscard]] milliseconds rests_until(milliseconds now) const;
  /// The session that has the index, or had it before it was given another; 0: none.
  [[nodiscard]] std::uint64_t holder_of(std::uint32_t index) const;
  /// Does the line lead to a session, by its latest connection?
  [[nodiscard]] bool is_current(const Line& line) const;

  // Services
  [[nodiscard]] std::optional<Terms> pace_of(const Topic& topic, std::uint64_t subscriber) const;
  void note_proof(std::uint32_t group, const std::string& full_name,
                  const std::vector<std::byte>& proof);
  [[nodiscard]] bool is_proven(const std::string& full_name,
                               const proto::ns::Advertise& terms) const;
  void open_group(const Asked& asked, const std::string& full_name, std::uint32_t group,
                  const proto::ns::Advertise& terms);
  void withdraw(const std::string& full_name, milliseconds now);
  void leave_group(const std::string& full_name, milliseconds now);
  void unsubscribe(std::uint64_t id, const std::string& full_name);
  void forget_if_unused(const std::string& full_name);
  void tell_moved(const std::string& full_name, std::uint32_t old_group, std::uint32_t new_group,
                  const proto::ns::Advertise& terms);
  void tell_provider(const std::string& full_name, std::uint32_t subscriber, bool joined,
                     std::size_t count);

  // Requests
  /// One more name, service or subscription that is begun or changed. False: the answer must be
  /// `rate`.
  [[nodiscard]] bool may_declare(const Asked& asked);
  /// After an answer of no use to anybody: the connection is closed if there were too many.
  void count_oddity(const Asked& asked);
  void dispatch_names(const Asked& asked, std::uint16_t operation);
  void dispatch_services(const Asked& asked, std::uint16_t operation);
  void dispatch_control(const Asked& asked, std::uint16_t operation);
  void on_register(const Asked& asked);
  void on_unregister(const Asked& asked);
  void renamed(const Asked& asked, const std::string& name, const std::vector<std::byte>& token);
  void on_resolve(const Asked& asked) const;
  void on_reverse(const Asked& asked) const;
  void on_list(const Asked& asked) const;
  void on_services(const Asked& asked) const;
  void on_advertise(const Asked& asked);
  /// Is there anything wrong with it by itself?
  [[nodiscard]] proto::Status judge_terms(const Asked& asked,
                                          const proto::ns::Advertise& offer) const;
  [[nodiscard]] bool terms_fit(const Asked& asked, const proto::ns::Subscribe& wanted) const;
  [[nodiscard]] proto::Status judge_offer(const Asked& asked, const proto::ns::Advertise& offer);
  void on_withdraw(const Asked& asked);
  void on_subscribe(const Asked& asked);
  void on_unsubscribe(const Asked& asked);
  void on_watch(const Asked& asked);
  void on_unwatch(const Asked& asked);
  void on_watch_taken(const Asked& asked);
  void on_hub_info(const Asked& asked) const;
  void on_statistics(const Asked& asked) const;
  void on_connections(const Asked& asked) const;
  void on_routes(const Asked& asked) const;
  void on_kick(const Asked& asked);
  void on_reassign(const Asked& asked);
  void renumber(std::uint64_t id, std::uint32_t index, milliseconds now);
  void on_drain(const Asked& asked);
  void on_reload(const Asked& asked);
  void on_log_level(const Asked& asked);

  // Comparison
  void compare_sessions(const ControlHub& hub) const;
  void compare_tables(const ControlHub& hub) const;
  void compare_group(const hub::GroupMembers& members, const Topic& topic) const;
  void compare_events(const ControlHub& hub);
  void compare_notes(const ControlHub& hub);
  void compare_commands(const ControlHub& hub);
  void compare_paces(const ControlHub& hub);
  void compare_deadline(const ControlHub& hub) const;

  [[nodiscard]] static NodeId id_of(std::uint32_t index) {
    return make_id<NodeId>(ControlHub::kHub, index);
  }
  [[nodiscard]] static GroupId group_id(std::uint32_t index) {
    return make_id<GroupId>(ControlHub::kHub, index);
  }
  [[nodiscard]] std::uint64_t session_at(const Seat& seat) const;
  void note_node(proto::ns::ChangeKind kind, const Session& session,
                 const std::string& former_name = {});
  void note_service(proto::ns::ChangeKind kind, std::uint32_t group, const std::string& full_name);

  hub::Limits limits_;
  std::map<std::uint64_t, Session> sessions_;
  std::map<std::uint32_t, std::uint64_t> by_index_;
  std::map<std::string, std::uint64_t> names_;
  std::map<std::string, Topic> topics_;
  std::map<std::uint32_t, std::string> groups_;
  std::map<std::uint32_t, milliseconds> resting_nodes_;
  std::map<std::uint32_t, milliseconds> resting_groups_;
  std::map<std::uint32_t, Moved> moved_;  ///< by the index that a session had before
  std::map<std::uint32_t, std::uint64_t>
      least_;  ///< index: sessions of a lower number are over for good
  std::map<std::vector<std::byte>, Token> tokens_;
  std::map<std::vector<std::byte>, std::pair<std::uint32_t, std::string>>
      proofs_;                                                     ///< of which group and full name
  std::map<std::uint32_t, std::vector<std::byte>> latest_proofs_;  ///< by group
  std::vector<std::byte> latest_proof_;
  std::set<std::uint32_t> nodes_given_;
  std::set<std::uint32_t> groups_given_;
  std::uint64_t ids_ = 0;
  std::uint64_t numbers_ = 0;
  std::uint64_t orders_ = 0;
  std::map<std::pair<proto::Kind, std::uint16_t>, std::uint64_t> asked_;
  LogLevel level_ = LogLevel::info;
  bool drain_wanted_ = false;
  bool draining_ = false;
  std::optional<hub::Reloading> next_reload_;

  // Of this step
  std::vector<Event> due_;
  std::vector<Count> counts_;
  std::vector<Note> notes_;
  std::vector<Seat> released_;
  std::map<Seat, proto::GoodbyeCode> closed_;
  std::vector<std::pair<Seat, std::uint32_t>> renumbered_;
  std::vector<std::pair<std::uint32_t, std::uint64_t>>
      dropped_;  ///< groups whose last message goes, providers
  bool reloaded_ = false;

  std::uint64_t version_ = 0;               ///< of names and services
  std::optional<std::uint64_t> kept_from_;  ///< the version when the first watch began
  std::map<std::pair<Seat, std::uint32_t>, std::pair<Terms, bool>>
      paces_;  ///< as the shards were told
};

/// The answer's status is this one.
void require_status(std::span<const std::byte> answer, proto::Status status);

}  // namespace gimnet::fuzz
