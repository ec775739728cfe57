#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "gimnet/gimi/message.hpp"
#include "gimnet/gimi/node_state.hpp"
#include "gimnet/gimi/options.hpp"
#include "gimnet/gimi/outcome.hpp"
#include "gimnet/gimi/records.hpp"

// GIMI: how programs use GIMnet. Only the standard library is needed. docs/gimi.md explains it with
// examples.
//
//     gimnet::Node node("robot");  // joins by the hub of this machine, or of GIMNET_HUB
//     auto odometry = node.advertise("odom").or_throw();  // robot/odom
//     odometry.publish("x 1.0 y 2.0").or_throw();
//
//     gimnet::Node node("viewer");
//     auto odometry = node.subscribe("robot/odom").or_throw();  // need not exist yet
//     while (auto message = odometry.receive()) show(message->text());
//
// Errors: calls answer with an Outcome; those that throw instead are marked, and `.or_throw()`
// turns any into throwing. Thread safety: every function of every class may be called from any
// thread at any time, on one object from many. Lifetime: Senders, Publishers, Subscriptions, Queues
// and Watches are handles that can be copied and may outlive their Node; when it is closed they
// answer Status::closed. If no connection will come any more (the node was kicked, or replaced
// by another connection of its session, or does not reconnect) everything answers Status::refused
// or, without reconnecting, Status::not_connected, and the sentence says why; what was received
// before still comes. Moving: what was moved from may only be destroyed or assigned to; a Node may
// be closed, too. Times: all that wait take a Timeout in ms and wait for at most that; kForever has
// no limit, kNoWait does not wait. Only the end of a handle waits without one, a second at most:
// Node::close(), and the last Publisher, Subscription or Watch. Callbacks: there are none. Received
// messages wait in queues, which the program empties when it has time.

namespace gimnet {

namespace gimi {
class Core;
class MessageQueue;
class SendStream;
class PublishedService;
class SubscribedService;
class WatchQueue;
}  // namespace gimi

/// Messages that were received and wait: a ring buffer for one (type, instance), or for one
/// subscription.
class Queue {
 public:
  /// Takes the oldest. Waits if there is none. Errors: timeout, closed.
  Outcome<Message> receive(Timeout timeout = kForever) const;
  /// Takes the oldest; nothing if there is none.
  [[nodiscard]] std::optional<Message> try_receive() const;
  /// Takes the newest and throws the others away, which counts as taking them and not as
  /// overwriting. Nothing if there is none.
  [[nodiscard]] std::optional<Message> take_newest() const;

  /// Changes the size while it runs; the oldest that no longer fit go and are
  /// counted. 1..kQueueMessagesMax; other numbers count as the nearest of these.
  void resize(std::size_t messages) const;
  [[nodiscard]] std::size_t size() const;           ///< messages that wait now
  [[nodiscard]] std::uint64_t received() const;     ///< all that ever came
  [[nodiscard]] std::uint64_t overwritten() const;  ///< went because it was full

 private:
  friend class Node;
  friend class Subscription;
  explicit Queue(std::shared_ptr<gimi::MessageQueue> queue) : queue_(std::move(queue)) {}
  std::shared_ptr<gimi::MessageQueue> queue_;
};

/// The fate of the messages of one stream.
struct SendCounts {
  std::uint64_t sent = 0;
  std::uint64_t acknowledged = 0;
  std::uint64_t lost = 0;  ///< known not to have arrived, or their connection or route ended before
                           ///< they were told of
  std::uint64_t skipped =
      0;  ///< not sent: AtFullWindow::skip, or replaced by a newer one under hold_latest
  std::size_t waiting = 0;  ///< sent and not acknowledged yet, and one that is held
  std::string loss;         ///< why the last one was lost, in words; "" if none was
  LossReason loss_reason = LossReason::none;  ///< the same for programs
};

/// A stream of messages with one key, to one node or to whoever accepts one service. Several
/// Senders of one (peer, key), or of one service, of a node are one stream: they share sequence,
/// window and counts; the options of the first hold. One to a service follows it: while nobody has
/// the service, send() answers not_found; when it is back, under whichever node and group, messages
/// go there. Messages not acknowledged at its former place count as lost.
class Sender {
 public:
  /// Sends 0 bytes to 1 GiB. Ok: it is on its way; of a synchronized stream, settle() and counts()
  /// tell what became of it. Waits while the window is full (AtFullWindow::wait) or the hub has
  /// paused the destination. Errors: timeout (nothing was sent), window_full, not_found (a service
  /// that nobody has), not_connected, refused, not_delivered (also of SendOptions::end_at_loss:
  /// nothing was sent), too_large, closed.
  Outcome<void> send(BytesView data, Timeout timeout = kForever, More more = More::no) const;
  /// Waits until nothing is unacknowledged. Ok: all that was sent so far was acknowledged.
  /// Errors: not_delivered (the sentence says how many were lost and why), timeout, closed.
  Outcome<void> settle(Timeout timeout = kForever) const;

  [[nodiscard]] SendCounts counts() const;
  /// The node; nobody (id 0) of a stream to a service.
  [[nodiscard]] Peer peer() const;
  /// The service by its full name; "" of a stream to a node. Valid until: the last Sender of the
  /// stream goes.
  [[nodiscard]] const std::string& service() const;

 private:
  friend class Node;
  explicit Sender(std::shared_ptr<gimi::SendStream> stream) : stream_(std::move(stream)) {}
  std::shared_ptr<gimi::SendStream> stream_;
};

/// The wait of Publisher::publish() if nobody says otherwise: a loop that steers something must
/// not stand still for as long as its hub is away, and what it would have said is old by then.
inline constexpr Timeout kPublishTimeout{1000};

/// An own service that provides data. Copies are the same service; with the last one it ends, which
/// asks the hub and waits for its answer, a second at most.
class Publisher {
 public:
  /// Sends 0 bytes to 1 GiB to all subscribers; slow ones are not waited for. Without subscribers
  /// nothing leaves the process, but of a retained service. Waits while the connection is broken,
  /// where that is resumed, while the own send queue is full, and while another thread publishes.
  /// Errors: timeout (not sent; subscribers may count it as missed), not_retained (sent, but too
  /// large to be kept), refused (the hub did not take the service again), not_connected, too_large,
  /// closed.
  Outcome<void> publish(BytesView data, Timeout timeout = kPublishTimeout,
                        More more = More::no) const;
  Outcome<void> publish(BytesView data, More more) const {
    return publish(data, kPublishTimeout, more);
  }
  /// Their number, as the hub told last.
  [[nodiscard]] std::size_t subscribers() const;
  /// Waits until there are that many. Errors: timeout, closed.
  Outcome<void> wait_for_subscribers(std::size_t count, Timeout timeout = kForever) const;
  [[nodiscard]] std::string name()
      const;  ///< in full, as it is now: another one after Node::take_name()
  [[nodiscard]] std::uint64_t published() const;  ///< messages that publish() sent
  /// Does the hub keep the last message for later subscribers? Ok until it says no, a moment after
  /// publish(). Errors: not_retained (why), closed.
  [[nodiscard]] Outcome<void> retained() const;
  /// Does the hub have the service, or will it be offered with the next connection? Errors: why it
  /// did not take it again after a break or another name, with its words (limit and others; it is
  /// asked again after the next break); closed.
  [[nodiscard]] Outcome<void> standing() const;

 private:
  friend class Node;
  explicit Publisher(std::shared_ptr<gimi::PublishedService> service)
      : service_(std::move(service)) {}
  std::shared_ptr<gimi::PublishedService> service_;
};

/// A subscription to somebody's service. It survives that the provider ends and comes back. Copies
/// are the same subscription; with the last one it ends, as a Publisher does.
class Subscription {
 public:
  /// As Queue::receive() and Queue::try_receive().
  Outcome<Message> receive(Timeout timeout = kForever) const;
  [[nodiscard]] std::optional<Message> try_receive() const;
  /// The queue of its messages. The subscription lasts as long as this queue is held.
  [[nodiscard]] Queue queue() const;
  /// Is there a provider at the moment?
  [[nodiscard]] bool exists() const;
  /// Is there one who takes data under that name instead? Nothing will come from it; send to it
  /// (sender_to_service()).
  [[nodiscard]] bool accepts() const;
  /// Waits until there is. Errors: timeout, closed.
  Outcome<void> wait_until_exists(Timeout timeout = kForever) const;
  [[nodiscard]] const std::string& name() const;  ///< in full
  /// Messages that this program does not get: those that did not come, by their sequence, and those
  /// that the queue overwrote. Of Delivery::latest they were skipped for newer ones.
  [[nodiscard]] std::uint64_t missed() const;
  /// As Publisher::standing(), of the subscription; with or without a provider.
  [[nodiscard]] Outcome<void> standing() const;

 private:
  friend class Node;
  explicit Subscription(std::shared_ptr<gimi::SubscribedService> service)
      : service_(std::move(service)) {}
  std::shared_ptr<gimi::SubscribedService> service_;
};

/// The present and the changes under a pattern of names. Events not taken wait at the hub, which
/// tells a watch that is too far behind all from the start again. Copies are the same watch;
/// with the last one it ends, as a Publisher does.
class Watch {
 public:
  /// Takes the next event. Waits if there is none. Errors: timeout, closed.
  Outcome<WatchEvent> receive(Timeout timeout = kForever) const;
  /// Takes the next event; nothing if there is none.
  [[nodiscard]] std::optional<WatchEvent> try_receive() const;

 private:
  friend class Node;
  explicit Watch(std::shared_ptr<gimi::WatchQueue> queue) : queue_(std::move(queue)) {}
  std::shared_ptr<gimi::WatchQueue> queue_;
};

/// A member of the network. Leaves for good when it is destroyed.
class Node {
 public:
  /// Joins; `name` and `hub` as in NodeOptions. Throws GimnetError.
  explicit Node(std::string_view name = {}, std::string_view hub = {});
  /// Joins. Errors: no_hub, no_host, timeout, bad_version, name_taken, bad_name, refused,
  /// bad_argument, protocol, system.
  static Outcome<Node> join(const NodeOptions& options);

  Node(Node&&) noexcept;
  Node& operator=(Node&&) noexcept;
  Node(const Node&) = delete;
  Node& operator=(const Node&) = delete;
  ~Node();

  /// Leaves: writes what still waits (at most a second), gives id and name back. All waiting calls
  /// answer closed.
  void close();

  [[nodiscard]] Peer peer() const;
  /// After close(): as it was then.
  [[nodiscard]] NodeState state() const;

  // ---- sending

  /// A stream to a node. Errors: bad_argument, limit.
  Outcome<Sender> sender(Peer to, const SendOptions& options = {}) const;
  /// To a name or an id as text (`7.17`). Errors: as find().
  Outcome<Sender> sender(std::string_view to, const SendOptions& options = {},
                         Timeout timeout = Timeout{5000}) const;
  /// To who accepts the service of that full name, with its key (SendOptions::key counts for
  /// nothing). Every node of the network may send there; the hub of the service routes it (kind
  /// SERVICE, docs/protocol.md, section 2). The node follows it as a subscriber; of services
  /// without a Sender it keeps the latest 1,024. Errors: not_found (no such service now, or one
  /// that gives data), bad_name, bad_argument, limit, timeout, not_connected.
  Outcome<Sender> sender_to_service(std::string_view full_name, const SendOptions& options = {},
                                    Timeout timeout = Timeout{5000}) const;
  /// Sends one message; sender() and Sender::send() in one.
  Outcome<void> send(Peer to, BytesView data, const SendOptions& options = {},
                     Timeout timeout = kForever) const;
  Outcome<void> send(std::string_view to, BytesView data, const SendOptions& options = {},
                     Timeout timeout = kForever) const;
  /// Writes what More::yes held back. Does not wait. Errors: not_connected, refused (no connection
  /// will come any more), closed.
  Outcome<void> flush() const;
  /// Waits until everything sent so far was given to the kernel and, where resume is on, confirmed
  /// by the hub.
  Outcome<void> drain(Timeout timeout = kForever) const;

  // ---- receiving

  /// The queue of a key, made or changed as told. Messages of keys for which nobody asked wait too,
  /// in queues of NodeOptions::queue_messages; of at most 1,024 keys, others are dropped and
  /// counted.
  Queue queue(MessageKey key, const QueueOptions& options = {}) const;
  /// Takes the next message of that key. Errors: timeout, closed.
  Outcome<Message> receive(MessageKey key, Timeout timeout = kForever) const;
  /// Takes the message that has waited longest, of any key or subscription. Errors: timeout,
  /// closed.
  Outcome<Message> receive(Timeout timeout = kForever) const;
  /// Messages dropped because of too many keys, or because they were no GIMI messages.
  [[nodiscard]] std::uint64_t dropped() const;
  /// Messages to this node, or of its subscriptions, that were lost on their way, as far as it
  /// knows, and who filled its queue at the hub if that was full. Subscription::missed() counts the
  /// messages that a service left out for this node.
  [[nodiscard]] LostCounts lost() const;

  // ---- services

  /// Provides the service `own name/name`; `name` has one part. Errors: bad_name, taken, denied (a
  /// node without a name), limit.
  Outcome<Publisher> advertise(std::string_view name, const PublishOptions& options = {},
                               Timeout timeout = Timeout{5000}) const;
  /// Lists the service `own name/name`, to which others send, until the node is closed. Errors: as
  /// advertise().
  Outcome<Queue> accept(std::string_view name, const AcceptOptions& options = {},
                        Timeout timeout = Timeout{5000}) const;
  /// Subscribes to a service by its full name; it need not exist yet. A second one of the same name
  /// is the same one; where the hub did not take that again after a break, it is asked once more.
  /// Errors: bad_name (also of a name without a /, which no service has, and of a pattern, which
  /// watch() takes), limit, denied, timeout, not_connected, not_found (it is there and accepts
  /// data: send to it).
  Outcome<Subscription> subscribe(std::string_view full_name, const QueueOptions& options = {},
                                  Timeout timeout = Timeout{5000},
                                  const PaceOptions& pace = {}) const;

  // ---- the own name

  /// Takes another name in place of the one this node has. Id and subscriptions stay; services end
  /// under their former full names and begin under the new ones. Errors: taken, bad_name, timeout,
  /// not_connected.
  Outcome<void> take_name(std::string_view name, Timeout timeout = Timeout{5000}) const;
  /// Goes on without a name, and without services until it takes one. Errors: not_found, timeout,
  /// not_connected.
  Outcome<void> give_name_back(Timeout timeout = Timeout{5000}) const;

  // ---- asking

  /// Watches the nodes and services that match the pattern as nodes() does: first what is there,
  /// then what changes. It goes on over reconnects. Errors: bad_name, bad_argument, limit, timeout,
  /// not_connected.
  Outcome<Watch> watch(std::string_view pattern = {}, const WatchOptions& options = {},
                       Timeout timeout = Timeout{5000}) const;

  /// A node by its name, or by its id as text. Errors: not_found, bad_name, timeout, not_connected.
  /// An id as text is not asked for; an answer for a name is remembered for a second.
  Outcome<Peer> find(std::string_view name, Timeout timeout = Timeout{5000}) const;
  /// The name of a node, "" of one without a name. Errors: not_found, timeout, not_connected.
  Outcome<std::string> name_of(Peer peer, Timeout timeout = Timeout{5000}) const;
  /// Nodes whose name matches (`*` one part, `**` any number; "": all, those without a name too),
  /// ascending ids. Errors of this and the others that list: bad_name (no pattern), timeout,
  /// not_connected, protocol.
  Outcome<std::vector<NodeRecord>> nodes(std::string_view pattern = {},
                                         Timeout timeout = Timeout{5000}) const;
  /// Services whose full name matches, ascending group ids.
  Outcome<std::vector<ServiceRecord>> services(std::string_view pattern = {},
                                               Timeout timeout = Timeout{5000}) const;
  /// The hub itself, the counters of its io threads, its connections (ascending ids), the hubs that
  /// it knows (ascending ids), and its links to others (docs/operations.md). `hub_id` names another
  /// hub of the network; 0 is the own hub. Errors also: not_found (there is no way to that hub).
  Outcome<HubRecord> hub(Timeout timeout = Timeout{5000}, std::uint32_t hub_id = 0) const;
  Outcome<std::vector<ShardCounts>> hub_counters(Timeout timeout = Timeout{5000},
                                                 std::uint32_t hub_id = 0) const;
  Outcome<std::vector<ConnectionRecord>> hub_connections(Timeout timeout = Timeout{5000},
                                                         std::uint32_t hub_id = 0) const;
  Outcome<std::vector<NetworkHub>> hubs(Timeout timeout = Timeout{5000},
                                        std::uint32_t hub_id = 0) const;
  Outcome<std::vector<LinkRecord>> hub_links(Timeout timeout = Timeout{5000},
                                             std::uint32_t hub_id = 0) const;

  // ---- changing the hub, for those who joined as administrators; everybody else is denied

  /// Ends the session of a node, which is told `reason` (at most 256 bytes) and does not come back
  /// by itself; its token counts for nothing from then on. Answers with what the hub cannot promise
  /// (its disk is full, and it would forget that at a restart), as a rule nothing. Errors:
  /// not_found, denied, bad_argument (this node itself, a longer reason).
  Outcome<std::string> kick(Peer node, std::string_view reason = {},
                            Timeout timeout = Timeout{5000}) const;
  /// The node goes on under another id of its hub. Errors: not_found, taken, denied, bad_argument,
  /// limit (the hub cannot keep that over a restart: its disk is full).
  Outcome<void> reassign(Peer node, Peer new_id, Timeout timeout = Timeout{5000}) const;
  /// The hub writes what waits, says goodbye to everybody, and ends.
  Outcome<void> drain_hub(Timeout timeout = Timeout{5000}) const;
  /// The hub reads its configuration again. Errors: bad_argument (it is wrong, and nothing was
  /// changed), denied.
  Outcome<std::vector<HubChange>> reload_hub(Timeout timeout = Timeout{5000}) const;
  /// The hub dials one link more, until it ends; an empty name is the URL, cost 0 is measured.
  /// Errors: bad_argument (no URL, a name that is there, another machine without `insecure`).
  Outcome<void> add_link(std::string_view url, std::string_view name = {}, std::uint16_t cost = 0,
                         Timeout timeout = Timeout{5000}) const;
  /// Ends a link that the hub dials. Errors: not_found.
  Outcome<void> remove_link(std::string_view name, Timeout timeout = Timeout{5000}) const;
  /// Fixes the cost of a link that the hub dials; 0: measured. Errors: not_found.
  Outcome<void> set_link_cost(std::string_view name, std::uint16_t cost,
                              Timeout timeout = Timeout{5000}) const;
  /// error, warning, info, debug or off. The level before. Errors: bad_argument, denied.
  Outcome<std::string> set_hub_log_level(std::string_view level,
                                         Timeout timeout = Timeout{5000}) const;

  /// Sends a small message to the library of another node, which answers by itself with `echo` in
  /// it. The round trip in ns, in that lane there and back. Errors: timeout (lost, or late),
  /// not_delivered (no such node, no way to it), closed.
  Outcome<std::int64_t> ping(Peer to, Timeout timeout = Timeout{1000}, Lane lane = Lane::normal,
                             BytesView echo = {}) const;
  /// As ping(), with the way that the answer came.
  Outcome<TracedPing> trace(Peer to, Timeout timeout = Timeout{1000},
                            Lane lane = Lane::normal) const;

 private:
  explicit Node(std::shared_ptr<gimi::Core> core) : core_(std::move(core)) {}
  [[nodiscard]] gimi::Core& core() const;
  std::shared_ptr<gimi::Core> core_;
};

}  // namespace gimnet
