#include "tests/hub/shard/support/hub_rig.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>

namespace gimnet::hub::testing {

HubRig::HubRig(std::size_t shards, Limits limits)
    : limits_(limits),
      quiescence_(shards),
      budget_(limits.budget_bytes, shards),
      link_budget_(limits.link_budget_bytes, shards),
      inbox_(shards) {
  std::vector<Mailbox*> mailboxes;
  std::vector<Waker*> wakers;
  std::vector<ShardCounters*> counters;
  std::vector<SessionGauges*> sessions;
  for (std::size_t i = 0; i < shards; ++i) {
    wakers_.push_back(std::make_unique<Waker>());
    mailboxes_.push_back(
        std::make_unique<Mailbox>(shards, Mailbox::bounds_from(limits_), *wakers_.back()));
    counters_.push_back(std::make_unique<ShardCounters>());
    wakers.push_back(wakers_.back().get());
    mailboxes.push_back(mailboxes_.back().get());
    counters.push_back(counters_.back().get());
    sessions_.push_back(std::make_unique<SessionGauges>(kGaugedSlots));
    sessions.push_back(sessions_.back().get());
  }
  shared_.emplace(HubShared{hub(), limits_, nodes_, groups_, routes_, quiescence_, budget_,
                            link_budget_, retained_budget_, inbox_, mailboxes, wakers, counters,
                            sessions});
  for (std::size_t i = 0; i < shards; ++i) {
    shards_.push_back(std::make_unique<IoShard>(ShardIndex{static_cast<std::uint8_t>(i)}, *shared_,
                                                IoShard::Options{}));
  }
}

HubRig::~HubRig() { let_go(); }

void HubRig::let_go() {
  for (const auto& shard : shards_) shard->let_go();
}

FakeNode& HubRig::join(std::size_t shard, const JoinSpec& spec) {
  return begin(shard, make_id<NodeId>(hub(), next_index_), spec);
}

FakeNode& HubRig::link(std::size_t shard, HubId to, const JoinSpec& spec) {
  return begin(shard, make_id<NodeId>(to, kHubIndex), spec);
}

FakeNode& HubRig::begin(std::size_t shard, NodeId id, const JoinSpec& spec) {
  FakeNode& node = nodes_played_.emplace_back();
  const std::uint32_t index = next_index_++;
  node.id = id;
  node.shard = ShardIndex{static_cast<std::uint8_t>(shard)};
  node.session = {ConnectionSlot{index}, 1000 + index};
  attach(node, spec, true);
  return node;
}

void HubRig::rejoin(FakeNode& node, const JoinSpec& spec) { attach(node, spec, false); }

void HubRig::attach(FakeNode& node, const JoinSpec& spec, bool new_session) {
  auto [transport, peer] = make_memory_pipe();
  node.pipe = std::move(peer);
  node.stream.clear();
  node.opened = false;
  AttachCommand command;
  command.session = node.session;
  command.attachment = ++node.attachment;
  command.node = node.id;
  command.new_session = new_session;
  command.transport = std::move(transport);
  command.welcome.node = node.id;
  command.welcome.hub = hub();
  command.welcome.token = {std::byte{1}};
  command.resume_wanted = spec.resume;
  command.peer_epoch = spec.epoch;
  command.known_hub_epoch = !new_session && node.welcome ? node.welcome->epoch : 0;
  command.known_taken = new_session ? 0 : node.data_frames;
  command.peer_resume_bytes = spec.resume_bytes;
  command.peer_frame_bytes = spec.frame_bytes;
  command.told.assign(spec.told.begin(), spec.told.end());
  if (hub_of(node.id) != hub()) command.link = LinkAttach{{hub(), spec.allow}, 1'000};
  node.welcome.reset();
  node.goodbye.reset();
  this->command(node.shard.value(), std::move(command));
  publish(node, {node.shard, node.session.slot, node.session.generation});
  turn_shard(node.shard.value());
  node.read();
}

void HubRig::publish(const FakeNode& node, const NodePlace& place) {
  const HubId of = hub_of(node.id);
  if (of == hub()) return nodes_.publish(index_of(node.id), place);
  routes_.publish(of, {place, of});
}

void HubRig::release(FakeNode& node) {
  publish(node, {});
  command(node.shard.value(), ReleaseCommand{node.session});
}

void HubRig::renumber(FakeNode& node, std::uint32_t index) {
  nodes_.publish(index, {node.shard, node.session.slot, node.session.generation});
  nodes_.publish(index_of(node.id), NodePlace::renumbered());
  node.id = make_id<NodeId>(hub(), index);
  command(node.shard.value(), RenumberCommand{node.session, node.id, "another id"});
}

void HubRig::command(std::size_t shard, ShardCommand command) {
  released_ |= std::holds_alternative<ReleaseCommand>(command);
  shards_[shard]->send(std::move(command));
}

void HubRig::publish_group(std::uint32_t index, NodeId provider,
                           const std::vector<FakeNode*>& members, bool accepts) {
  auto group = std::make_unique<GroupMembers>();
  group->provider = provider;
  group->accepts = accepts;
  group->by_shard.resize(shards_.size());
  for (const FakeNode* member : members) {
    group->by_shard[member->shard.value()].put({member->session.slot, member->session.generation});
  }
  publish(index, std::move(group));
}

void HubRig::publish_paced_group(std::uint32_t index, NodeId provider,
                                 const std::vector<FakeNode*>& paced, bool retain, bool was_plain) {
  auto group = std::make_unique<GroupMembers>();
  group->provider = provider;
  group->retain = retain;
  group->by_shard.resize(shards_.size());
  group->paced_by_shard.resize(shards_.size());
  for (const FakeNode* member : paced) {
    group->paced_by_shard[member->shard.value()].put(
        {member->session.slot, member->session.generation, was_plain});
  }
  publish(index, std::move(group));
}

void HubRig::publish(std::uint32_t index, std::unique_ptr<GroupMembers> group) {
  group->provider_place = nodes_.find(index_of(group->provider));
  static_cast<void>(groups_.exchange(index, group.get()));
  members_.push_back(std::move(group));
}

void HubRig::withdraw_group(std::uint32_t index) {
  static_cast<void>(groups_.exchange(index, nullptr));
}

void HubRig::pace(FakeNode& node, std::uint32_t index, const PaceTerms& terms, bool retained,
                  bool was_plain) {
  command(node.shard.value(),
          PaceCommand{node.session, GroupId{group(index)}, terms, retained, was_plain});
}

std::vector<std::byte> HubRig::frame(const FakeNode& from, std::uint32_t dst,
                                     const std::string& payload, const FrameSpec& spec) {
  proto::FrameHeader header;
  header.length = static_cast<std::uint32_t>(payload.size());
  header.dst = dst;
  header.src = spec.src.value_or(from.id.value());
  header.kind = spec.kind;
  header.flags = spec.flags;
  header.lane = spec.lane;
  std::vector<std::byte> bytes(header.frame_size());
  proto::store_header(bytes.data(), header);
  if (!payload.empty())
    std::memcpy(bytes.data() + proto::kHeaderSize, payload.data(), payload.size());
  return bytes;
}

void HubRig::send(FakeNode& from, std::uint32_t dst, const std::string& payload,
                  const FrameSpec& spec) {
  write(from, frame(from, dst, payload, spec));
}

void HubRig::send_flow(FakeNode& from, const proto::flow::Message& message) {
  std::byte bytes[proto::flow::kFrameSizeMax];
  const std::size_t size = proto::flow::encode_frame(message, from.id, bytes);
  write(from, {bytes, size});
}

std::vector<Ready> HubRig::ready(std::size_t shard) {
  std::vector<Ready> ready;
  for (const FakeNode& node : nodes_played_) {
    if (node.shard.value() != shard || node.attachment == 0) continue;
    const Connection* connection = state(shard).find(node.session);
    if (connection == nullptr || !connection->connected) continue;
    ready.push_back(
        {connection->token(), node.pipe.transport_readable(), node.pipe.transport_writable()});
  }
  return ready;
}

void HubRig::turn_shard(std::size_t shard) {
  shards_[shard]->turn(ready(shard), now_ms);
  const Ledger sums = ledger();
  EXPECT_TRUE(sums.exact()) << "accepted " << sums.accepted << " + copies " << sums.copies
                            << " != delivered " << sums.delivered << " + dropped " << sums.dropped
                            << " + queued " << sums.queued;
  if (!released_ && next_index_ <= kGaugedSlots) check_sessions(sums);
}

/// The counts of the sessions add up to those of the shards, but for drops of which nobody knows
/// for whom the frame was.
void HubRig::check_sessions(const Ledger& sums) const {
  SessionCounts all;
  for (std::size_t shard = 0; shard < shards_.size(); ++shard) {
    for (const auto& connection : shards_[shard]->state().connections) {
      if (connection == nullptr) continue;
      const SessionCounts counts =
          sessions_[shard]->counts(connection->slot, connection->generation);
      all.accepted += counts.accepted;
      all.received_bytes += counts.received_bytes;
      all.delivered += counts.delivered;
      all.sent_bytes += counts.sent_bytes;
      all.dropped += counts.dropped;
    }
  }
  EXPECT_EQ(all.accepted, sums.accepted);
  EXPECT_EQ(all.received_bytes, sum(&ShardCounters::received_bytes));
  EXPECT_EQ(all.delivered, sums.delivered);
  EXPECT_EQ(all.sent_bytes, sum(&ShardCounters::sent_bytes));
  using proto::DropReason;
  std::uint64_t known = 0;
  for (const DropReason reason :
       {DropReason::queue_full, DropReason::replaced, DropReason::too_old, DropReason::too_large,
        DropReason::over_budget, DropReason::timed_out, DropReason::cut_message}) {
    known += dropped(reason);
  }
  // Of these, only those for a session that is there, or that waited for it.
  const std::uint64_t perhaps = dropped(DropReason::away) + dropped(DropReason::no_subscriber) +
                                dropped(DropReason::link_lost) + dropped(DropReason::link_unsure);
  EXPECT_GE(all.dropped, known);
  EXPECT_LE(all.dropped, known + perhaps);
}

void HubRig::turn() {
  for (std::size_t shard = 0; shard < shards_.size(); ++shard) turn_shard(shard);
}

std::uint64_t HubRig::activity() const {
  std::uint64_t sum = 0;
  for (const auto& counters : counters_) {
    sum += counters->received_bytes.value() + counters->sent_bytes.value() +
           counters->mailbox_entries.value() + counters->connections.value() +
           counters->reports.value();
  }
  const Ledger sums = ledger();
  return sum + sums.accepted + sums.delivered + 3 * sums.dropped;
}

void HubRig::settle_without_reading() {
  constexpr int kTurnsMax = 100'000;
  int quiet = 0;
  for (int turns = 0; quiet < 4; ++turns) {
    if (turns == kTurnsMax) {
      ADD_FAILURE() << "never quiet";
      return;
    }
    const std::uint64_t before = activity();
    turn();
    quiet = activity() == before ? quiet + 1 : 0;
  }
}

void HubRig::settle() {
  std::size_t read_before = 0;
  do {
    settle_without_reading();
    read_before = 0;
    for (FakeNode& node : nodes_played_) {
      read_before += node.pipe.readable();
      node.read();
    }
  } while (read_before != 0);
}

void HubRig::run_threads() {
  for (const auto& shard : shards_) shard->start();
  for (const auto& shard : shards_) shard->join();
}

void HubRig::pass_ms(std::uint64_t ms, bool answer_pings) {
  constexpr std::uint64_t kStepMs = 100;
  for (std::uint64_t passed = 0; passed < ms; passed += kStepMs) {
    now_ms += std::min(kStepMs, ms - passed);
    if (answer_pings) {
      for (FakeNode& node : nodes_played_) {
        if (!node.pipe.transport_gone()) send_flow(node, proto::flow::Pong{});
      }
    }
    turn();
  }
}

Ledger HubRig::ledger() const {
  Ledger sums;
  for (const auto& counters : counters_) {
    sums.accepted += counters->accepted.value();
    sums.copies += counters->copies.value();
    sums.delivered += counters->delivered.value();
    sums.queued += counters->queued.value();
    for (const Counter& dropped : counters->dropped) sums.dropped += dropped.value();
  }
  return sums;
}

std::uint64_t HubRig::dropped(proto::DropReason reason) const {
  std::uint64_t sum = 0;
  for (const auto& counters : counters_)
    sum += counters->dropped[static_cast<std::size_t>(reason)].value();
  return sum;
}

std::uint64_t HubRig::sum(Counter ShardCounters::* counter) const {
  std::uint64_t sum = 0;
  for (const auto& counters : counters_) sum += ((*counters).*counter).value();
  return sum;
}

std::vector<ShardEvent> HubRig::take_events() {
  std::vector<ShardEvent> events;
  inbox_.drain(10'000, [&](ShardEvent&& event) { events.push_back(std::move(event)); });
  return events;
}

std::optional<DetachedEvent> HubRig::take_detached() {
  for (ShardEvent& event : take_events()) {
    if (auto* detached = std::get_if<DetachedEvent>(&event.what)) return std::move(*detached);
  }
  return std::nullopt;
}

}  // namespace gimnet::hub::testing
