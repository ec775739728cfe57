#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "hub/control/link_options.hpp"
#include "hub/control/state/place.hpp"
#include "hub/network/state/link_cost.hpp"
#include "hub/network/state/network_state.hpp"
#include "net/dial.hpp"
#include "proto/control/link.hpp"
#include "proto/control/route.hpp"

namespace gimnet::hub {

struct DetachedEvent;

/// The clock of the hub at the other end of a link, compared with this hub's.
struct LinkClock {
  std::chrono::nanoseconds round_trip_least{};  ///< of this connection; 0: not measured
  std::chrono::nanoseconds ahead{};  ///< of this clock the other one; 0 until it is measured
  std::chrono::nanoseconds error{};  ///< of `ahead`, at most
};

/// One link as the conductor knows it: its other end, its connections, its times. Thread safety:
/// the conductor's thread only. Time is an argument.
class HubLink {
 public:
  /// After a break a link has so long to come back, and four times its lowest round trip.
  static constexpr std::chrono::milliseconds kResumeTime{300};
  /// A hub that met its own copy, or itself, tries again so often.
  static constexpr std::chrono::milliseconds kCopyPause = std::chrono::seconds(5);
  /// More breaks than this within kBreaksWithin damp the link. A connection that is resumed within
  /// its time to come back is no break: it cost nobody a route.
  static constexpr std::size_t kBreaksMost = 2;
  static constexpr std::chrono::milliseconds kBreaksWithin = std::chrono::minutes(1);
  static constexpr std::chrono::milliseconds kDampedMost = std::chrono::seconds(10);
  /// The other end's times count up to this: a link that is never silent would never end.
  static constexpr std::uint32_t kTimesMostMs = 3'600'000;
  /// A link that the other side gave up is shown for so long.
  static constexpr std::chrono::milliseconds kEndedShown = std::chrono::minutes(10);
  /// The other clock is compared by the shortest of so many latest round trips, since clocks drift.
  static constexpr std::size_t kClockSamples = 16;

  /// A link that this hub dials.
  HubLink(LinkNumber number, DialledLink dialled);
  /// A link that the other side dialled.
  HubLink(LinkNumber number, std::string name) : number_(number), name_(std::move(name)) {}

  [[nodiscard]] LinkNumber number() const { return number_; }
  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] bool is_dialled() const { return dialled_.has_value(); }
  /// REQUIRES: is_dialled().
  [[nodiscard]] const DialledLink& dialled() const { return *dialled_; }
  /// 0: measured. The next keep-alive tells the other end, at once.
  void fix_cost(std::uint16_t cost);

  /// The other end, as HELLO or WELCOME said; of before the first connection: nothing.
  [[nodiscard]] const std::optional<proto::HubIntroduction>& peer() const { return peer_; }
  [[nodiscard]] HubIdentity identity() const;
  /// The other end as the log names it: "hub 7 'lab'". REQUIRES: peer().
  [[nodiscard]] std::string title() const;

  /// A connection begins. `said` is what the other end said, `own` this end's terms.
  void begin_connection(const proto::HubIntroduction& said, const LinkTerms& own,
                        std::chrono::milliseconds now);
  /// The connection broke. `at_once`: one end said GOODBYE, and nothing is resumed.
  void end_connection(bool at_once, std::chrono::milliseconds now);
  /// The log says that it is linked. REQUIRES: peer().
  void log_linked() const;
  /// Keeps what `event` tells of the connection that ended, and says in the log why it did. True:
  /// nobody meant to end it, and it may be resumed.
  [[nodiscard]] bool note_detached(const DetachedEvent& event);
  /// The side that dialled refused this hub, whose id another one has in its network.
  [[nodiscard]] bool is_refused_id(const DetachedEvent& event) const;
  /// The log says that more records come over it than there is room for. REQUIRES: peer().
  void warn_of_crowding() const;
  /// The same of a record that it brings, of a hub that has a link of its own to this one.
  void warn_of_forgery(const NetworkState::Hearsay& forgery) const;
  [[nodiscard]] bool connected() const { return connected_; }
  /// May it bring frames of that hub's nodes?
  [[nodiscard]] bool allows(HubId hub) const {
    return allow_.empty() || std::ranges::find(allow_, hub) != allow_.end();
  }
  /// Until then a broken link may be resumed, and frames wait. Nothing: it is not broken.
  [[nodiscard]] std::optional<std::chrono::milliseconds> resume_until() const {
    return resume_until_;
  }
  /// Its routes are withdrawn.
  void give_up() {
    resume_until_.reset();
    damped_until_.reset();
  }
  /// Its time to come back is over. REQUIRES: resume_until(); give_up() follows.
  void note_break(std::chrono::milliseconds now) { breaks_.push_back(now); }
  [[nodiscard]] std::uint32_t silent_ms() const { return silent_ms_; }
  [[nodiscard]] std::uint32_t keep_alive_ms() const { return keep_alive_ms_; }
  /// Until then others are told the highest cost, since it broke too often. Nothing: the true one.
  [[nodiscard]] std::optional<std::chrono::milliseconds> damped_until() const {
    return damped_until_;
  }
  void end_damping() { damped_until_.reset(); }

  /// When the next keep-alive is due; REQUIRES: connected().
  [[nodiscard]] std::chrono::milliseconds keep_alive_at() const { return keep_alive_at_; }
  [[nodiscard]] proto::route::KeepAlive say_keep_alive(std::uint64_t digest,
                                                       std::chrono::milliseconds now,
                                                       std::int64_t wall_ns);
  /// True: the cost is another one now. If the other end fixed it, the log says so.
  [[nodiscard]] bool hear_keep_alive(const proto::route::KeepAlive& heard,
                                     std::chrono::milliseconds now, std::int64_t wall_ns);
  enum class Alive : std::uint8_t { yes, no, not_known };
  /// Is the other end there? To be asked again if that is not known: it shows within two
  /// keep-alives.
  [[nodiscard]] Alive is_alive(std::chrono::milliseconds now);
  [[nodiscard]] std::uint16_t cost() const { return cost_.value().value_or(LinkCost::kUnmeasured); }
  /// As people are told: 0 while it was not measured.
  [[nodiscard]] std::uint16_t known_cost() const { return cost_.value().value_or(0); }
  [[nodiscard]] const LinkClock& clock() const { return clock_; }
  /// Hubs at both ends have found other ways so long after a change.
  [[nodiscard]] std::chrono::milliseconds change_time() const {
    return std::chrono::milliseconds{250} +
           2 * std::chrono::ceil<std::chrono::milliseconds>(clock_.round_trip_least);
  }
  /// LinkClock::ahead, if the shard has to be told of it: less than a millisecond changes nothing.
  [[nodiscard]] std::optional<std::chrono::nanoseconds> take_clock_change();
  /// As the shard knows it; nothing: it does not.
  [[nodiscard]] std::optional<std::chrono::nanoseconds> told_ahead() const { return told_ahead_; }

  /// The other side dialled it, and has given it up.
  [[nodiscard]] bool is_over() const { return !connected_ && !place && !is_dialled(); }
  /// When that was first seen. REQUIRES: is_over().
  [[nodiscard]] std::chrono::milliseconds over_since(std::chrono::milliseconds now) {
    return *(over_since_ = over_since_.value_or(now));
  }
  /// When an ended link is to be forgotten; 0: its end was not seen yet.
  [[nodiscard]] std::chrono::milliseconds forget_at() const {
    return over_since_ ? *over_since_ + kEndedShown : std::chrono::milliseconds{0};
  }

  // Dialling. REQUIRES: is_dialled().
  [[nodiscard]] std::optional<std::chrono::milliseconds> dial_at() const { return dial_at_; }
  void dial_after(std::chrono::milliseconds pause, std::chrono::milliseconds now) {
    dial_at_ = now + pause;
  }
  /// With the jitter of a random time. `random`: any 64 random bits.
  void dial_again(std::uint64_t random, std::chrono::milliseconds now);
  void note_dialling() { dial_at_.reset(); }

  // Kept here for the owner.
  std::optional<Place> place;    ///< while a shard knows it
  std::uint32_t attachment = 0;  ///< numbers its connections
  std::string address;           ///< of the other end
  std::string last_error;
  bool removed = false;          ///< by an administrator: it goes once its connection ends
  bool exchange_begun = false;   ///< on this connection
  std::uint64_t epoch = 0;       ///< of this end; 0: the link cannot be resumed
  std::uint64_t said_epoch = 0;  ///< in the HELLO that is under way
  std::uint64_t peer_epoch = 0;
  std::uint64_t taken = 0;  ///< data frames of the last connection

 private:
  struct ClockSample {
    std::chrono::nanoseconds round_trip{};
    std::chrono::nanoseconds ahead{};
  };
  void compare_clocks(ClockSample sample);
  /// True: it was another one. 0: measured.
  bool follow_cost(std::uint16_t configured);
  /// Looks whether it broke too often, as it comes back after its routes were withdrawn.
  void damp(std::chrono::milliseconds now);

  const LinkNumber number_;
  const std::string name_;
  std::optional<DialledLink> dialled_;
  std::optional<proto::HubIntroduction> peer_;
  bool connected_ = false;
  std::vector<HubId> allow_;  ///< as LinkTerms has it
  std::uint32_t keep_alive_ms_ = kLinkKeepAliveMs;
  std::uint32_t silent_ms_ = kLinkSilentMs;
  std::chrono::milliseconds keep_alive_at_{};
  std::chrono::milliseconds heard_at_{};
  std::optional<std::chrono::milliseconds> asked_at_;  ///< whether it is alive
  std::int64_t heard_sent_ns_ = 0;                     ///< of the last keep-alive heard; 0: none
  std::int64_t heard_ns_ = 0;
  std::uint16_t configured_cost_ = 0;  ///< by the side that dialled; 0: measured
  LinkCost cost_;
  LinkClock clock_;
  std::array<ClockSample, kClockSamples> clock_samples_;
  std::size_t clock_sample_count_ = 0;  ///< the ring wraps
  std::optional<std::chrono::nanoseconds> told_ahead_;
  std::optional<std::chrono::milliseconds> resume_until_;
  std::optional<std::chrono::milliseconds> dial_at_;
  std::optional<std::chrono::milliseconds> damped_until_;
  std::optional<std::chrono::milliseconds> over_since_;
  /// Under the same instance, within kBreaksWithin. Limit: the breaks of a minute, at least
  /// kResumeTime apart.
  std::deque<std::chrono::milliseconds> breaks_;
  net::DialBackoff backoff_;
};

}  // namespace gimnet::hub
