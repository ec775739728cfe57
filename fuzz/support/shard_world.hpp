#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "fuzz/support/fuzz_input.hpp"
#include "hub/shard/io_shard.hpp"
#include "proto/frame/flow.hpp"
#include "proto/frame/frame_parser.hpp"
#include "tests/support/memory_stream.hpp"

namespace gimnet::hub::fuzzing {

inline constexpr HubId kHub{7};
inline constexpr std::uint32_t kGroupIndex = 1;

/// Small bounds, so that a short input reaches them.
inline Limits small_limits() {
  Limits limits;
  limits.lane0_bytes = limits.lane1_bytes = limits.lane2_bytes = limits.lane3_bytes = 2 * 1024;
  limits.reserve_bytes = 1024;
  limits.resume_bytes = 1024;
  limits.control_bytes = 2 * 1024;
  limits.requests = 3;
  limits.block_ms = 1'000;
  limits.retained_message_bytes = 1'000;
  limits.retained_budget_bytes = 4'000;
  return limits;
}

/// One of the two nodes.
struct Node {
  NodeId id;
  SessionRef session;
  std::uint32_t attachment = 0;
  MemoryPeer pipe;
  std::vector<std::byte> stream;
  bool opened = false;
  bool welcomed = false;
  std::uint64_t taken = 0;
  std::uint64_t hub_epoch = 0;
};

/// A whole io shard with two admitted nodes, on the in-memory transport. Ends in an abort where the
/// ledger is not exact, or something comes out that is no legal frame, or that neither of the two
/// wrote.
class ShardWorld {
 public:
  ShardWorld()
      : shared_{kHub,        limits_,   nodes_,       groups_,          routes_,
                quiescence_, budget_,   link_budget_, retained_budget_, inbox_,
                {&mailbox_}, {&waker_}, {&counters_}, {&sessions_}},
        shard_(std::make_unique<IoShard>(ShardIndex{0}, shared_, IoShard::Options{})) {
    for (std::uint32_t i = 0; i < 2; ++i) {
      node_[i].id = make_id<NodeId>(kHub, i + 1);
      node_[i].session = {ConnectionSlot{i}, 100 + i};
      attach(node_[i], true);
    }
    members_.provider = node_[0].id;
    members_.provider_place = {ShardIndex{0}, node_[0].session.slot, node_[0].session.generation};
    members_.accepts = true;
    members_.by_shard.push_back({{node_[1].session.slot, node_[1].session.generation}});
    static_cast<void>(groups_.exchange(kGroupIndex, &members_));
  }
  virtual ~ShardWorld() { shard_->let_go(); }
  ShardWorld(const ShardWorld&) = delete;
  ShardWorld& operator=(const ShardWorld&) = delete;

  void step(std::uint8_t choice, fuzz::Choices& input) {
    Node& node = node_[choice & 1];
    switch (choice >> 1 & 7) {
      case 0:
      case 1:
        node.pipe.write(input.bytes(std::size_t{input.byte()} | std::size_t{input.byte()} << 8));
        break;
      case 2:
        node.pipe.plan_receives(std::vector<std::size_t>(16, 1 + input.below(64)));
        break;
      case 3:
        node.pipe.set_room(std::size_t{8} * input.byte());
        break;
      case 4:
        node.pipe.set_room(MemoryPeer::kAll);
        break;
      case 5:
        read(node);
        break;
      case 6:
        now_ms_ += std::uint64_t{20} * input.byte();
        break;
      default:
        if (node.pipe.transport_gone() || input.below(2) == 0) attach(node, false);
    }
    turn();
  }

  void finish() {
    for (Node& node : node_) {
      node.pipe.set_room(MemoryPeer::kAll);
      node.pipe.plan_receives({});
    }
    for (int i = 0; i < 20; ++i) turn();
    for (Node& node : node_) {
      read(node);
      shard_->send(ReleaseCommand{node.session});
    }
    turn();
    FUZZ_MUST(counters_.queued.value() == 0);
    FUZZ_MUST(counters_.gap_frames.value() <= kGapFramesMost);
    // The slab that is read into may have been kept by a frame that is gone; the next read finds
    // out.
    FUZZ_MUST(shard_->state().pool.pinned_bytes() <=
              kBufferRoom + kSlabReadBytes + 16 + limits_.frame_bytes);
  }

 protected:
  /// A frame of a group came to the second node.
  virtual void on_group_frame(const proto::FrameView&) {}
  /// The counts of the node's data frames begin at 0.
  virtual void on_new_epoch(const Node&) {}
  /// A connection of the node begins; all that could be read of the former one was read.
  virtual void on_attach(const Node&) {}
  /// Its WELCOME came.
  virtual void on_welcome(const Node&) {}
  /// An answer came to the node.
  virtual void on_answer(const Node&) {}

  void attach(Node& node, bool new_session) {
    if (!new_session) read(node);
    on_attach(node);
    auto [transport, peer] = make_memory_pipe();
    node.pipe = std::move(peer);
    node.stream.clear();
    node.opened = node.welcomed = false;
    AttachCommand command;
    command.session = node.session;
    command.attachment = ++node.attachment;
    command.node = node.id;
    command.new_session = new_session;
    command.transport = std::move(transport);
    command.welcome.node = node.id;
    command.welcome.token = {std::byte{1}};
    command.resume_wanted = node.id == node_[1].id;
    command.peer_epoch = 5;
    command.known_hub_epoch = node.hub_epoch;
    command.known_taken = node.taken;
    command.peer_resume_bytes = 256;
    command.peer_frame_bytes = 4096;
    shard_->send(std::move(command));
    nodes_.publish(index_of(node.id), {ShardIndex{0}, node.session.slot, node.session.generation});
    turn();
  }

  void turn() {
    std::vector<Ready> ready;
    for (const Node& node : node_) {
      const Connection* connection = shard_->state().find(node.session);
      if (connection == nullptr || !connection->connected) continue;
      ready.push_back(
          {connection->token(), node.pipe.transport_readable(), node.pipe.transport_writable()});
    }
    shard_->turn(ready, now_ms_);
    inbox_.drain(1'000, [](ShardEvent&&) {});
    std::uint64_t dropped = 0;
    for (const Counter& reason : counters_.dropped) dropped += reason.value();
    FUZZ_MUST(counters_.accepted.value() + counters_.copies.value() ==
              counters_.delivered.value() + dropped + counters_.queued.value());
  }

  void read(Node& node) {
    node.pipe.read(node.stream);
    std::size_t begin = 0;
    if (!node.opened && node.stream.size() >= proto::kOpeningSize) {
      FUZZ_MUST(proto::check_opening(node.stream) == proto::Opening::accepted);
      node.opened = true;
      begin = proto::kOpeningSize;
    }
    while (node.opened && node.stream.size() - begin >= proto::kHeaderSize) {
      const std::span<const std::byte> rest = std::span(node.stream).subspan(begin);
      const auto frame = proto::parse_frame(rest, proto::Origin::hub);
      if (!frame) FUZZ_MUST(frame.error() == proto::FrameError::incomplete);
      if (!frame) break;
      check(node, *frame);
      begin += frame->header.frame_size();
    }
    node.stream.erase(node.stream.begin(),
                      node.stream.begin() + static_cast<std::ptrdiff_t>(begin));
  }

  void check(Node& node, const proto::FrameView& frame) {
    const proto::FrameHeader& header = frame.header;
    const bool from_hub = header.src == make_id<NodeId>(kHub, kHubIndex).value();
    const auto kind = static_cast<std::uint8_t>(header.kind);
    if (header.kind == proto::Kind::flow) {
      const auto message = proto::flow::decode(frame.payload);
      FUZZ_MUST(message.has_value());
      if (const auto* skip = std::get_if<proto::flow::Skip>(&*message)) node.taken += skip->count;
      return;
    }
    if (kind >= proto::kFirstControlKind || header.kind == proto::Kind::report) {
      FUZZ_MUST(from_hub && header.dst == node.id.value());
      if (const auto welcome = proto::decode<proto::Welcome>(frame.payload)) {
        node.welcomed = true;
        if (!welcome->resumed) node.taken = 0;
        if (!welcome->resumed) on_new_epoch(node);
        node.hub_epoch = welcome->epoch;
        on_welcome(node);
      }
      if (header.kind == proto::Kind::ns) on_answer(node);
      return;
    }
    ++node.taken;
    FUZZ_MUST(header.src == node_[0].id.value() || header.src == node_[1].id.value());
    FUZZ_MUST(header.length <= 4096 && header.hops == 0 && !header.has(proto::kFlagReservedMask));
    switch (header.kind) {
      case proto::Kind::group:
        FUZZ_MUST(node.id == node_[1].id && header.src == node_[0].id.value());
        on_group_frame(frame);
        break;
      case proto::Kind::list:
        FUZZ_MUST(header.dst == 0);
        break;
      case proto::Kind::broadcast:
        FUZZ_MUST(header.src != node.id.value());
        break;
      case proto::Kind::service:
        FUZZ_MUST(node.id == node_[0].id);
        break;
      default:
        FUZZ_MUST(header.dst == node.id.value());
    }
  }

  const Limits limits_ = small_limits();
  NodeTable nodes_;
  GroupTable groups_;
  RouteTable routes_;
  Quiescence quiescence_{1};
  Budget budget_{limits_.budget_bytes};
  Budget link_budget_{limits_.link_budget_bytes};
  Budget retained_budget_{limits_.retained_budget_bytes};
  ControlInbox inbox_{1};
  Waker waker_;
  Mailbox mailbox_{1, {limits_.mailbox_entries, limits_.mailbox_bytes}, waker_};
  ShardCounters counters_;
  SessionGauges sessions_{8};
  const HubShared shared_;
  GroupMembers members_;
  Node node_[2];
  std::unique_ptr<IoShard> shard_;
  std::uint64_t now_ms_ = 1'000'000;
};

}  // namespace gimnet::hub::fuzzing
