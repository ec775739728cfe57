#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "hub/control/acceptor.hpp"
#include "hub/control/state/hub_state.hpp"
#include "hub/limits.hpp"
#include "hub/shard/commands.hpp"
#include "proto/control/link.hpp"
#include "proto/control/ns.hpp"
#include "tests/hub/control/support/allowance.hpp"
#include "tests/sim/census.hpp"
#include "tests/sim/checker.hpp"
#include "tests/sim/shards.hpp"

namespace gimnet::sim {

using std::chrono::milliseconds;

/// An event that somebody must be told: the present state of that service.
struct DueEvent {
  std::uint32_t to = 0;  ///< node index
  std::uint16_t operation = 0;
  std::string name;  ///< full name of the service
  friend auto operator<=>(const DueEvent&, const DueEvent&) = default;
};

/// A token as the hub gave it out.
struct GivenToken {
  std::uint32_t index = 0;
  std::uint64_t number = 0;  ///< Model::Session::token_number
  std::string name;
  hub::Identity identity;
  milliseconds expiry{};  ///< since 1970
};

/// Whose tokens count as none, also after a restart.
struct Kicked {
  std::uint32_t index = 0;
  std::uint64_t number = 0;
  milliseconds expiry{};
};

/// Indices that were given out in earlier lives, and that a hub must not give to newcomers as long
/// as it has others, nor while those who had them may come back.
struct GivenIds {
  std::set<std::uint32_t> given;
  std::uint32_t old = 0;  ///< all up to this one were given before the world began
  hub::IndexSet used;     ///< what this life began with: those, and what was granted and not given

  [[nodiscard]] bool contains(std::uint32_t index) const {
    return index <= old || given.contains(index);
  }
  /// So few others that the hub may run out of them.
  [[nodiscard]] bool few_left() const { return kEveryIndex - 1 - old < 1'000; }
};

/// The part of a hub that outlives it: tokens that nodes hold, and indices that must not go to
/// newcomers any more.
struct Past {
  std::map<std::vector<std::byte>, GivenToken> tokens;
  GivenIds nodes;
  std::set<std::uint32_t> groups;  ///< of the life before
  std::vector<Kicked> kicked;
  std::uint64_t token_numbers = 0;  ///< given so far
  milliseconds returns_until{};     ///< nodes of the past may come back under their ids
};

/// The reference: what a hub owes its nodes, kept in the plainest way, from what the conductor was
/// told and what it answered. It shares no code with the hub but the messages, names and patterns
/// (src/proto). Where the hub may choose (a new id) the model takes the choice over and checks that
/// it was allowed. Thread safety: none. Errors: Broken, thrown at the first difference.
class Model final : public Witness {
 public:
  Model(const hub::Limits& limits, Census& census, HubId hub, Past past);

  struct Session {
    std::uint64_t number = 0;        ///< of all sessions, never given twice
    std::uint64_t token_number = 0;  ///< which tokens are its own; another one with each id
    hub::Allowance declarations;
    hub::Allowance oddities;
    bool held_back = false;  ///< by the rate of declarations, the last time
    proto::Role role{};
    bool connected = false;
    bool renumbered = false;  ///< and has not come back since
    std::uint32_t attachment = 0;
    std::string name;
    std::string description;
    std::string place;
    std::string crowd;       ///< as of crowd_of()
    bool resumes = false;    ///< asked for it, the last time
    std::string token_name;  ///< for which its last token was given
    hub::Identity identity;
    milliseconds token_expiry{};  ///< since 1970
    std::set<std::uint32_t> watches;
    milliseconds joined{};
    milliseconds away_until{};     ///< while it is not connected
    std::uint64_t away_order = 0;  ///< who went first
    milliseconds declare_until{};  ///< after a return
    std::uint64_t declare_order = 0;
    std::uint32_t life = 0;  ///< counts its returns
    bool declares = false;
    std::map<std::string, std::uint32_t>
        provides;  ///< full name: life in which it was declared last
    std::map<std::string, std::uint32_t> subscribes;  ///< the same
    std::uint16_t last_goodbye = 0;
  };
  struct Service {
    std::uint32_t group = 0;
    std::uint32_t provider = 0;
    proto::ns::Advertise terms;
    std::uint64_t stream = 0;  ///< of all, never given twice; 0: nobody provides it
    /// It accepts, and its node has not advertised it on its present connection.
    bool away = false;
    [[nodiscard]] bool provided() const { return provider != 0; }
  };
  /// The most that a subscriber wants of a service; 0: without a bound.
  struct Terms {
    std::uint32_t window = 0;
    std::uint32_t depth = 1;
    std::uint32_t interval_us = 0;
    std::uint8_t number = 0;  ///< of its counts
    friend bool operator==(const Terms&, const Terms&) = default;
  };
  struct Subscriber {
    Terms terms;
    // In the present group:
    bool once_plain = false;  ///< it got everything, and is paced now
    bool once_paced =
        false;  ///< it was paced and wants no bound any more: it stays so, without one
  };
  /// A full name that somebody provides or waits for, or that still has a group.
  struct Topic {
    std::optional<Service> service;
    std::optional<milliseconds> unused_until;  ///< nobody does: its group is given back then
    std::map<std::uint32_t, Subscriber> subscribers;
  };
  /// n of sync(n); 0: a service without.
  [[nodiscard]] static std::uint32_t window_of(const proto::ns::Advertise& terms);
  /// The pace that the hub owes that subscriber; nothing: every message.
  [[nodiscard]] static std::optional<Terms> pace_of(const Topic& topic, std::uint32_t subscriber);
  /// The state that the subscriber is told of a service, except for the provider's session.
  [[nodiscard]] proto::ns::ServiceState state_of(const Topic& topic,
                                                 std::uint32_t subscriber) const;
  using Topics = std::map<std::string, Topic>;

  // Events that the conductor was told, and their results
  struct Hello {
    const proto::Hello& hello;
    bool may_administer = false;
    std::string place;
    hub::Identity identity;
    milliseconds wall{};
    std::uint64_t new_session = 0;  ///< the number of the session, if it is a new one
  };
  void admitted(const Hello& hello, const hub::AttachCommand& attach, milliseconds now);
  void refused(const Hello& hello, const proto::Goodbye& goodbye, milliseconds now);
  void detached(const hub::DetachedEvent& event, milliseconds now);
  void ticked(milliseconds now);
  void stood_still(milliseconds time, milliseconds now);
  /// The answer to a request, nothing if there was none. `closed`: its connection was closed for
  /// asking in vain.
  void asked(const hub::ControlFrameEvent& event, const hub::SendControlCommand* answer,
             bool closed, milliseconds now);
  /// The hub keeps that on its disk, in the midst of a step.
  void kept(const hub::HubState& state, milliseconds now);
  /// It could not, in the midst of a step.
  void keeping_failed() { keeping_failed_ = true; }
  /// The step is over; `kept`: so is what it brought.
  void step_over(bool kept);
  /// The hub drains from now on: nobody is let in.
  void draining() { draining_ = true; }
  /// An administrator asked for it.
  [[nodiscard]] bool drain_wanted() const { return drain_wanted_; }
  /// The limits that a RELOAD would read now; nothing: the configuration is wrong.
  void configuration(const std::optional<hub::Limits>& limits) { configuration_ = limits; }
  [[nodiscard]] const hub::Limits& limits() const { return limits_; }
  /// Former and present index of those that were given another one since this was last asked.
  using Renumbered = std::vector<std::pair<std::uint32_t, std::uint32_t>>;
  [[nodiscard]] Renumbered take_renumbered() { return std::exchange(renumbered_, {}); }

  /// Does the hub know the connection by which this came?
  [[nodiscard]] const Session* known(const hub::SessionRef& session, NodeId node) const;
  /// The events of this step, each once. Nodes that are not connected are told nothing.
  [[nodiscard]] std::vector<DueEvent> take_due();

  [[nodiscard]] const std::map<std::uint32_t, Session>& sessions() const { return sessions_; }
  [[nodiscard]] const std::map<std::string, std::uint32_t>& names() const { return names_; }
  /// Whose nodes together may have half of the places: the address or user in a place. "":
  /// nobody's.
  [[nodiscard]] static std::string crowd_of(const std::string& place, bool may_administer);
  [[nodiscard]] bool has_half(const std::string& crowd) const;
  /// nullptr: nobody provides it, and nobody waits for it.
  [[nodiscard]] const Topic* topic(const std::string& full_name) const;
  /// By group index. Never null.
  [[nodiscard]] const std::map<std::uint32_t, const Topics::value_type*>& groups() const {
    return groups_;
  }
  [[nodiscard]] std::size_t provided() const;
  /// Group and node indices that were ever given out, in this order.
  [[nodiscard]] const std::vector<std::uint32_t>& groups_given() const { return groups_given_; }
  [[nodiscard]] const std::vector<std::uint32_t>& nodes_given() const { return nodes_given_; }
  /// Groups of which anything changed since this was last asked.
  [[nodiscard]] std::set<std::uint32_t> take_touched() { return std::exchange(touched_, {}); }
  /// Whose session ended since this was last asked.
  [[nodiscard]] std::vector<std::uint32_t> take_ended() { return std::exchange(ended_, {}); }
  /// When something runs out next.
  [[nodiscard]] std::optional<milliseconds> next_deadline() const;

  /// When the hub is killed.
  [[nodiscard]] Past past() const;

  // Witness
  [[nodiscard]] std::uint64_t session_of(std::uint32_t index) const override;
  [[nodiscard]] bool provides(std::uint32_t index, std::uint32_t group) const override;
  [[nodiscard]] bool subscribes(std::uint32_t index, std::uint32_t group) const override;
  [[nodiscard]] std::uint64_t retained_stream(std::uint32_t group) const override;

 private:
  /// The answer that a HELLO must get.
  struct Verdict {
    std::optional<proto::GoodbyeCode> refusal;
    std::uint32_t session = 0;              ///< that is there and whose token it is; 0: none
    std::optional<GivenToken> former = {};  ///< of a session that is not there any more
  };
  [[nodiscard]] Verdict judge(const Hello& hello) const;
  void judge_token(const Hello& hello, Verdict& verdict) const;
  void count_token(const Hello& hello, const Verdict& verdict);
  void take_session(const Hello& hello, const Verdict& verdict, std::uint32_t index,
                    milliseconds now);
  [[nodiscard]] std::optional<proto::GoodbyeCode> judge_name(const std::string& name,
                                                             std::uint32_t claimant) const;
  void make_way(const Hello& hello, const Verdict& verdict, milliseconds now);
  /// The most sessions there may be after a node of that role was let in.
  [[nodiscard]] std::uint64_t places_for(proto::Role role) const;
  /// Would there be no place for it even when all have made way who do?
  [[nodiscard]] bool is_full_for(const Hello& hello) const;
  [[nodiscard]] std::size_t size_of(const std::string& crowd) const;
  [[nodiscard]] bool declares_something(std::uint32_t index) const;
  void make_room(const std::string& crowd, proto::Role role, milliseconds now);
  /// The next one to make way, but not that one; nothing: nobody is away.
  [[nodiscard]] std::optional<std::uint32_t> longest_away(std::uint32_t but) const;
  [[nodiscard]] std::optional<std::uint32_t> longest_away_of(const std::string& crowd,
                                                             std::uint32_t but) const;
  void take_new_index(std::uint32_t index, milliseconds now);
  /// `granted`: that was kept before.
  void give_node(std::uint32_t index, bool granted);
  [[nodiscard]] bool rests(const std::map<std::uint32_t, milliseconds>& resting,
                           std::uint32_t index, milliseconds now) const;
  void take_name(std::uint32_t index, const std::string& name, milliseconds now);
  void end(std::uint32_t index, milliseconds now);
  void rest(std::map<std::uint32_t, milliseconds>& resting, std::uint32_t index, milliseconds now);
  void drop_undeclared(std::uint32_t index, milliseconds now);

  [[nodiscard]] std::size_t subscribers(const std::string& full_name) const;
  [[nodiscard]] const Service* service(const std::string& full_name) const;
  void forget_if_unused(const std::string& full_name);
  void note_if_unused(const std::string& full_name, milliseconds now);
  void give_back_unused(milliseconds now);
  void leave_group(const std::string& full_name, milliseconds now);
  void withdraw(const std::string& full_name, milliseconds now);
  /// Its connection is gone: what it accepts is away.
  void begin_away(const Session& session);
  void unsubscribe(std::uint32_t index, const std::string& full_name, milliseconds now);

  // Requests; each checks the answer
  struct Asked {
    std::uint32_t index = 0;
    Session& session;
    std::span<const std::byte> payload;
    std::span<const std::byte> answer;
    milliseconds now{};
  };
  void judge_names(const Asked& asked, std::uint16_t operation);
  void judge_services(const Asked& asked, std::uint16_t operation);
  void judge_control(const Asked& asked, std::uint16_t operation);
  void judge_admin(const Asked& asked, std::uint16_t operation);
  void judge_kick(const Asked& asked);
  void judge_reassign(const Asked& asked);
  void judge_reload(const Asked& asked);
  void judge_drain(const Asked& asked);
  /// The index of a node that is there, also by one that it had before; 0: none.
  [[nodiscard]] std::uint32_t find_node(NodeId node);
  void kick(std::uint32_t index, milliseconds now);
  void renumber(std::uint32_t index, std::uint32_t to, milliseconds now);
  /// The index under which a node goes on that had this one.
  [[nodiscard]] std::uint32_t present(std::uint32_t index) const;
  [[nodiscard]] std::vector<std::uint32_t> former(std::uint32_t index) const;
  /// One more declaration. False: the answer must be `rate`, and that is counted as `refused`.
  [[nodiscard]] bool may_declare(const Asked& asked, Happening refused);
  void judge_register(const Asked& asked);
  void judge_unregister(const Asked& asked);
  void judge_watch(const Asked& asked);
  void judge_unwatch(const Asked& asked);
  void renamed(const Asked& asked, const std::string& name, const std::vector<std::byte>& token);
  void judge_list(const Asked& asked);
  void judge_service_list(const Asked& asked);
  void judge_connections(const Asked& asked);
  void judge_advertise(const Asked& asked);
  /// The fault of a service's delivery terms, or ok.
  [[nodiscard]] proto::Status judge_delivery(const proto::ns::Advertise& offer) const;
  [[nodiscard]] bool terms_fit(const proto::ns::Subscribe& wanted) const;
  void change_terms(Topic& topic, std::uint32_t subscriber, const Terms& terms);
  void judge_subscribe_answer(const Asked& asked, const Topic& topic);
  void take_over(const Asked& asked, const std::string& full_name, Topic& topic);
  void open_group(const Asked& asked, const std::string& full_name, std::uint32_t group,
                  const proto::ns::Advertise& terms);
  void judge_withdraw(const Asked& asked);
  void judge_subscribe(const Asked& asked);
  void judge_unsubscribe(const Asked& asked);
  void require_status(const Asked& asked, proto::Status status, Checker checker);
  [[nodiscard]] NodeId id(std::uint32_t index) const { return make_id<NodeId>(hub_, index); }
  [[nodiscard]] GroupId group_id(std::uint32_t index) const {
    return make_id<GroupId>(hub_, index);
  }

  /// The place to which a node went, and the number of its tokens there.
  struct Moved {
    std::uint32_t index = 0;
    std::uint64_t token_number = 0;
  };

  hub::Limits limits_;
  Census& census_;
  const HubId hub_;
  std::map<std::uint32_t, Session> sessions_;
  std::map<std::uint32_t, std::uint32_t> generations_;
  std::map<std::string, std::uint32_t> names_;
  Topics topics_;  ///< by full name
  std::map<std::uint32_t, const Topics::value_type*> groups_;
  std::vector<std::uint32_t> groups_given_;
  std::vector<std::uint32_t> nodes_given_;
  std::vector<std::uint32_t> ended_;
  std::set<std::uint32_t> touched_;
  Past past_;  ///< of earlier lives, and the tokens of this one
  std::map<std::uint32_t, std::uint64_t>
      least_;  ///< index: sessions below that number are over for good
  std::map<std::uint32_t, milliseconds> resting_ids_;  ///< index: until when
  std::map<std::uint32_t, milliseconds> resting_groups_;
  std::map<std::uint32_t, Moved> moved_;  ///< by former index
  std::set<std::uint32_t>
      unkept_;                   ///< indices that were not granted, given while nothing can be kept
  bool keeping_failed_ = false;  ///< in this step
  bool few_nodes_left_ = false;  ///< when the last step was over: newcomers may be refused
  std::set<std::uint32_t> forgotten_nodes_;  ///< given in this life, and not kept as used any more
  Renumbered renumbered_;
  std::optional<hub::Limits> configuration_;
  std::set<std::string> moved_services_;  ///< that changed, and whose subscribers are told
  std::set<std::string> resubscribed_;    ///< whose providers are told
  std::uint64_t orders_ = 0;
  std::uint64_t streams_ = 0;
  bool drain_wanted_ = false;
  bool draining_ = false;
};

}  // namespace gimnet::sim
