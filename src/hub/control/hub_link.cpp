#include "hub/control/hub_link.hpp"

#include <algorithm>
#include <utility>

#include "base/check.hpp"
#include "base/log.hpp"
#include "hub/shard/commands.hpp"

namespace gimnet::hub {
namespace {

using std::chrono::milliseconds;
using std::chrono::nanoseconds;

}  // namespace

HubLink::HubLink(LinkNumber number, DialledLink dialled)
    : number_(number), name_(dialled.name), dialled_(std::move(dialled)) {
  address = dialled_->address.url();
  follow_cost(dialled_->cost);
}

void HubLink::fix_cost(std::uint16_t cost) {
  GIMNET_CHECK(is_dialled());
  dialled_->cost = cost;
  if (follow_cost(cost)) keep_alive_at_ = milliseconds{0};
}

bool HubLink::follow_cost(std::uint16_t configured) {
  if (std::exchange(configured_cost_, configured) == configured) return false;
  cost_ = configured != 0 ? LinkCost(configured) : LinkCost();
  if (clock_.round_trip_least != nanoseconds{0}) cost_.note_round_trip(clock_.round_trip_least);
  return true;
}

HubIdentity HubLink::identity() const {
  GIMNET_CHECK(peer_.has_value());
  return {peer_->hub, peer_->instance, peer_->configured};
}

std::string HubLink::title() const {
  GIMNET_CHECK(peer_.has_value());
  const std::string& name = peer_->hub_name;
  return "hub " + std::to_string(peer_->hub.hub.value()) +
         (name.empty() ? std::string{} : " '" + escaped(name) + "'");
}

void HubLink::begin_connection(const proto::HubIntroduction& said, const LinkTerms& own,
                               milliseconds now) {
  const bool same = peer_ && peer_->hub == said.hub && peer_->instance == said.instance;
  const bool kept_routes = same && (connected_ || resume_until_);
  if (!same) breaks_.clear();
  if (!kept_routes) damp(now);
  peer_ = said;
  connected_ = true;
  allow_ = own.allow;
  exchange_begun = false;
  keep_alive_ms_ = std::max(own.keep_alive_ms, std::min(said.keep_alive_ms, kTimesMostMs));
  silent_ms_ = std::max(own.silent_ms, std::min(said.silent_ms, kTimesMostMs));
  keep_alive_at_ = heard_at_ = now;
  heard_sent_ns_ = heard_ns_ = 0;
  if (!same || !resume_until_) {
    clock_ = {};
    clock_sample_count_ = 0;
    told_ahead_.reset();
    cost_ = configured_cost_ != 0 ? LinkCost(configured_cost_) : LinkCost();
  }
  if (!is_dialled()) follow_cost(said.cost);
  resume_until_.reset();
  over_since_.reset();
  dial_at_.reset();
  backoff_.reset();
}

void HubLink::damp(milliseconds now) {
  while (!breaks_.empty() && breaks_.front() + kBreaksWithin <= now) breaks_.pop_front();
  damped_until_.reset();
  if (breaks_.size() <= kBreaksMost) return;
  const auto doublings = std::min<std::size_t>(breaks_.size() - kBreaksMost - 1, 4);
  damped_until_ = now + std::min(milliseconds{1'000 << doublings}, kDampedMost);
}

void HubLink::end_connection(bool at_once, milliseconds now) {
  connected_ = false;
  if (at_once) {
    epoch = 0;
    return;
  }
  const auto round_trip = std::chrono::ceil<milliseconds>(clock_.round_trip_least);
  resume_until_ = now + kResumeTime + 4 * round_trip;
}

void HubLink::log_linked() const {
  log_line(LogLevel::info, {"link", name_},
           std::string{attachment > 1 ? "linked again " : "linked "} +
               (is_dialled() ? "to " : "by ") + title() + ", " + address + ", link " + name_);
}

/// Later on the same code says that the other hub has lost its own id.
bool HubLink::is_refused_id(const DetachedEvent& event) const {
  return !is_dialled() && !exchange_begun && event.said_by_peer &&
         event.code == proto::GoodbyeCode::id_taken;
}

bool HubLink::note_detached(const DetachedEvent& event) {
  epoch = event.epoch;
  peer_epoch = event.peer_epoch;
  taken = event.taken;
  const bool done = event.code == proto::GoodbyeCode::done;
  const bool said = event.said_by_peer || !done;
  last_error = said ? (event.said_by_peer ? "the other hub said goodbye: " : "closed: ") +
                          std::string{proto::goodbye_name(event.code)} +
                          (event.sentence.empty() ? "" : ": ") + event.sentence
                    : "the connection broke";
  // `done` is an administrator's wish.
  log_line(event.said_by_peer && done ? LogLevel::info : LogLevel::warning, {"link", name_},
           "link " + name_ + " to " + title() + ": " + last_error);
  return event.code == proto::GoodbyeCode::silent || (done && !event.said_by_peer);
}

void HubLink::warn_of_crowding() const {
  log_line(LogLevel::warning, {"records", name_},
           "link " + name_ + " to " + title() +
               ": brings records of more hubs than there is room for, and those that could not be "
               "reached for longest are thrown away; is a hub there that invents others?");
}

void HubLink::warn_of_forgery(const NetworkState::Hearsay& forgery) const {
  log_line(LogLevel::warning, {"records", name_},
           "link " + name_ + " to " + title() + ": says of hub " +
               std::to_string(forgery.hub.hub.value()) + " what that hub itself did not say over " +
               "its own link, " + std::to_string(forgery.lead) +
               " changes ahead; it is not believed; is a hub there that forges records?");
}

proto::route::KeepAlive HubLink::say_keep_alive(std::uint64_t digest, milliseconds now,
                                                std::int64_t wall_ns) {
  keep_alive_at_ = now + milliseconds{keep_alive_ms_};
  proto::route::KeepAlive said;
  said.sent_ns = wall_ns;
  said.heard_sent_ns = heard_sent_ns_;
  said.heard_ns = heard_ns_;
  said.digest = digest;
  if (is_dialled()) said.cost = dialled_->cost;
  return said;
}

bool HubLink::hear_keep_alive(const proto::route::KeepAlive& heard, milliseconds now,
                              std::int64_t wall_ns) {
  heard_at_ = now;
  heard_sent_ns_ = heard.sent_ns;
  heard_ns_ = wall_ns;
  const bool told = !is_dialled() && follow_cost(heard.cost);
  if (told) {
    const std::string cost = heard.cost != 0 ? std::to_string(heard.cost) : "what is measured";
    log_line(LogLevel::info, {"link", name_},
             "link " + name_ + " to " + title() + ": costs " + cost +
                 " from now on, by an administrator of the other hub");
  }
  if (heard.heard_sent_ns == 0) return told;
  const std::int64_t held = heard.sent_ns - heard.heard_ns;
  const nanoseconds round_trip{(wall_ns - heard.heard_sent_ns) - held};
  // A clock that was set meanwhile tells nothing.
  if (held < 0 || round_trip < nanoseconds{0} || round_trip > std::chrono::minutes(1)) return told;
  if (clock_.round_trip_least == nanoseconds{0} || round_trip < clock_.round_trip_least)
    clock_.round_trip_least = std::max(round_trip, nanoseconds{1});
  compare_clocks({round_trip, nanoseconds{heard.sent_ns - wall_ns} + round_trip / 2});
  return cost_.note_round_trip(clock_.round_trip_least) || told;
}

/// A process that lost its power was heard a moment ago, too. A keep-alive may have been under way
/// when the question came, so one that comes at least an interval later counts.
HubLink::Alive HubLink::is_alive(milliseconds now) {
  const milliseconds interval{keep_alive_ms_};
  if (!connected_ || now - heard_at_ >= 2 * interval) return Alive::no;
  if (!asked_at_ || now - *asked_at_ > 20 * interval) asked_at_ = now;
  if (now - *asked_at_ < 2 * interval) return Alive::not_known;
  const bool heard_since = heard_at_ - *asked_at_ >= interval;
  asked_at_.reset();
  return heard_since ? Alive::yes : Alive::no;
}

void HubLink::compare_clocks(ClockSample sample) {
  // Each sample is right to half of its round trip. One that contradicts the others shows that a
  // clock was set, and they are worth nothing.
  const nanoseconds apart = std::chrono::abs(sample.ahead - clock_.ahead);
  if (apart > sample.round_trip / 2 + clock_.error + milliseconds{1}) clock_sample_count_ = 0;
  clock_samples_[clock_sample_count_++ % kClockSamples] = sample;
  const auto end = clock_samples_.begin() + std::min(clock_sample_count_, kClockSamples);
  const auto best =
      std::ranges::min_element(clock_samples_.begin(), end, {}, &ClockSample::round_trip);
  clock_.ahead = best->ahead;
  clock_.error = best->round_trip / 2;
}

std::optional<nanoseconds> HubLink::take_clock_change() {
  if (clock_.round_trip_least == nanoseconds{0}) return std::nullopt;
  if (told_ahead_ && std::chrono::abs(*told_ahead_ - clock_.ahead) < milliseconds{1})
    return std::nullopt;
  told_ahead_ = clock_.ahead;
  return told_ahead_;
}

void HubLink::dial_again(std::uint64_t random, milliseconds now) {
  dial_at_ = now + milliseconds{backoff_.next_ns(random) / net::kNsPerMs};
}

}  // namespace gimnet::hub
