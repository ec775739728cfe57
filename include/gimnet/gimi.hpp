#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "gimnet/gimi.h"
#include "gimnet/gimi/answers.hpp"
#include "gimnet/gimi/conversions.hpp"
#include "gimnet/gimi/handles.hpp"
#include "gimnet/gimi/hub_access.hpp"
#include "gimnet/gimi/message.hpp"
#include "gimnet/gimi/namespace.hpp"
#include "gimnet/gimi/node_state.hpp"
#include "gimnet/gimi/options.hpp"
#include "gimnet/gimi/outcome.hpp"
#include "gimnet/gimi/records.hpp"
#include "gimnet/gimi/wait_set.hpp"
#include "gimnet/gimi/watches.hpp"

// GIMI: how programs use GIMnet, in C++20 over the C functions of gimnet/gimi.h. Only the standard
// library is needed, and neither exceptions nor RTTI. docs/gimi.md explains it with
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
// Node::close(), and the last Publisher, Subscription or Watch. Callbacks: the library calls none.
// Received messages wait in queues, which the program empties when it has time; an Executor
// (gimnet/gimi/executor.hpp) calls back in the thread that runs it. Texts: a NUL in one becomes
// U+FFFD, which no name may have.

namespace gimnet::inline GIMNET_GIMI_NAMESPACE {

/// A member of the network. Leaves for good when it is destroyed.
class Node : public HubAccess<void> {
 public:
#if defined(__cpp_exceptions)
  /// Joins; `name` and `hub` as in NodeOptions. Throws GimnetError.
  explicit Node(std::string_view name = {}, std::string_view hub = {})
      : Node(join({.name = std::string(name), .hub = std::string(hub)}).or_throw()) {}
#endif
  /// Joins. Errors: no_hub, no_host, timeout, bad_version, name_taken, bad_name, refused,
  /// bad_argument, protocol, system.
  static Outcome<Node> join(const NodeOptions& options) {
    if (options.shard == UINT8_MAX)
      return Failure{Status::bad_argument, "cannot join: shard is 255, not 0 to 254"};
    NodeOptions given = options;
    for (std::string* text : {&given.name, &given.hub, &given.description, &given.proxy})
      *text = detail::c_text(*text);
    const gimi_node_options how = detail::options_of(given);
    gimi_handle handle = 0;
    const gimi_status status = gimi_join(&how, &handle);
    if (status != GIMI_OK) return failure_of(status);
    return Node(handle);
  }

  Node(Node&& other) noexcept : HubAccess(std::exchange(other.handle_, 0)) {}
  Node& operator=(Node&& other) noexcept {
    const Node old(std::move(*this));
    handle_ = std::exchange(other.handle_, 0);
    return *this;
  }
  Node(const Node&) = delete;
  Node& operator=(const Node&) = delete;
  ~Node() {
    if (handle_ != 0) static_cast<void>(gimi_close(handle_));
  }

  /// Leaves: writes what still waits (at most a second), gives id and name back. All waiting calls
  /// answer closed.
  void close() { static_cast<void>(gimi_leave(handle_)); }

  /// For the C functions, and for a WaitSet, which then waits for what receive() takes.
  [[nodiscard]] gimi_handle c_handle() const { return handle_; }
  [[nodiscard]] Peer peer() const { return Peer{gimi_id(handle_)}; }
  /// After close(): as it was then.
  [[nodiscard]] NodeState state() const {
    gimi_node_state state{};
    state.struct_size = sizeof state;
    static_cast<void>(gimi_state(handle_, &state));
    return detail::state_of(state);
  }

  /// Tells what becomes of the connection: lost, back, ended, and why. Errors: closed.
  Outcome<ConnectionWatch> watch_connection() const {
    gimi_handle handle = 0;
    const gimi_status status = gimi_watch_connection(handle_, &handle);
    return detail::made<ConnectionWatch>(status, handle);
  }

  // ---- sending

  /// A stream to a node, which find() finds. Errors: bad_argument (also other options than an
  /// earlier Sender of this node to that peer with that key), limit.
  Outcome<Sender> sender(Peer to, const SendOptions& options = {}) const {
    const gimi_send_options how = detail::options_of(options);
    gimi_handle handle = 0;
    const gimi_status status = gimi_sender(handle_, to.id, &how, &handle);
    return detail::made<Sender>(status, handle);
  }
  /// To who accepts the service of that full name, with its key (SendOptions::key counts for
  /// nothing). Every node of the network may send there; the hub of the service routes it (kind
  /// SERVICE, docs/protocol.md, section 2). The node follows it as a subscriber; of services
  /// without a Sender it keeps the latest 1,024. Errors: not_found (no such service now, or one
  /// that gives data), bad_name, bad_argument (as above), limit, timeout, not_connected.
  Outcome<Sender> sender(std::string_view service, const SendOptions& options = {},
                         Timeout timeout = Timeout{5000}) const {
    const gimi_send_options how = detail::options_of(options);
    gimi_handle handle = 0;
    const gimi_status status = gimi_sender_to_service(handle_, detail::c_text(service).c_str(),
                                                      &how, milliseconds_of(timeout), &handle);
    return detail::made<Sender>(status, handle);
  }
  /// Sends one message; sender() and Sender::send() in one.
  Outcome<void> send(Peer to, BytesView data, const SendOptions& options = {},
                     Timeout timeout = kForever) const {
    const gimi_send_options how = detail::options_of(options);
    const gimi_bytes bytes{data.data(), data.size()};
    return detail::outcome_of(gimi_send_to(handle_, to.id, &bytes, &how, milliseconds_of(timeout)));
  }
  /// The hub is asked for a service to which this node did not send before.
  Outcome<void> send(std::string_view service, BytesView data, const SendOptions& options = {},
                     Timeout timeout = kForever) const {
    const auto there = sender(service, options, timeout);
    if (!there) return there.failure();
    return there->send(data, timeout);
  }
  /// Writes what More::yes held back. Does not wait. Errors: not_connected, refused (no connection
  /// will come any more), closed.
  Outcome<void> flush() const { return detail::outcome_of(gimi_flush(handle_)); }
  /// Waits until everything sent so far was given to the kernel and, where resume is on, confirmed
  /// by the hub.
  Outcome<void> drain(Timeout timeout = kForever) const {
    return detail::outcome_of(gimi_drain(handle_, milliseconds_of(timeout)));
  }

  // ---- receiving

  /// The queue of a key, made or changed as told. Messages of keys for which nobody asked wait too,
  /// in queues of NodeOptions::queue_messages; of at most 1,024 keys, others are dropped and
  /// counted.
  Queue queue(MessageKey key, const QueueOptions& options = {}) const {
    const gimi_queue_options how = detail::options_of(options);
    gimi_handle handle = 0;
    const gimi_status status = gimi_queue(handle_, detail::key_of(key), &how, &handle);
    auto queue = detail::made<Queue>(status, handle);
    return queue ? std::move(*queue) : Queue(queue.failure());
  }
  /// Takes the next message of that key. Errors: timeout, closed.
  Outcome<Message> receive(MessageKey key, Timeout timeout = kForever) const {
    gimi_handle handle = 0;
    const gimi_status status = gimi_queue(handle_, detail::key_of(key), nullptr, &handle);
    const auto queue = detail::made<Queue>(status, handle);
    if (!queue) return queue.failure();
    return queue->receive(timeout);
  }
  /// Takes the message that has waited longest, of any key or subscription. Errors: timeout,
  /// closed.
  Outcome<Message> receive(Timeout timeout = kForever) const {
    return detail::receive(handle_, timeout);
  }
  /// Messages dropped because of too many keys, or because they were no GIMI messages.
  [[nodiscard]] std::uint64_t dropped() const { return detail::lost_counts(handle_).dropped; }
  /// Messages to this node, or of its subscriptions, that were lost on their way, as far as it
  /// knows, and who filled its queue at the hub if that was full. Subscription::missed() counts the
  /// messages that a service left out for this node.
  [[nodiscard]] LostCounts lost() const {
    const gimi_lost_counts counts = detail::lost_counts(handle_);
    return {
        counts.incomplete, counts.too_large, counts.frames_broken_off, counts.unknown_service,
        counts.unreadable, counts.outdated,  counts.queue_full,        Peer{counts.queue_filled_by},
        counts.over_budget};
  }

  // ---- services

  /// Provides the service `own name/name`; `name` has one part. Errors: bad_name, taken, denied (a
  /// node without a name), limit.
  Outcome<Publisher> advertise(std::string_view name, const PublishOptions& options = {},
                               Timeout timeout = Timeout{5000}) const {
    const std::string metadata = detail::c_text(options.metadata);
    gimi_publish_options how = detail::options_of(options, timeout);
    how.metadata = metadata.c_str();
    gimi_handle handle = 0;
    const gimi_status status = gimi_advertise(handle_, detail::c_text(name).c_str(), &how, &handle);
    return detail::made<Publisher>(status, handle);
  }
  /// Lists the service `own name/name`, to which others send, and gives the queue of what they
  /// send. It ends with the last copy of that. Errors: as advertise().
  Outcome<Accepted> accept(std::string_view name, const AcceptOptions& options = {},
                           Timeout timeout = Timeout{5000}) const {
    const std::string metadata = detail::c_text(options.metadata);
    gimi_accept_options how = detail::options_of(options, timeout);
    how.metadata = metadata.c_str();
    gimi_handle handle = 0;
    const gimi_status status = gimi_accept(handle_, detail::c_text(name).c_str(), &how, &handle);
    return detail::made<Accepted>(status, handle);
  }
  /// Subscribes to a service by its full name; it need not exist yet. Each call makes a queue of
  /// its own. Of several for one name the hub sends what the one wants that wants most, and a
  /// message counts as taken when it is in all their queues. Errors: bad_name (also of a name
  /// without a /, which no service has, and of a pattern, which watch() takes), bad_argument,
  /// limit, denied, timeout, not_connected, not_found (it is there and accepts data: send to it).
  Outcome<Subscription> subscribe(std::string_view full_name,
                                  const SubscribeOptions& options = {}) const {
    const gimi_subscribe_options how = detail::options_of(options);
    gimi_handle handle = 0;
    const gimi_status status =
        gimi_subscribe(handle_, detail::c_text(full_name).c_str(), &how, &handle);
    return detail::made<Subscription>(status, handle);
  }

  // ---- requests

  /// Asks whoever answers that service, and waits for the end of the request, of which there is
  /// exactly one. gimnet/gimi_requests.h tells which there are, and whether the work was done.
  [[nodiscard]] Reply request(std::string_view service, BytesView data = {},
                              Timeout timeout = Timeout{5000},
                              const RequestOptions& options = {}) const {
    const gimi_request_options how = detail::options_of(options, timeout);
    const gimi_bytes bytes{data.data(), data.size()};
    gimi_reply ended{};
    const gimi_status status =
        gimi_ask(handle_, detail::c_text(service).c_str(), &bytes, &how, &ended);
    return Reply(status, ended);
  }
  /// The same without waiting for the end. Errors: as a request that was not sent.
  Outcome<PendingReply> request_later(std::string_view service, BytesView data = {},
                                      Timeout timeout = Timeout{5000},
                                      const RequestOptions& options = {}) const {
    const gimi_request_options how = detail::options_of(options, timeout);
    const gimi_bytes bytes{data.data(), data.size()};
    gimi_handle handle = 0;
    const gimi_status status =
        gimi_ask_later(handle_, detail::c_text(service).c_str(), &bytes, &how, &handle);
    return detail::made<PendingReply>(status, handle);
  }
  /// Lists the service `own name/name`, which answers requests. Errors: as advertise().
  Outcome<Answers> answer(std::string_view name, Timeout timeout = Timeout{5000}) const {
    gimi_answer_options how{};
    how.struct_size = sizeof how;
    how.timeout_ms = milliseconds_in_options(timeout);
    gimi_handle handle = 0;
    const gimi_status status = gimi_answer(handle_, detail::c_text(name).c_str(), &how, &handle);
    return detail::made<Answers>(status, handle);
  }

  // ---- the own name

  /// Takes another name in place of the one this node has. Id and subscriptions stay; services end
  /// under their former full names and begin under the new ones. Errors: taken, bad_name, timeout,
  /// not_connected.
  Outcome<void> take_name(std::string_view name, Timeout timeout = Timeout{5000}) const {
    return detail::outcome_of(
        gimi_take_name(handle_, detail::c_text(name).c_str(), milliseconds_of(timeout)));
  }
  /// Goes on without a name, and without services until it takes one. Errors: not_found, timeout,
  /// not_connected.
  Outcome<void> give_name_back(Timeout timeout = Timeout{5000}) const {
    return detail::outcome_of(gimi_give_name_back(handle_, milliseconds_of(timeout)));
  }

  // ---- asking

  /// Watches the nodes and services that match the pattern as nodes() does: first what is there,
  /// then what changes. It goes on over reconnects. Errors: bad_name, bad_argument, limit, timeout,
  /// not_connected.
  Outcome<Watch> watch(std::string_view pattern = {}, const WatchOptions& options = {},
                       Timeout timeout = Timeout{5000}) const {
    const std::uint32_t nothing = 1u << 31;  // no subject, which is refused
    std::uint32_t subjects = options.nodes ? GIMI_WATCH_NODES : 0;
    if (options.services) subjects |= GIMI_WATCH_SERVICES;
    gimi_handle handle = 0;
    const gimi_status status =
        gimi_watch(handle_, detail::c_text(pattern).c_str(), subjects != 0 ? subjects : nothing,
                   milliseconds_of(timeout), &handle);
    return detail::made<Watch>(status, handle);
  }

  /// A node by its name, or by its id as text. Errors: not_found, bad_name, timeout, not_connected.
  /// An id as text is not asked for; an answer for a name is remembered for a second.
  Outcome<Peer> find(std::string_view name, Timeout timeout = Timeout{5000}) const {
    Peer peer;
    const gimi_status status =
        gimi_find(handle_, detail::c_text(name).c_str(), milliseconds_of(timeout), &peer.id);
    if (status != GIMI_OK) return failure_of(status);
    return peer;
  }
  /// The name of a node, "" of one without a name. Errors: not_found, timeout, not_connected.
  Outcome<std::string> name_of(Peer peer, Timeout timeout = Timeout{5000}) const {
    detail::Words words;
    const gimi_status status =
        gimi_name_of(handle_, peer.id, milliseconds_of(timeout), words.text, sizeof words.text);
    return detail::text(status, words);
  }
  /// Sends a small message to the library of another node, which answers by itself with `echo` in
  /// it. The round trip in ns, in that lane there and back. Errors: timeout (lost, or late),
  /// not_delivered (no such node, no way to it), denied (a link between hubs may not carry it),
  /// closed.
  Outcome<std::int64_t> ping(Peer to, Timeout timeout = Timeout{1000}, Lane lane = Lane::normal,
                             BytesView echo = {}) const {
    std::int64_t round_trip_ns = 0;
    const gimi_bytes bytes{echo.data(), echo.size()};
    const gimi_status status = gimi_ping(handle_, to.id, lane_number(lane), &bytes,
                                         milliseconds_of(timeout), &round_trip_ns);
    if (status != GIMI_OK) return failure_of(status);
    return round_trip_ns;
  }

 private:
  explicit Node(gimi_handle handle) : HubAccess(handle) {}
};

}  // namespace gimnet::inline GIMNET_GIMI_NAMESPACE
