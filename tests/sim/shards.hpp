#pragma once

#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "hub/concurrent/quiescence.hpp"
#include "hub/control/shard_proxy.hpp"
#include "hub/data/fanout/mailbox.hpp"
#include "hub/data/fanout/recipient.hpp"
#include "hub/data/tables/group_table.hpp"
#include "hub/data/tables/node_table.hpp"
#include "hub/shard/connection.hpp"
#include "proto/frame/frame_header.hpp"
#include "tests/sim/checker.hpp"
#include "tests/sim/network.hpp"

namespace gimnet::sim {

/// Tells the nodes that may get a frame, by the reference model and not by the hub's tables.
class Witness {
 public:
  virtual ~Witness() = default;
  /// The session that has the index now; 0: nobody.
  [[nodiscard]] virtual std::uint64_t session_of(std::uint32_t index) const = 0;
  /// Does the group exist, and does that node send to it?
  [[nodiscard]] virtual bool provides(std::uint32_t index, std::uint32_t group) const = 0;
  [[nodiscard]] virtual bool subscribes(std::uint32_t index, std::uint32_t group) const = 0;
  /// Which stream of messages that group carries now, if its last message is to be kept; 0: none.
  [[nodiscard]] virtual std::uint64_t retained_stream(std::uint32_t group) const = 0;
};

/// The shards of a hub as the conductor sees them: commands are carried out in order, at any time
/// later; events come back in order; tables are read at any time between; all commands that wait
/// are carried out before mail is taken (hub/shard/commands.hpp). Frames go where the published
/// tables say. Thread safety: none. Lifetime: one life of the hub.
class SimShards final : public hub::ShardProxy {
 public:
  struct Parts {
    HubId hub;
    std::size_t shards = 1;
    const hub::NodeTable& nodes;
    const hub::GroupTable& groups;
    hub::Quiescence& quiescence;
    Network& network;
    std::function<void()> conductor_wanted;
    /// Called while the conductor sends what lets somebody know: it must have published before.
    std::function<void(ShardIndex, const hub::ShardCommand&)> before_it_leaves;
    std::function<bool(std::uint32_t node)> is_slow;
  };
  SimShards(Setting& setting, Parts parts);
  void believe(const Witness& witness) { witness_ = &witness; }

  // The conductor's side
  void send(ShardIndex shard, hub::ShardCommand command) override;
  [[nodiscard]] std::size_t shards() const override { return shards_.size(); }
  /// Shards that have something to tell the conductor.
  [[nodiscard]] std::vector<std::size_t> with_events() const;
  [[nodiscard]] hub::ShardEvent take_event(std::size_t shard);
  struct Sent {
    ShardIndex shard;
    const hub::ShardCommand* command = nullptr;
  };
  /// The frames that were sent since forget_sent(). Valid until: time goes on.
  [[nodiscard]] const std::vector<Sent>& sent() const { return sent_; }
  void forget_sent() { sent_.clear(); }

  // The network's side
  void has_something(Wire& wire);
  /// Nothing is heard of the node from now on, or again.
  void set_mute(const WirePointer& wire, bool mute);
  /// The hub's process is gone, and with it its ends of all connections.
  void die();

  /// Nothing waits to be done.
  [[nodiscard]] bool idle() const;
  [[nodiscard]] std::size_t connected() const;
  /// All that was sent was taken and credited, nothing is held, and nothing is kept of services
  /// that are gone.
  void require_at_rest() const;

 private:
  struct Data {
    Bytes frame;
    std::uint64_t for_session = 0;
  };
  /// A paced subscription. What may go when is decided by the hub's own counts; the frames wait
  /// here.
  struct Pace {
    Pace(hub::Recipient& nobody, GroupId group, const hub::PaceTerms& terms)
        : counts(nobody, group, terms) {}
    hub::PacedSubscription counts;
    std::deque<Data> held;
    std::optional<Time> wakes;  ///< when it is looked at next
    // For the checker of rates, which does not ask the counts
    std::uint64_t begun = 0;   ///< since its terms changed
    Time first{};              ///< of those
    std::optional<Time> last;  ///< since it began: the next one waits for an interval at most
  };
  /// A session on its shard, and its connection while it has one.
  struct Seat {
    hub::SessionRef session;
    NodeId node;
    std::uint64_t number = 0;  ///< of the session, by the reference model
    std::uint32_t attachment = 0;
    WirePointer wire;
    bool waits_when_away = false;
    std::uint64_t requests = 0;
    hub::EventState events = hub::EventState::told;
    std::deque<Bytes> control;
    std::deque<Data> data;
    std::map<std::uint32_t, std::unique_ptr<Pace>> paces;  ///< by group
    bool ready = false;
    bool flush_due = false;
  };
  struct Mail {
    hub::MailKind kind = hub::MailKind::frames;
    Bytes frame;
    hub::GroupStart start{};
  };
  /// The last message of a retained group, on its provider's shard.
  struct Kept {
    NodeId provider;
    Bytes frame;
  };
  struct Shard {
    std::deque<hub::ShardCommand> commands;
    std::deque<hub::ShardEvent> events;
    std::map<std::size_t, std::deque<Mail>> mail;  ///< by the shard that sent it; none is empty
    std::vector<std::unique_ptr<Seat>> seats;      ///< by slot
    std::vector<bool> used;                        ///< by slot: somebody had it before
    std::vector<std::uint32_t> ready;              ///< slots to be read
    std::map<std::uint32_t, Kept> kept;            ///< by group
    bool turn_due = false;
    bool draining = false;
    std::size_t lasts = 0;  ///< other shards that drain, too, and of which everything came
  };

  void want_turn(std::size_t shard);
  void turn(std::size_t shard);
  void take_commands(std::size_t shard, std::size_t most);
  void take_mail(std::size_t shard);
  void serve_one(std::size_t shard);
  void execute(std::size_t shard, hub::ShardCommand& command);
  void attach(std::size_t shard, hub::AttachCommand& command);
  Seat& seat_for(std::size_t shard, const hub::AttachCommand& command);
  void say(std::size_t shard, const hub::SendControlCommand& command);
  /// An event for the seat: is it to be dropped?
  [[nodiscard]] bool misses(Seat& seat);
  void ask_to_be_told(std::size_t shard, Seat& seat);
  void tell_again(std::size_t shard, const hub::TellAgainCommand& command);
  void on_flow(std::size_t shard, Seat& seat, const Bytes& frame);
  void release(std::size_t shard, hub::SessionRef session);
  void drain(std::size_t shard);
  /// When each other shard has handed over its last.
  void end_drain_if_all(std::size_t shard);
  void finish_drain(std::size_t shard);
  void read(std::size_t shard, Seat& seat);
  /// False: the connection has ended.
  bool handle(std::size_t shard, Seat& seat, Bytes frame);
  bool handle_control(std::size_t shard, Seat& seat, Bytes frame);
  void close(std::size_t shard, Seat& seat, proto::GoodbyeCode code, const char* sentence);
  void detach(Seat& seat, std::optional<proto::Goodbye> told);
  void lose_data(Seat& seat);
  void tell(std::size_t shard, const Seat& seat, bool said_by_peer, proto::GoodbyeCode code,
            std::string sentence);
  void push_event(std::size_t shard, hub::ShardEvent event);

  void route(std::size_t shard, const Bytes& frame, bool handed_over);
  void to_node(std::size_t shard, const Bytes& frame, std::uint32_t index, bool handed_over);
  struct To {
    hub::NodePlace place;
    std::uint64_t session = 0;  ///< which is meant
  };
  void to_place(std::size_t shard, const Bytes& frame, const To& to, bool handed_over);
  void to_group(std::size_t shard, const Bytes& frame, bool handed_over);
  void to_provider(std::size_t shard, const Bytes& frame, bool handed_over);
  void to_paced(std::size_t shard, const Bytes& frame,
                const hub::MemberList<hub::PacedMember>& members);
  void require_subscribed(const Seat& seat, std::uint32_t group) const;
  void deliver(std::size_t shard, Seat& seat, const Bytes& frame, std::uint64_t for_session);
  static void require_for(const Seat& seat, std::uint64_t session);
  void push(std::size_t shard, Seat& seat, Data data);
  [[nodiscard]] std::vector<GroupId> make_room(Seat& seat, const proto::FrameHeader& header);
  void post(std::size_t from, std::size_t to, Mail mail);

  // Pace: as hub/data/fanout/pacer.hpp and retained_messages.hpp do it, for messages of one frame
  void begin_pace(std::size_t shard, const hub::PaceCommand& command);
  void end_pace(std::size_t shard, const hub::EndPaceCommand& command);
  [[nodiscard]] static Pace* find_pace(const Seat& seat, GroupId group);
  /// False: it is not for this subscriber.
  bool offer(std::size_t shard, Seat& seat, Pace& pace, Data data);
  void hold(Pace& pace, Data data);
  void pass(std::size_t shard, Seat& seat, Pace& pace, Data data);
  void release_held(std::size_t shard, Seat& seat, Pace& pace);
  void wait_until_due(std::size_t shard, Seat& seat, Pace& pace);
  [[nodiscard]] static Time latest_due(const Pace& pace);
  void on_credit(std::size_t shard, Seat& seat, const proto::flow::Credit& credit);
  /// The counts of its connection begin at 0.
  void count_anew(std::size_t shard, Seat& seat);
  void keep_last(std::size_t shard, const Bytes& frame);
  void ask_start(std::size_t shard, const Seat& seat, Pace& pace);
  void begin_counts(Seat& seat, Pace& pace, std::uint8_t number);
  [[nodiscard]] bool is_of_another(const hub::GroupStart& start) const;
  void rename_source(std::size_t shard, NodeId former, NodeId present);
  void on_start_wanted(std::size_t shard, const hub::GroupStart& start);
  void require_last(const hub::GroupStart& start, const Kept* kept) const;
  [[nodiscard]] Pace* pace_of(const hub::GroupStart& start);
  void on_start(const hub::GroupStart& start);
  void on_handed(const hub::GroupStart& start, const Bytes& frame);

  void want_flush(std::size_t shard, Seat& seat);
  void flush(std::size_t shard, Seat& seat);
  [[nodiscard]] Seat* find(std::size_t shard, ConnectionSlot slot, std::uint32_t generation);

  Setting& setting_;
  const Parts parts_;
  const Witness* witness_ = nullptr;
  std::vector<Shard> shards_;
  std::vector<Sent> sent_;
  /// The last message of each retained group that was routed, and of which stream: what a new
  /// subscriber is owed.
  struct Last {
    std::uint64_t stream = 0;
    std::uint64_t message = 0;
  };
  std::map<std::uint32_t, Last> last_;  ///< by group index
  std::uint32_t starts_ = 0;            ///< asked for
  hub::Recipient nobody_;               ///< for the counts, which do not deliver
  bool dead_ = false;
};

/// A whole frame; the header's length is filled in.
[[nodiscard]] Bytes frame_of(proto::FrameHeader header, std::span<const std::byte> payload);
/// Whole frames that stand one behind the other.
[[nodiscard]] std::vector<Bytes> split_frames(std::span<const std::byte> bytes);
/// The number that a message between nodes says: a later one has a larger one.
[[nodiscard]] std::uint64_t message_of(const Bytes& frame);
/// A whole LINK frame from the hub.
[[nodiscard]] Bytes link_frame(NodeId to, HubId hub, const proto::Payload& payload);

}  // namespace gimnet::sim
