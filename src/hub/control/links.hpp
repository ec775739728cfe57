#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.hpp"
#include "hub/control/acceptor.hpp"
#include "hub/control/group_links.hpp"
#include "hub/control/hub_facts.hpp"
#include "hub/control/hub_link.hpp"
#include "hub/control/link_handshake.hpp"
#include "hub/control/link_roster.hpp"
#include "hub/control/link_totals.hpp"
#include "hub/control/network_names.hpp"
#include "hub/control/next_hops.hpp"
#include "hub/control/shard_proxy.hpp"
#include "hub/control/state/slot_pool.hpp"
#include "hub/limits.hpp"
#include "hub/network/state/network_state.hpp"
#include "net/dial.hpp"

namespace gimnet::hub {

/// The links of this hub: admits and dials them, carries the routes between NetworkState and its
/// neighbours, and publishes the next hops. Thread safety: the conductor's thread only. Time is an
/// argument. Ownership: of the places of its links; what it is wired to outlives it. Limits:
/// kLinksMax links.
class Links {
 public:
  static constexpr std::size_t kLinksMax = 4'093;
  /// A link that is removed ends when nothing was under way on it for HubLink::change_time(), and
  /// after this time in any case.
  static constexpr std::chrono::milliseconds kRemovalMost{2'000};
  /// A hub that began anew gives way to no other hub before: whoever may link could end it at will.
  static constexpr std::chrono::milliseconds kRedrawPause = std::chrono::minutes(1);

  /// A dial that was asked for; on_dialled() tells how it ended.
  using Dial = std::function<void(LinkNumber, const DialledLink&, const proto::Hello&)>;
  struct Wiring {
    const HubFacts& facts;
    const Limits& limits;
    ShardProxy& shards;
    SlotPool& slots;
    RouteTable& routes;
    NetworkNames& names;
    GroupLinks& groups;
    Dial dial;
    std::function<std::uint64_t()> random;  ///< 64 bits that nobody can guess
  };
  /// Clocks at one moment.
  struct Moment {
    std::chrono::milliseconds now{};  ///< monotonic
    std::int64_t wall_ns = 0;         ///< since 1970
  };
  Links(LinksOptions options, const Wiring& wiring);

  /// Judges a HELLO of role hub: takes the stranger's transport and hands it to a shard, or says
  /// why not.
  [[nodiscard]] std::optional<proto::Goodbye> admit(Stranger& stranger, const proto::Hello& hello,
                                                    Moment moment);
  void on_dialled(LinkNumber number, Result<net::Welcomed, net::NetError> outcome, Moment moment);
  /// The payload of a ROUTE frame from that connection.
  void on_route(const SessionRef& session, std::uint32_t attachment,
                std::span<const std::byte> payload, Moment moment);
  void on_detached(const DetachedEvent& event, Moment moment);
  void on_released(const ReleasedEvent& event) {
    totals_.add(event.session.generation, event.counts);
  }
  void tick(Moment moment);
  [[nodiscard]] std::optional<std::chrono::milliseconds> next_deadline() const;
  /// No link is dialled or taken any more.
  void drain() { draining_ = true; }
  /// Tells other hubs that this one will end. Returns when it may: frames between others have found
  /// other ways by then. 0: none comes through here, since there are less than two neighbours.
  [[nodiscard]] std::chrono::milliseconds announce_end(Moment moment);

  /// The id to begin anew with, once another hub was found to keep the one that this hub drew.
  [[nodiscard]] std::optional<HubId> redrawn() const { return redrawn_; }
  /// Says what subscriptions changed.
  void send_joins(std::chrono::milliseconds now) { send_all(wiring_.groups.take_sendings(now)); }

  [[nodiscard]] NextHops& next_hops() { return next_hops_; }
  [[nodiscard]] const NetworkState& network() const { return network_; }
  /// Of sessions of links that have ended.
  [[nodiscard]] const LinkTotals& totals() const { return totals_; }
  /// Messages of other hubs that were not what they should be.
  [[nodiscard]] std::uint64_t malformed() const {
    return network_.malformed() + wiring_.names.malformed() + wiring_.groups.malformed();
  }
  /// Says what is due, and publishes what follows from it.
  void advance(Moment moment);

  [[nodiscard]] const LinkRoster::All& all() const { return links_.all(); }
  // As in NetworkView.
  [[nodiscard]] std::string add(const DialledLink& link);
  [[nodiscard]] std::string remove(std::string_view name);
  [[nodiscard]] std::string set_cost(std::string_view name, std::uint16_t cost);

 private:
  /// Why that hub may not be at the other end of a link; nothing: it may.
  [[nodiscard]] std::optional<proto::Goodbye> judge(const proto::HubIntroduction& said,
                                                    Moment moment);
  void dial_due(HubLink& link, Moment moment);
  void attach(HubLink& link, AttachCommand command, const proto::HubIntroduction& said,
              const LinkTerms& terms, Moment moment);
  void begin_exchange(HubLink& link, Moment moment);
  void end_connection(HubLink& link, bool at_once, Moment moment);
  /// Its routes go, and what waits for it is lost.
  void withdraw(HubLink& link);
  /// The same, and nobody dials it any more.
  void give_up(HubLink& link);
  void forget(LinkNumber number) {
    totals_.forget(number);
    links_.forget(number);
  }
  void close(const HubLink& link, proto::GoodbyeCode code, std::string sentence);
  void send_all(std::span<const Sending> sendings);
  /// Nothing happens where the id is a configured one.
  void draw_again() {
    if (!wiring_.facts.id_configured && !redrawn_)
      redrawn_ = network_.draw_hub_id(wiring_.random());
  }
  [[nodiscard]] bool may_give_way(std::chrono::milliseconds now) const {
    return !wiring_.facts.redrawn || now - wiring_.facts.started >= kRedrawPause;
  }
  void leave_network(Verdict verdict, Moment moment);
  void publish_routes();
  void send(const HubLink& link, proto::Kind kind, std::span<const std::byte> payload);

  const LinksOptions options_;
  const Wiring wiring_;
  NextHops next_hops_;
  NetworkState network_;
  std::uint64_t map_seen_ = 0;  ///< the map that the names were told of
  LinkRoster links_;
  const LinkHandshake handshake_;  ///< of these
  LinkTotals totals_;
  std::uint64_t counts_begun_ = 0;  ///< as numbers of this instance; none of them is 0
  bool draining_ = false;
  std::optional<HubId> redrawn_;
};

}  // namespace gimnet::hub
