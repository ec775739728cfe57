#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>

#include "hub/control/acceptor.hpp"
#include "hub/control/effect_runner.hpp"
#include "hub/control/group_links.hpp"
#include "hub/control/handle/request.hpp"
#include "hub/control/hub_facts.hpp"
#include "hub/control/links.hpp"
#include "hub/control/moving_nodes.hpp"
#include "hub/control/network_names.hpp"
#include "hub/control/network_overview.hpp"
#include "hub/control/remote_requests.hpp"
#include "hub/control/shard_proxy.hpp"
#include "hub/control/state/hub_state.hpp"
#include "hub/control/state/membership.hpp"
#include "hub/control/state/watches.hpp"
#include "hub/control/state_keeper.hpp"
#include "hub/control/table_publisher.hpp"
#include "hub/limits.hpp"
#include "hub/observe/counters.hpp"
#include "hub/observe/request_counters.hpp"
#include "hub/observe/session_gauges.hpp"
#include "hub/shard/commands.hpp"

namespace gimnet::hub {

/// The control plane of a hub: admits peers, answers control requests, publishes tables, commands
/// the shards. The event loop around it is conductor_loop.hpp; here are neither sockets to wait for
/// nor clocks. Thread safety: one thread, the conductor's. Lifetime: shards, tables and counters
/// outlive it.
class Conductor final : private Administration {
 public:
  struct Wiring {
    ShardProxy& shards;
    TablePublisher::Tables tables;
    std::span<const ShardCounters* const> counters;    ///< one per shard
    HubStart start{};                                  ///< its state was kept already
    StateKeeper::Keep keep_state{};                    ///< or none: in memory only
    std::span<const SessionGauges* const> sessions{};  ///< one per shard, or none
    RefusalCounters* refusals = nullptr;               ///< or none
    ReadAgain read_again{};  ///< or none: the configuration stays as it is
    std::function<void(LogLevel)>
        note_log_level{};  ///< told of levels that were set by request; or none
    /// Links to other hubs.
    struct Network {
      RouteTable& routes;
      LinksOptions options;
      Links::Dial dial;
      std::function<std::int64_t()> wall_now_ns;  ///< since 1970
      std::function<std::uint64_t()> random;      ///< 64 bits that nobody can guess
    };
    std::optional<Network> network{};  ///< or none: a hub alone
  };
  /// `limits` is what the conductor's thread goes by; reload() changes it.
  Conductor(HubFacts facts, Placement placement, Limits& limits, Wiring wiring);

  /// The two clocks at one moment.
  struct Moment {
    std::chrono::milliseconds now{};  ///< monotonic
    std::int64_t wall_ns = 0;         ///< since 1970
  };
  /// Judges a HELLO: takes the stranger's transport and hands it to a shard, or says why not.
  [[nodiscard]] std::optional<proto::Goodbye> admit(Stranger& stranger, const proto::Hello& hello,
                                                    Moment moment);

  void on_event(ShardEvent event, std::chrono::milliseconds now);
  /// REQUIRES: Wiring::network, whose `dial` asked for it.
  void on_dialled(LinkNumber link, Result<net::Welcomed, net::NetError> outcome,
                  std::chrono::milliseconds now) {
    links_->on_dialled(link, std::move(outcome), moment(now));
  }

  /// As long as something runs out, tick() is to be called so often: from a call that comes later
  /// than that one sees that the hub stood still (stopped, or without a processor), and for how
  /// long.
  static constexpr std::chrono::milliseconds kLookEvery{100};
  /// It did for so long until now: times in which nodes come back run no further by it. To be said
  /// before events are taken.
  void stood_still(std::chrono::milliseconds time, std::chrono::milliseconds now) {
    membership_.stood_still(time, now);
  }
  /// Ends what is overdue and frees what is no longer looked at.
  void tick(std::chrono::milliseconds now);
  /// When tick() has something to do; nothing while nothing runs out.
  [[nodiscard]] std::optional<std::chrono::milliseconds> next_deadline() const;
  /// Do lists wait to be freed? Then tick() wants to be called from time to time.
  [[nodiscard]] bool has_garbage() const { return publisher_.garbage() > 0; }

  /// Tells nodes what they have not heard yet of services and of what they watch, a bounded piece
  /// of it. True: there is more. To be called after events were taken, and again as long as there
  /// is more.
  [[nodiscard]] bool tell_rest(std::chrono::milliseconds now);
  /// Do subscribers wait to be told of services?
  [[nodiscard]] bool tells_later() const { return !runner_.tellings().empty(); }

  /// Reads the configuration again. With faults nothing changes; else all that may change does,
  /// here at once and on each shard before its next turn. Says in the log what came of it.
  Reloading reload() override;

  /// Somebody who may asked for the end of the hub, or it is to begin anew with another id.
  [[nodiscard]] bool drain_wanted() const { return ends_ || redrawn(); }
  void want_drain() override { ends_ = true; }
  /// The id with which the hub is to begin anew, unless somebody asked for its end.
  [[nodiscard]] std::optional<HubId> redrawn() const {
    return ends_ || links_ == nullptr ? std::nullopt : links_->redrawn();
  }
  /// Other hubs hear that this one will end. Returns the time after which it may drain.
  [[nodiscard]] std::chrono::milliseconds announce_end(std::chrono::milliseconds now) {
    return links_ == nullptr || redrawn() ? std::chrono::milliseconds{0}
                                          : links_->announce_end(moment(now));
  }
  /// Nobody new is admitted, and the shards say GOODBYE to everybody once what waits is written.
  void drain();
  [[nodiscard]] bool drained() const { return draining_ && shards_to_drain_ == 0; }

  /// Null: a hub alone.
  [[nodiscard]] const Links* links() const { return links_.get(); }
  [[nodiscard]] const Membership& membership() const { return membership_; }
  [[nodiscard]] const Watches& watches() const { return watches_; }

 private:
  [[nodiscard]] std::optional<proto::Goodbye> admit_node(Stranger& stranger,
                                                         const proto::Hello& hello, Moment moment,
                                                         bool had_name);
  /// Admits nodes of other hubs that wait no longer.
  void admit_moved(std::span<const HubAnswer> answers, std::chrono::milliseconds now);
  void attach(Stranger& stranger, const proto::Hello& hello, const Membership::Joined& joined,
              Moment moment);
  [[nodiscard]] proto::Welcome welcome(const Session& session, const proto::Hello& hello,
                                       Moment moment) const;
  void on_frame(const ControlFrameEvent& event, std::chrono::milliseconds now);
  void on_link_frame(const ControlFrameEvent& event, std::chrono::milliseconds now);
  /// Also says to other hubs what follows.
  void carry_out(const Effects& effects, std::chrono::milliseconds now) {
    runner_.carry_out(effects, now);
    if (links_ == nullptr) return;
    links_->send_joins(now);
    runner_.carry_out(groups_.take_effects(), now);
  }
  /// Carries out what follows from names and groups of other hubs.
  void settle(std::chrono::milliseconds now) {
    Effects effects;
    names_.settle(now, effects, links_ == nullptr ? nullptr : &links_->next_hops());
    carry_out(effects, now);
    groups_.release(now);
  }
  [[nodiscard]] HandlerContext context_for(Effects& effects, std::chrono::milliseconds now);
  [[nodiscard]] Links::Moment moment(std::chrono::milliseconds now) const {
    return {now, wiring_.network ? wiring_.network->wall_now_ns() : 0};
  }
  /// Closes a connection that asks too often for what it cannot have.
  void on_oddity(const ControlFrameEvent& event, std::chrono::milliseconds now);
  void on_detached(const DetachedEvent& event, std::chrono::milliseconds now);
  void close(const Session& session, proto::GoodbyeCode code, std::string sentence);
  /// The session that the event is about, if it is still the same one.
  [[nodiscard]] Session* find(const SessionRef& ref, NodeId node);
  [[nodiscard]] NodeId node_id(const Session& session) const;

  void log_level_set(LogLevel level) override;
  std::string keep_state(std::chrono::milliseconds now) override {
    return keeper_.keep_at_once(membership_, now);
  }

  // Immutable after construction
  const HubFacts facts_;
  Limits& limits_;
  const Wiring wiring_;
  // The conductor's thread only
  Membership membership_;
  Watches watches_;
  TablePublisher publisher_;
  RequestCounters request_counters_;
  StateKeeper keeper_;
  NetworkNames names_;
  GroupLinks groups_;
  EffectRunner runner_;                              ///< on all of these
  std::unique_ptr<Links> links_;                     ///< nullptr: a hub alone
  std::unique_ptr<NetworkOverview> overview_;        ///< with links_
  std::unique_ptr<RemoteRequests> remote_requests_;  ///< with links_
  std::unique_ptr<MovingNodes> moving_;              ///< with links_
  bool returns_published_ =
      false;           ///< after a restart: to the shards nodes that are not back yet count as away
  bool ends_ = false;  ///< somebody asked for it
  bool draining_ = false;
  std::size_t shards_to_drain_ = 0;
};

}  // namespace gimnet::hub
