#include "fuzz/hub/control/support/control_hub.hpp"

#include "fuzz/support/fuzz_input.hpp"
#include "hub/shard/control_frame.hpp"
#include "proto/control/ns.hpp"

namespace gimnet::fuzz {
namespace {

namespace ns = proto::ns;

/// A transport that leads nowhere.
class NoTransport final : public hub::Transport {
 public:
  hub::IoResult receive(std::span<std::byte>) override { return {}; }
  hub::IoResult send(std::span<const iovec>) override { return {}; }
  [[nodiscard]] std::uint64_t unsent_bytes() const override { return 0; }
  void limit_unsent(std::uint32_t) override {}
  void limit_unacknowledged(std::uint32_t) override {}
  [[nodiscard]] int descriptor() const override { return -1; }
};

hub::SessionRef ref_of(const Seat& seat) { return {ConnectionSlot{seat.slot}, seat.generation}; }

std::size_t members_of(const hub::GroupMembers& group) {
  std::size_t count = 0;
  for (const auto& list : group.by_shard) count += list.size();
  for (const auto& list : group.paced_by_shard) count += list.size();
  return count;
}

}  // namespace

hub::HubFacts ControlHub::facts() {
  hub::HubFacts facts;
  facts.id = kHub;
  facts.name = "fuzzed";
  facts.version = "0";
  facts.shards = kShards;
  return facts;
}

ControlHub::ControlHub(const hub::Limits& first_limits)
    : limits(first_limits),
      conductor(
          facts(), hub::Placement::spread, limits,
          hub::Conductor::Wiring{shards,
                                 {nodes, groups, quiescence},
                                 readable,
                                 {},
                                 {},
                                 {},
                                 nullptr,
                                 [this] { return read_again ? read_again() : hub::Reloading{}; },
                                 {}}) {
  shards.on_send = [this](const hub::ShardCommand& command) { before_it_leaves(command); };
}

void ControlHub::before_it_leaves(const hub::ShardCommand& command) const {
  if (const auto* attach = std::get_if<hub::AttachCommand>(&command)) {
    FUZZ_MUST(nodes.find(index_of(attach->node)).generation == attach->session.generation);
  }
  const auto* control = std::get_if<hub::SendControlCommand>(&command);
  if (control == nullptr) return;
  if (control->answers != 0) FUZZ_MUST(groups_are_published());
  if (const auto moved = proto::decode<ns::ServiceMoved>(payload_of(*control));
      moved && control->answers == 0) {
    // Who subscribed hears of a group before anybody can send to it.
    if (moved->new_group != GroupId{})
      FUZZ_MUST(groups.find(index_of(moved->new_group)) == nullptr);
  }
}

bool ControlHub::groups_are_published() const {
  const auto& all = conductor.membership().services().groups();
  return std::all_of(all.begin(), all.end(), [this](const auto& entry) {
    const hub::GroupMembers* members = groups.find(entry.first);
    return members != nullptr && members_of(*members) == entry.second->subscribers.size();
  });
}

void ControlHub::pass_fences() {
  for (std::size_t i = 0; i < shards.sent.size(); ++i) {
    const auto* fence = std::get_if<hub::FenceCommand>(&shards.sent[i].command);
    if (fence == nullptr) continue;
    const hub::Fence passed{.of = shards.sent[i].shard, .ticket = fence->ticket};
    for (std::size_t shard = 0; shard < kShards; ++shard) {
      const ShardIndex index{static_cast<std::uint8_t>(shard)};
      if (index != passed.of) conductor.on_event({index, hub::FencePassedEvent{passed}}, now);
    }
  }
}

std::optional<proto::Goodbye> ControlHub::admit(const Stranger& stranger) {
  shards.sent.clear();
  hub::Stranger made;
  made.transport = std::make_unique<NoTransport>();
  made.peer = {"tcp", stranger.place};
  made.identity = stranger.identity;
  made.may_administer = stranger.may_administer;
  auto refusal =
      conductor.admit(made, stranger.hello, {now, std::chrono::nanoseconds{wall()}.count()});
  for (const auto& [shard, attach] : all<hub::AttachCommand>()) {
    if (!attach->tell_heard) continue;
    conductor.on_event(
        {ShardIndex{shard}, hub::HeardEvent{attach->session, attach->attachment, attach->node}},
        now);
  }
  pass_fences();
  return refusal;
}

std::optional<proto::Payload> ControlHub::ask(const Line& line, proto::Kind kind,
                                              std::span<const std::byte> payload, NodeId dst) {
  shards.sent.clear();
  conductor.on_event({ShardIndex{line.seat.shard},
                      hub::ControlFrameEvent{ref_of(line.seat), line.attachment, line.node,
                                             hub::control_frame(kind, dst, HubId{}, payload)}},
                     now);
  pass_fences();
  std::optional<proto::Payload> answer;
  for (const auto& [shard, command] : all<hub::SendControlCommand>()) {
    if (command->answers == 0) continue;
    FUZZ_MUST(!answer && command->answers == 1);
    FUZZ_MUST(
        (Seat{shard, command->session.slot.value(), command->session.generation} == line.seat));
    FUZZ_MUST(command->attachment == line.attachment);
    const proto::FrameHeader header = proto::load_header(command->frame.data());
    FUZZ_MUST(header.kind == kind && header.dst == line.node.value());
    const auto said = payload_of(*command);
    const auto asked = proto::split_control(payload);
    const auto view = proto::split_control(said);
    FUZZ_MUST(asked && view && view->header.request == asked->header.request);
    FUZZ_MUST(view->header.operation == (asked->header.operation | proto::kAnswerBit));
    answer.emplace(said.begin(), said.end());
  }
  return answer;
}

void ControlHub::end(const Line& line, bool said_by_peer, proto::GoodbyeCode code) {
  shards.sent.clear();
  conductor.on_event(
      {ShardIndex{line.seat.shard}, hub::DetachedEvent{ref_of(line.seat), line.attachment,
                                                       line.node, said_by_peer, code, "why"}},
      now);
  pass_fences();
}

void ControlHub::pass(milliseconds time) {
  shards.sent.clear();
  now += time;
  conductor.tick(now);
  pass_fences();
}

bool ControlHub::serve() {
  shards.sent.clear();
  return conductor.serve_watches(now);
}

void ControlHub::drain() {
  shards.sent.clear();
  conductor.drain();
}

void ControlHub::drained(std::size_t shard) {
  shards.sent.clear();
  conductor.on_event({ShardIndex{static_cast<std::uint8_t>(shard)}, hub::DrainedEvent{}}, now);
}

}  // namespace gimnet::fuzz
