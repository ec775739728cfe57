#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "hub/shard/io_shard.hpp"
#include "proto/control/link.hpp"
#include "proto/frame/flow.hpp"
#include "proto/frame/frame_header.hpp"
#include "proto/frame/report.hpp"
#include "tests/hub/shard/support/fake_node.hpp"
#include "tests/support/memory_stream.hpp"

namespace gimnet::hub::testing {

struct FrameSpec {
  proto::Kind kind = proto::Kind::unicast;
  std::uint8_t flags = 0;
  std::uint8_t lane = 1;
  std::optional<std::uint32_t> src = std::nullopt;  ///< absent: the sending node's id
};

/// The terms on which a node joins, or comes back.
struct JoinSpec {
  bool resume = false;
  std::uint64_t epoch = 77;
  std::uint32_t frame_bytes = proto::kFrameLengthDefault;
  std::uint32_t resume_bytes = 1u << 20;
  std::span<const std::byte> told{};  ///< control frames that it gets first
  std::vector<HubId> allow{};         ///< of a link: as LinkRule has it
};

/// The sums of the ledger over all shards.
struct Ledger {
  std::uint64_t accepted = 0;
  std::uint64_t copies = 0;
  std::uint64_t delivered = 0;
  std::uint64_t dropped = 0;
  std::uint64_t queued = 0;
  [[nodiscard]] bool exact() const { return accepted + copies == delivered + dropped + queued; }
};

/// The shards of a hub without threads, sockets or a conductor: a test plays all of these, by turns
/// and a fake clock.
class HubRig {
 public:
  explicit HubRig(std::size_t shards = 1, Limits limits = {});
  ~HubRig();
  HubRig(const HubRig&) = delete;
  HubRig& operator=(const HubRig&) = delete;

  /// A new session on that shard. The reference stays good.
  FakeNode& join(std::size_t shard, const JoinSpec& spec = {});
  /// A link to that hub, over which the route to it leads. The reference stays good.
  FakeNode& link(std::size_t shard, HubId to, const JoinSpec& spec = {});
  /// Another connection for its session; its counts tell what it took so far.
  void rejoin(FakeNode& node, const JoinSpec& spec = {});
  /// A node that a test had attached by itself, with the far end of its connection. The reference
  /// stays good.
  FakeNode& adopt(FakeNode node) { return nodes_played_.emplace_back(std::move(node)); }
  void release(FakeNode& node);
  /// Gives the node another id. Its connection is closed in the next turn.
  void renumber(FakeNode& node, std::uint32_t index);
  void command(std::size_t shard, ShardCommand command);
  /// Makes `provider` the owner of a group with these members. `accepts`: it takes data.
  void publish_group(std::uint32_t index, NodeId provider, const std::vector<FakeNode*>& members,
                     bool accepts = false);
  /// The same with members that are paced: each needs pace() too.
  void publish_paced_group(std::uint32_t index, NodeId provider,
                           const std::vector<FakeNode*>& paced, bool retain = false,
                           bool was_plain = false);
  void withdraw_group(std::uint32_t index);
  void pace(FakeNode& node, std::uint32_t index, const PaceTerms& terms, bool retained = false,
            bool was_plain = false);

  void write(FakeNode& node, std::span<const std::byte> bytes) { node.pipe.write(bytes); }
  void send(FakeNode& from, std::uint32_t dst, const std::string& payload,
            const FrameSpec& spec = {});
  void send_flow(FakeNode& from, const proto::flow::Message& message);
  [[nodiscard]] static std::vector<std::byte> frame(const FakeNode& from, std::uint32_t dst,
                                                    const std::string& payload,
                                                    const FrameSpec& spec = {});

  /// The answer of a poller about the connections of that shard.
  [[nodiscard]] std::vector<Ready> ready(std::size_t shard);
  [[nodiscard]] IoShard& shard(std::size_t shard) { return *shards_[shard]; }
  /// One turn of one shard, or of each in order. Checks the ledger after all.
  void turn_shard(std::size_t shard);
  void turn();
  /// Turns until nothing moves any more, and each node read what came for it.
  void settle();
  void settle_without_reading();
  /// Lets go as a hub does at its end, when its threads are gone.
  void let_go();
  /// Starts the threads of all shards and waits for their end: each was told to stop before.
  void run_threads();
  /// Fake time passes in ticks, each with a turn.
  void pass_ms(std::uint64_t ms, bool answer_pings = true);

  [[nodiscard]] Ledger ledger() const;
  [[nodiscard]] std::uint64_t dropped(proto::DropReason reason) const;
  [[nodiscard]] std::uint64_t sum(Counter ShardCounters::* counter) const;
  [[nodiscard]] std::vector<ShardEvent> take_events();
  [[nodiscard]] std::optional<DetachedEvent> take_detached();
  [[nodiscard]] ShardState& state(std::size_t shard) { return shards_[shard]->state(); }
  [[nodiscard]] SessionCounts counts(const FakeNode& node) const {
    return sessions_[node.shard.value()]->counts(node.session.slot, node.session.generation);
  }
  [[nodiscard]] Connection* connection(const FakeNode& node) {
    return state(node.shard.value()).find(node.session);
  }
  [[nodiscard]] HubId hub() const { return HubId{7}; }
  [[nodiscard]] NodeTable& nodes() { return nodes_; }
  [[nodiscard]] GroupTable& groups() { return groups_; }
  [[nodiscard]] RouteTable& routes() { return routes_; }
  [[nodiscard]] Quiescence& quiescence() { return quiescence_; }
  [[nodiscard]] static std::uint32_t group(std::uint32_t index) {
    return make_id<GroupId>(HubId{7}, index).value();
  }

  std::uint64_t now_ms = 1'000'000;

 private:
  void publish(const FakeNode& node, const NodePlace& place);
  FakeNode& begin(std::size_t shard, NodeId id, const JoinSpec& spec);
  void attach(FakeNode& node, const JoinSpec& spec, bool new_session);
  void publish(std::uint32_t index, std::unique_ptr<GroupMembers> group);
  [[nodiscard]] std::uint64_t activity() const;
  void check_sessions(const Ledger& sums) const;

  Limits limits_;
  NodeTable nodes_;
  GroupTable groups_;
  RouteTable routes_;
  Quiescence quiescence_;
  Budget budget_;
  Budget link_budget_;
  Budget retained_budget_{limits_.retained_budget_bytes};
  ControlInbox inbox_;
  std::vector<std::unique_ptr<Waker>> wakers_;
  std::vector<std::unique_ptr<Mailbox>> mailboxes_;
  std::vector<std::unique_ptr<ShardCounters>> counters_;
  static constexpr std::size_t kGaugedSlots = 1024;
  std::vector<std::unique_ptr<SessionGauges>> sessions_;
  std::optional<HubShared> shared_;
  std::vector<std::unique_ptr<IoShard>> shards_;
  std::deque<FakeNode> nodes_played_;
  std::vector<std::unique_ptr<const GroupMembers>> members_;
  std::uint32_t next_index_ = 1;
  bool released_ = false;  ///< a session ended: what it came to is not known any more
};

}  // namespace gimnet::hub::testing
