#include "tests/sim/hubs/sim_hub.hpp"

namespace gimnet::sim::hubs {
namespace {

/// A shard's own clock ticks each 100 ms; REPORTs and paced messages are due sooner.
constexpr milliseconds kTurnEvery{10};
constexpr milliseconds kCollectEvery{20};
/// Turns of shard and conductor at one time.
constexpr int kRoundsMost = 8;
constexpr int kEventsARound = 64;
constexpr std::size_t kGaugedSlots = 1'024;

}  // namespace

void SimHub::Door::send(ShardIndex, hub::ShardCommand command) {
  if (const auto* attach = std::get_if<hub::AttachCommand>(&command))
    admitted = {attach->node, attach->new_session};
  sent = true;
  shard.send(std::move(command));
}

SimHub::SimHub(Setup setup, Around around)
    : setup_(std::move(setup)),
      wall_now_ns_(around.wall_now_ns),
      budget_(setup_.limits.budget_bytes),
      link_budget_(setup_.limits.link_budget_bytes),
      retained_budget_(setup_.limits.retained_budget_bytes),
      mailbox_(1, hub::Mailbox::bounds_from(setup_.limits), waker_),
      sessions_(kGaugedSlots),
      shared_(shared()),
      shard_(ShardIndex{0}, shared_, {}),
      door_(shard_),
      conductor_(setup_.facts, hub::Placement::spread, setup_.limits, wiring(std::move(around))) {}

SimHub::~SimHub() { shard_.let_go(); }

hub::HubShared SimHub::shared() {
  return {setup_.facts.id, setup_.limits, nodes_,       groups_,          routes_,
          quiescence_,     budget_,       link_budget_, retained_budget_, inbox_,
          {&mailbox_},     {&waker_},     {&counters_}, {&sessions_}};
}

hub::Conductor::Wiring SimHub::wiring(Around around) {
  hub::Conductor::Wiring wiring{door_, {nodes_, groups_, quiescence_}, readable_};
  wiring.start = setup_.start;
  wiring.keep_state = std::move(around.keep);
  wiring.sessions = readable_sessions_;
  wiring.refusals = &refusals_;
  wiring.network.emplace(
      hub::Conductor::Wiring::Network{routes_, setup_.links, std::move(around.dial),
                                      std::move(around.wall_now_ns), std::move(around.random)});
  return wiring;
}

void SimHub::step(milliseconds now) {
  if (stepped_ && now - *stepped_ > hub::Conductor::kLookEvery) {
    conductor_.stood_still(now - *stepped_, now);
    looked_ = false;
  }
  stepped_ = now;
  if (conductor_.drain_wanted()) drain();
  for (int round = 0; round < kRoundsMost; ++round) {
    const bool turned = turn(now);
    if (!take_events(now) && !turned) break;
  }
}

bool SimHub::turn(milliseconds now) {
  find_ready();
  const bool due = std::exchange(door_.sent, false) || !ready_.empty() || now >= turn_at_ ||
                   shard_.has_rest() || !shard_.state().recipients.dirty().empty();
  if (!due) return false;
  turn_at_ = now + kTurnEvery;
  shard_.turn(ready_, static_cast<std::uint64_t>(now.count()));
  return true;
}

void SimHub::find_ready() {
  ready_.clear();
  for (const auto& connection : shard_.state().connections) {
    if (connection == nullptr || !connection->connected) continue;
    const hub::MemoryPeer& peer = peers_.at(connection->transport.get());
    const bool readable = connection->armed.read && peer.transport_readable();
    const bool writable = connection->armed.write && peer.transport_writable();
    if (readable || writable) ready_.push_back({connection->token(), readable, writable});
  }
}

bool SimHub::take_events(milliseconds now) {
  inbox_.drain_present([this](hub::ShardEvent&& event) {
    if (!std::holds_alternative<hub::FarewellEvent>(event.what)) turns_.put(std::move(event));
  });
  bool worked = false;
  for (int i = 0; i < kEventsARound && !turns_.empty(); ++i, worked = true)
    conductor_.on_event(turns_.take(), now);
  // A hub with many neighbours looks at all of them to find its next deadline.
  if (worked || !looked_) due_ = conductor_.next_deadline();
  const bool collects = conductor_.has_garbage() && now % kCollectEvery == milliseconds{0};
  if ((due_ && *due_ <= now) || collects) {
    conductor_.tick(now);
    worked = true;
  }
  looked_ = !worked && !more_to_tell_;
  if (!looked_) more_to_tell_ = conductor_.tell_rest(now);
  return door_.sent || !turns_.empty() || more_to_tell_;
}

void SimHub::add_peer(const net::Stream* stream, hub::MemoryPeer peer) {
  std::erase_if(peers_, [](const auto& each) { return each.second.transport_gone(); });
  peers_.insert_or_assign(stream, std::move(peer));
}

std::optional<proto::Goodbye> SimHub::admit(hub::Stranger stranger, hub::MemoryPeer peer,
                                            const proto::Hello& hello, milliseconds now) {
  for (hub::ShardEvent& event : turns_.take_ended()) conductor_.on_event(std::move(event), now);
  add_peer(stranger.transport.get(), std::move(peer));
  door_.admitted = {};
  looked_ = false;
  return conductor_.admit(stranger, hello, {now, wall_now_ns_()});
}

void SimHub::on_dialled(hub::LinkNumber link, std::unique_ptr<net::Stream> stream,
                        hub::MemoryPeer peer, const proto::Welcome& welcome, milliseconds now) {
  add_peer(stream.get(), std::move(peer));
  conductor_.on_dialled(link, net::Welcomed{std::move(stream), welcome}, now);
  looked_ = false;
}

void SimHub::on_not_dialled(hub::LinkNumber link, net::NetError error, milliseconds now) {
  conductor_.on_dialled(link, std::move(error), now);
  looked_ = false;
}

}  // namespace gimnet::sim::hubs
