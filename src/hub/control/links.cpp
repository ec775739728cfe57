#include "hub/control/links.hpp"

#include <algorithm>
#include <utility>

#include "base/log.hpp"
#include "hub/control/log_peer.hpp"
#include "hub/shard/control_frame.hpp"
#include "net/dial_handshake.hpp"

namespace gimnet::hub {
namespace {

using proto::Goodbye;
using proto::GoodbyeCode;
using std::chrono::milliseconds;

constexpr const char* kRemoved = "an administrator of the other hub removed the link";

}  // namespace

Links::Links(LinksOptions options, const Wiring& wiring)
    : options_(std::move(options)),
      wiring_(wiring),
      next_hops_(wiring.routes, wiring.shards),
      network_({{wiring.facts.id, wiring.facts.unique},
                wiring.facts.instance,
                wiring.facts.id_configured},
               {wiring.facts.name, wiring.facts.version}),
      handshake_({wiring.facts, wiring.limits, options_, network_, links_.all()}) {
  for (const DialledLink& link : options_.dial) static_cast<void>(add(link));
}

std::optional<Goodbye> Links::admit(Stranger& stranger, const proto::Hello& hello, Moment moment) {
  if (auto refused = handshake_.refusal(stranger, hello)) return refused;
  if (links_.all().size() >= kLinksMax)
    return Goodbye{GoodbyeCode::hub_full, "this hub has as many links as there can be"};
  if (auto refused = judge(*hello.introduction, moment)) return refused;
  proto::HubIntroduction said = *hello.introduction;
  HubLink* link = links_.find_accepted(said.hub.unique, said.link_name);
  if (link == nullptr) link = &links_.add_accepted(said.link_name);
  link->address = stranger.peer.address;
  // Both ends go on with the counts that they have under that number, or both begin anew.
  if (said.counts == 0 || said.counts != totals_.number_of(link->number()))
    said.counts = (wiring_.facts.instance.value() | 1) + 2 * ++counts_begun_;
  attach(*link, handshake_.accept(stranger, hello, said, moment.wall_ns), said, options_.accepted,
         moment);
  advance(moment);
  return std::nullopt;
}

/// A hub that started again is the one that its old link leads to; a copy of it is another one, and
/// the first one goes on to be heard.
std::optional<Goodbye> Links::judge(const proto::HubIntroduction& said, Moment moment) {
  LinkAdmissionAnswer answer = network_.admit({said.hub, said.instance, said.configured});
  if (answer.admission == LinkAdmission::draw_again) {
    if (may_give_way(moment.now)) {
      draw_again();
    } else {
      answer.admission = LinkAdmission::id_taken;
    }
  }
  if (answer.admission != LinkAdmission::ask_old_link) return handshake_.refusal_of(said, answer);
  HubLink* old = links_.find(answer.old_link);
  if (old == nullptr) return std::nullopt;
  const HubLink::Alive alive = old->is_alive(moment.now);
  if (alive == HubLink::Alive::yes) answer.admission = LinkAdmission::is_copy;
  if (alive != HubLink::Alive::no) return handshake_.refusal_of(said, answer);
  old->last_error = "the hub started again";
  close(*old, GoodbyeCode::replaced, old->last_error);
  end_connection(*old, true, moment);
  return std::nullopt;
}

void Links::dial_due(HubLink& link, Moment moment) {
  if (!link.dial_at() || moment.now < *link.dial_at() || draining_) return;
  link.note_dialling();
  const bool resumes = link.resume_until() && link.epoch != 0;
  if (!resumes) {
    link.epoch = wiring_.random() | 1;  // 0: none
    link.peer_epoch = link.taken = 0;
  }
  link.said_epoch = link.epoch;
  wiring_.dial(link.number(), link.dialled(),
               handshake_.hello_for(link, totals_.number_of(link.number())));
}

void Links::on_dialled(LinkNumber number, Result<net::Welcomed, net::NetError> outcome,
                       Moment moment) {
  HubLink* link = links_.find(number);
  if (link == nullptr || link->connected() || draining_) return;
  const auto fail = [&](const std::string& sentence, bool copied) {
    if (link->last_error != sentence)
      log_line(LogLevel::warning, {"link", link->name()}, "link " + link->name() + ": " + sentence);
    link->last_error = sentence;
    if (copied) return link->dial_after(HubLink::kCopyPause, moment.now);
    link->dial_again(wiring_.random(), moment.now);
  };
  if (!outcome && outcome.error().goodbye == GoodbyeCode::id_taken) draw_again();
  if (!outcome)
    return fail(outcome.error().sentence, outcome.error().goodbye == GoodbyeCode::copied);
  const proto::Welcome& welcome = outcome->welcome;
  const auto refuse = [&](const Goodbye& goodbye) {
    const auto bytes = net::encode_goodbye(goodbye.code, goodbye.sentence);
    const iovec piece{const_cast<std::byte*>(bytes.data()), bytes.size()};
    static_cast<void>(outcome->stream->send({&piece, 1}));
    fail("ended the link: " + goodbye.sentence, goodbye.code == GoodbyeCode::copied);
  };
  if (!welcome.introduction)
    return refuse({GoodbyeCode::malformed, "the peer's WELCOME is not one for a hub"});
  if (const auto refused = judge(*welcome.introduction, moment)) return refuse(*refused);
  // The other end counts on, and this one cannot: both begin anew.
  if (welcome.resumed && !link->place) return fail("it came back too late to be resumed", false);
  link->epoch = link->said_epoch;
  AttachCommand command;
  command.transport = std::move(outcome->stream);
  command.resume_wanted = true;
  command.peer_epoch = welcome.epoch;
  command.known_taken = welcome.taken;
  command.peer_resume_bytes = welcome.resume_buffer_bytes;
  command.peer_frame_bytes = welcome.frame_length_max;
  command.link.emplace();
  command.link->dialled = true;
  command.link->resumed = welcome.resumed && link->place.has_value();
  command.link->epoch = link->epoch;
  link->peer_epoch = welcome.epoch;
  attach(*link, std::move(command), *welcome.introduction, link->dialled().terms, moment);
  begin_exchange(*link, moment);
  advance(moment);
}

void Links::attach(HubLink& link, AttachCommand command, const proto::HubIntroduction& said,
                   const LinkTerms& terms, Moment moment) {
  // Frames that wait are for hubs behind the former peer, and a shard knows a link by its hub.
  if (link.place && link.peer() && link.peer()->hub.hub != said.hub.hub) withdraw(link);
  if (!link.place) links_.give_place(link, wiring_.slots.take());
  wiring_.groups.set_place(link.number(), *link.place, said.hub.hub);
  link.begin_connection(said, terms, moment.now);
  link.last_error.clear();
  command.session = ref_of(*link.place);
  command.attachment = ++link.attachment;
  command.node = make_id<NodeId>(said.hub.hub, kHubIndex);
  if (!command.link) command.link.emplace();
  command.link->counts_anew = totals_.count_under(link.number(), said.counts);
  command.link->rule.own = wiring_.facts.id;
  command.link->rule.allow = terms.allow;
  std::ranges::sort(command.link->rule.allow);
  command.link->silent_ms = link.silent_ms();
  if (link.told_ahead()) command.link->clock_ahead_ns = link.told_ahead()->count();
  wiring_.shards.send(link.place->shard, std::move(command));
  link.log_linked();
}

/// The side that dialled begins: what a refused attempt costs is a HELLO.
void Links::begin_exchange(HubLink& link, Moment moment) {
  link.exchange_begun = true;
  network_.begin_connection(
      link.number(), {link.identity(), link.name(), link.is_dialled(), link.cost()}, moment.now);
  network_.set_damped(link.number(), link.damped_until().has_value());
  wiring_.names.begin_connection(link.number(), moment.now);
  wiring_.groups.begin_connection(link.number());
}

void Links::on_route(const SessionRef& session, std::uint32_t attachment,
                     std::span<const std::byte> payload, Moment moment) {
  HubLink* link = links_.find(session);
  if (link == nullptr || !link->connected() || link->attachment != attachment) return;
  if (!link->exchange_begun) begin_exchange(*link, moment);
  const auto control = proto::split_control(payload);
  if (!control) return;
  const std::uint64_t before = malformed();
  switch (static_cast<proto::route::RouteOperation>(control->header.operation)) {
    case proto::route::RouteOperation::record:
      network_.take_record(link->number(), {payload.begin(), payload.end()}, moment.now);
      break;
    case proto::route::RouteOperation::records_end:
      network_.take_mark(link->number());
      break;
    case proto::route::RouteOperation::keep_alive: {
      const auto heard = proto::decode<proto::route::KeepAlive>(payload);
      if (!heard) break;
      if (link->hear_keep_alive(*heard, moment.now, moment.wall_ns))
        network_.set_cost(link->number(), link->cost());
      if (const auto ahead = link->take_clock_change())
        wiring_.shards.send(link->place->shard, LinkClockCommand{ref_of(*link->place), *ahead});
      network_.take_digest(link->number(), heard->digest, moment.now);
      break;
    }
    default:
      wiring_.names.take(link->number(), payload, moment.now);
      wiring_.groups.take(link->number(), payload);
  }
  if (malformed() != before)
    log_malformed({link->name(), link->title(), control->header.operation}, moment.now);
  advance(moment);
}

void Links::on_detached(const DetachedEvent& event, Moment moment) {
  HubLink* link = links_.find(event.session);
  if (link == nullptr || !link->connected() || link->attachment != event.attachment) return;
  if (link->is_refused_id(event) && may_give_way(moment.now)) draw_again();
  if (link->removed) {
    log_line(LogLevel::info, {"link", link->name()},
             "link " + link->name() + " to " + link->title() + ": removed by an administrator");
    give_up(*link);
  } else {
    end_connection(*link, !link->note_detached(event), moment);
  }
  advance(moment);
}

void Links::end_connection(HubLink& link, bool at_once, Moment moment) {
  link.end_connection(at_once, moment.now);
  if (link.removed) return give_up(link);
  if (at_once) withdraw(link);
  if (link.is_dialled()) link.dial_again(wiring_.random(), moment.now);
}

void Links::withdraw(HubLink& link) {
  link.give_up();
  link.epoch = 0;
  network_.end_link(link.number());
  wiring_.names.end_link(link.number());
  wiring_.groups.end_link(link.number());
  if (!link.place) return;
  const Place place = links_.take_place(link);
  totals_.release(link.number(), place.generation);
  // Shards stop to look the link up before it goes.
  publish_routes();
  wiring_.shards.send(place.shard, ReleaseCommand{ref_of(place)});
  wiring_.slots.give_back(place);
}

void Links::give_up(HubLink& link) {
  withdraw(link);
  forget(link.number());
}

void Links::close(const HubLink& link, GoodbyeCode code, std::string sentence) {
  if (link.place && link.connected())
    wiring_.shards.send(link.place->shard,
                        CloseCommand{ref_of(*link.place), code, std::move(sentence)});
}

void Links::tick(Moment moment) {
  for (const auto& [number, link] : links_.all()) {
    if (link->resume_until() && *link->resume_until() <= moment.now) {
      link->note_break(moment.now);
      withdraw(*link);
    }
    if (link->damped_until() && *link->damped_until() <= moment.now) {
      link->end_damping();
      network_.set_damped(number, false);
    }
    if (link->is_dialled()) dial_due(*link, moment);
    if (link->connected() && link->keep_alive_at() <= moment.now) {
      send(*link, proto::Kind::route,
           proto::encode(link->say_keep_alive(network_.digest(), moment.now, moment.wall_ns)));
    }
  }
  for (const LinkNumber number : links_.long_ended(moment.now)) forget(number);
  advance(moment);
}

std::optional<milliseconds> Links::next_deadline() const {
  std::optional<milliseconds> due = network_.next_due();
  const auto note = [&due](std::optional<milliseconds> time) {
    if (time && (!due || *time < *due)) due = time;
  };
  note(wiring_.names.next_due());
  for (const auto& [number, link] : links_.all()) {
    note(link->resume_until());
    note(link->damped_until());
    if (!draining_) note(link->dial_at());
    if (link->connected()) note(link->keep_alive_at());
    if (link->is_over()) note(link->forget_at());
  }
  return due;
}

void Links::advance(Moment moment) {
  network_.advance(moment.now);
  send_all(network_.take_sendings());
  if (const HubLink* link = links_.find(network_.take_crowding().value_or(LinkNumber{})))
    link->warn_of_crowding();
  if (const auto forgery = network_.take_forgery()) {
    if (const HubLink* link = links_.find(forgery->link)) link->warn_of_forgery(*forgery);
  }
  publish_routes();
  if (map_seen_ != network_.maps()) {
    map_seen_ = network_.maps();
    wiring_.names.set_reachable(network_.map(), network_.store(), moment.now);
    wiring_.groups.set_next_hops(network_.map());
  }
  send_joins(moment.now);
  send_all(wiring_.names.take_sendings(moment.now));
  if (const Verdict verdict = network_.verdict(); verdict != Verdict::stay)
    leave_network(verdict, moment);
}

milliseconds Links::announce_end(Moment moment) {
  network_.announce_end();
  advance(moment);
  const bool is_between = std::ranges::count(network_.map().ways(), 1, &Way::hops) > 1;
  if (!is_between) return milliseconds{0};
  milliseconds longest{0};
  for (const auto& [number, link] : links_.all())
    if (link->connected()) longest = std::max(longest, link->change_time());
  return std::min(longest, kRemovalMost);
}

void Links::send_all(std::span<const Sending> sendings) {
  for (const Sending& sending : sendings) {
    const HubLink* link = links_.find(sending.link);
    if (link != nullptr && link->connected()) send(*link, proto::Kind::route, *sending.bytes);
  }
}

/// It serves its own nodes, and tries again.
void Links::leave_network(Verdict verdict, Moment moment) {
  const bool copied = verdict == Verdict::copied;
  const std::string sentence =
      copied ? "another machine runs a copy of this state folder; delete it on one of them"
             : handshake_.taken_sentence(links_.find(network_.map().own_id_holder()->link));
  log_line(LogLevel::error, {"left", "network"}, "left the network: " + sentence);
  if (!copied && may_give_way(moment.now)) draw_again();
  network_.leave();
  for (auto next = links_.all().begin(); next != links_.all().end();) {
    HubLink* const link = next++->second.get();
    if (!link->place) continue;
    close(*link, copied ? GoodbyeCode::copied : GoodbyeCode::id_taken, sentence);
    if (link->connected()) link->end_connection(true, moment.now);
    if (link->removed) {
      give_up(*link);
      continue;
    }
    withdraw(*link);
    link->last_error = sentence;
    if (!link->is_dialled()) continue;
    const milliseconds soon{250 + wiring_.random() % 250};
    link->dial_after(copied ? HubLink::kCopyPause : soon, moment.now);
  }
}

void Links::publish_routes() {
  next_hops_.publish(network_.map().next_hops(), [this](LinkNumber number, HubId to) {
    const HubLink* link = links_.find(number);
    if (link == nullptr || !link->place) return NextHop{};
    return NextHop{{link->place->shard, link->place->slot, link->place->generation},
                   link->peer()->hub.hub,
                   !link->allows(to)};
  });
}

void Links::send(const HubLink& link, proto::Kind kind, std::span<const std::byte> payload) {
  wiring_.shards.send(link.place->shard,
                      SendControlCommand{ref_of(*link.place), link.attachment,
                                         control_frame(kind, NodeId{}, wiring_.facts.id, payload)});
}

std::string Links::add(const DialledLink& link) {
  if (const HubLink* known = links_.find(link.name); known != nullptr && known->is_dialled()) {
    if (known->removed) return "link '" + link.name + "' is being removed; try again in 2 s";
    return "there is a link '" + link.name + "' already; give another name";
  }
  if (links_.all().size() >= kLinksMax) return "this hub has as many links as there can be";
  links_.add(link).dial_after(milliseconds{0}, milliseconds{0});
  return {};
}

std::string Links::remove(std::string_view name) {
  const Result<HubLink*> found = links_.to_change(name);
  if (!found) return found.error().sentence;
  HubLink* const link = *found;
  if (!link->connected()) {
    give_up(*link);
  } else if (!std::exchange(link->removed, true)) {
    // Routes move to other links at both ends, and this one carries what is under way.
    link->fix_cost(LinkCost::kMost);
    network_.set_cost(link->number(), link->cost());
    CloseCommand command{ref_of(*link->place), GoodbyeCode::done, kRemoved};
    command.quiet_ms = static_cast<std::uint32_t>(link->change_time().count());
    command.most_ms = static_cast<std::uint32_t>(kRemovalMost.count());
    wiring_.shards.send(link->place->shard, std::move(command));
  }
  return {};
}

std::string Links::set_cost(std::string_view name, std::uint16_t cost) {
  const Result<HubLink*> found = links_.to_change(name);
  if (!found) return found.error().sentence;
  HubLink* const link = *found;
  if (link->removed) return "that link is removed";
  link->fix_cost(cost);
  network_.set_cost(link->number(), link->cost());
  return {};
}

}  // namespace gimnet::hub
