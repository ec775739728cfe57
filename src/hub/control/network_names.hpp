#pragma once

#include <chrono>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "hub/control/hub_facts.hpp"
#include "hub/control/state/effects.hpp"
#include "hub/control/state/membership.hpp"
#include "hub/control/state/watches.hpp"
#include "hub/limits.hpp"
#include "hub/network/state/name_exchange.hpp"

namespace gimnet::hub {

class NextHops;

/// The names of the whole network at this hub: tells the other hubs what this one has, and its own
/// nodes what the others have. A hub that never had a link keeps no names twice: all begins with
/// the first connection. Thread safety: the conductor's thread only. Lifetime: its parts outlive
/// it.
class NetworkNames {
 public:
  struct Parts {
    const HubFacts& facts;
    const Limits& limits;
    Membership& membership;
    Watches& watches;
  };
  explicit NetworkNames(const Parts& parts) : parts_(parts) {}

  // For the links: see NameExchange

  void begin_connection(LinkNumber number, std::chrono::milliseconds now);
  void take(LinkNumber number, std::span<const std::byte> payload, std::chrono::milliseconds now);
  void end_link(LinkNumber number);
  /// To be called when the map was computed anew.
  void set_reachable(const NetworkMap& map, const RecordStore& store,
                     std::chrono::milliseconds now);
  [[nodiscard]] std::vector<Sending> take_sendings(std::chrono::milliseconds now);
  [[nodiscard]] std::optional<std::chrono::milliseconds> next_due() const;

  // For the rest of the conductor

  /// This hub's own names change. REQUIRES: the effects before it were noted.
  void note(const NodeNoted& noted);
  void note(const ServiceNoted& noted);
  void note(const AcceptanceChanged& noted);
  /// Lets go of names that were lost, and tells own nodes what changed elsewhere. `hops`: for the
  /// log; or null.
  void settle(std::chrono::milliseconds now, Effects& effects, const NextHops* hops = nullptr);

  void note_let_go(std::string_view name, HubId hub) {
    if (exchange_) exchange_->note_let_go(name, hub);
  }
  /// The service of another hub that gives data under that name; nothing: there is none.
  [[nodiscard]] std::optional<AwayService> away_service(std::string_view full_name) const;
  /// Null: the hub has had no link yet.
  [[nodiscard]] const NameCopies* copies() const {
    return exchange_ ? &exchange_->copies() : nullptr;
  }
  /// Messages about names that were not what they should be.
  [[nodiscard]] std::uint64_t malformed() const { return exchange_ ? exchange_->malformed() : 0; }
  /// Names may be missing, since a link came up a moment ago.
  [[nodiscard]] bool is_learning(std::chrono::milliseconds now) const {
    return exchange_ && exchange_->is_learning(now);
  }

 private:
  void begin();
  void put(const Session& session);
  void put(const Topic& topic);
  /// At most once a minute.
  void log_shortage(std::chrono::milliseconds now);
  void note_service(const NameChange& change, std::chrono::milliseconds now, Effects& effects);
  struct Told {
    std::chrono::milliseconds now{};
    const NextHops* hops = nullptr;
  };
  void let_go(const KnownName& winner, const Told& told, Effects& effects);

  const Parts parts_;
  std::optional<NameExchange> exchange_;
  /// Own services that ended: another hub may have one of that name. Limit: those of one settle().
  std::vector<std::string> withdrawn_;
  std::uint64_t dropped_copies_ = 0;  ///< that those who watch were told of
  std::uint64_t logged_refusals_ = 0;
  std::optional<std::chrono::milliseconds> shortage_logged_at_;
};

}  // namespace gimnet::hub
