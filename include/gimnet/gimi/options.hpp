#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "gimnet/gimi/message.hpp"
#include "gimnet/gimi/namespace.hpp"
#include "gimnet/gimi/outcome.hpp"
#include "gimnet/gimi/records.hpp"

namespace gimnet::inline GIMNET_GIMI_NAMESPACE {

/// Most messages of one (destination, key) that may wait for their ACK: what one ACK can speak of.
inline constexpr std::size_t kWindowMax = 64;
/// Most payload bytes of them. A message that would be more, of any size, goes when no other waits
/// for its ACK: where the sender does not wait (AtFullWindow) or several threads send, small ones
/// can keep it from going. The receiver's library holds NodeOptions::receive_bytes for a program
/// that stands still: 16 such windows by default. More messages wait in its hub, which does not
/// hold them for ever.
inline constexpr std::size_t kWindowBytesMax = std::size_t{1} << 20;
/// Messages that a queue keeps if nobody says otherwise.
inline constexpr std::size_t kQueueMessagesDefault = 64;
/// Most messages that a queue can be told to keep.
inline constexpr std::size_t kQueueMessagesMax = std::size_t{1} << 24;

// Every member has an initialiser, so that `{.window = 1}` names what is meant and no compiler
// misses the others.

/// The options of joining. Everything has a default that works on one machine.
struct NodeOptions {
  /// At most 255 bytes: up to 16 parts of A-Z a-z 0-9 . _ -, separated by `/`. "": a node without a
  /// name, found by its id only.
  std::string name{};
  /// `tcp://host:port` or `unix:/path`, or several of one network with commas. "": those of
  /// GIMNET_HUB, else the hub of this machine.
  std::string hub{};
  std::string description{};  ///< for people, at most 256 bytes
  Timeout timeout{5000};      ///< for joining, in ms
  bool wait_for_hub = false;  ///< dial again until `timeout` if there is no hub yet
  /// Dial again after a break, after a random time below 50 ms, 100 ms ... 1 s. false: a break is
  /// the end, but with `resume` = true only if the hub cannot resume the session.
  bool reconnect = true;
  /// After a break nothing is lost and nothing comes twice, for a copy of what is unconfirmed.
  /// Default: nodes with a name.
  std::optional<bool> resume{};
  /// A node with a name that crashed has its id and name again at once: its session token stands in
  /// a file of the user's runtime folder while it lives. false: in memory only.
  bool keep_token = true;
  /// Shard of the hub wished for, 0..254; honoured by a hub started with `--placement hint`.
  std::optional<std::uint8_t> shard{};
  /// If the name is taken, join as NAME-2, NAME-3 ... NAME-99.
  bool number_if_taken = false;
  /// Join as one who may change the hub: over its Unix socket, as root or as the user that runs it.
  /// Else: denied.
  bool administrator = false;
  /// Largest message taken, in bytes of the application, up to 1 GiB. A larger one is dropped. Its
  /// sender is told if it waits for an ACK, or still sends: too_large.
  std::size_t message_bytes_max = std::size_t{64} << 20;
  std::size_t receive_bytes = std::size_t{16}
                              << 20;  ///< may wait unread when a queue holds the reading back
  std::size_t queue_messages =
      kQueueMessagesDefault;  ///< size of queues that nobody asked for, 1..kQueueMessagesMax
  std::uint32_t socket_receive_bytes = 0;  ///< SO_RCVBUF, in bytes; 0: the system's
  /// Bytes of the largest last message of an own service with `retain` that is kept for a hub that
  /// was started again: as much as hubs keep themselves unless they are told otherwise
  /// (`retained_message_bytes`). 1..64 MiB, which all services have together.
  /// NodeState::last_messages_not_kept counts what was not.
  std::uint32_t last_message_bytes = std::uint32_t{16} << 20;
  /// `http://host:port` or `http://user:password@host:port`: the HTTP proxy to reach `hub` through.
  /// "": the environment's GIMNET_PROXY, if it is set, for a hub that is named by tcp://.
  std::string proxy{};
};

/// The behaviour of a full queue when a message comes.
enum class AtFullQueue : std::int32_t {
  overwrite_oldest,  ///< a ring buffer: the oldest goes and is counted; of size 1 it holds the
                     ///< newest
  /// Nothing goes: the node stops reading from the hub, for all its queues, until there is room.
  /// Keep-alive goes on.
  stop_reading,
};

struct QueueOptions {
  std::size_t messages = 0;  ///< 1..kQueueMessagesMax; 0: kQueueMessagesDefault
  AtFullQueue at_full = AtFullQueue::overwrite_oldest;
};

/// The behaviour of a sender when as much as its window allows is not acknowledged.
enum class AtFullWindow : std::int32_t {
  wait,         ///< until there is room, at most the time given to send()
  skip,         ///< send nothing and answer Status::window_full
  hold_latest,  ///< keep this one, in place of one that is kept already, and send it when there is
                ///< room
};

/// The wishes of a subscriber. Every wish works with every delivery. The program takes a
/// message when it fetches it from the queue, or when the queue overwrites it.
struct SubscribeOptions {
  double rate_hz = 0.0;  ///< messages a second at most, the newest at each due time, 0.001..1,000;
                         ///< 0: no bound
  /// Only the newest message waits, in the queue and at the hub; `queue` is 0 or 1.
  bool newest_only = false;
  /// Messages that may wait, 1..kQueueMessagesMax. 0: kQueueMessagesDefault, and with
  /// AtFullQueue::overwrite_oldest more as long as they take 16 MiB at most (docs/gimi.md,
  /// "Services"). But 0 is 1 message with newest_only, with rate_hz and of a service with
  /// Delivery::latest. A newer message overwrites that one, whatever `at_full` says.
  std::size_t queue = 0;
  AtFullQueue at_full = AtFullQueue::overwrite_oldest;
  Timeout timeout{5000};  ///< for the hub's answer
  /// Not 0: while nothing comes, receive() answers Status::silence once in that time.
  Timeout silence{0};
  /// For experts: untaken messages, 1..1,024. 0: 2 with newest_only, else any number, and of
  /// Delivery::sync as many as the service allows, which is the most.
  std::uint32_t window = 0;
  /// For experts: newest messages that the hub holds at a full window, 1..64; 0: 1.
  std::uint32_t depth = 0;
};

struct SendOptions {
  MessageKey key{};
  Lane lane = Lane::normal;
  /// 1..kWindowMax: synchronized, at most that many, and kWindowBytesMax of them, are not
  /// acknowledged; data do not pile up on the way, and each receiver sets its own pace. 0:
  /// unsynchronized, as fast as the network takes it; nothing is acknowledged.
  std::size_t window = 0;
  AtFullWindow at_full = AtFullWindow::wait;
  bool timestamp = false;  ///< tell the receiver when it was sent: 8 bytes more
  std::uint32_t age_ms_max =
      0;  ///< not 0: dropped on the way when older, by the clocks of the hubs
  /// Of a synchronized stream: once a message was lost, send() sends nothing more and answers
  /// not_delivered, for streams in which what comes later is worth nothing without what came
  /// before.
  bool end_at_loss = false;
  /// To a service that is away, since its program lost its connection or has not accepted it again:
  /// send() waits until it is there, within the time given. False: send() answers not_found at
  /// once. Each Sender has its own.
  bool wait_if_away = false;
  friend bool operator==(const SendOptions&, const SendOptions&) = default;
};

struct PublishOptions {
  Delivery delivery = Delivery::stream;
  MessageKey key{};
  Lane lane = Lane::normal;
  bool timestamp = true;
  std::string metadata{};  ///< for people and tools, at most 4,096 bytes of UTF-8
  std::uint32_t window =
      1;  ///< of Delivery::sync: messages not taken by a subscriber, 1..1,024 (a hub's limit)
  /// The hub keeps the last message, up to 16 MiB, and gives it to each new subscriber first. See
  /// Publisher::retained().
  bool retain = false;
  std::uint32_t age_ms_max = 0;  ///< as in SendOptions
};

/// A service that takes data, such as commands.
struct AcceptOptions {
  MessageKey key{};        ///< of the messages that it takes
  QueueOptions queue{};    ///< in which they wait
  std::string metadata{};  ///< for people and tools, at most 4,096 bytes of UTF-8
};

/// The subjects of a watch.
struct WatchOptions {
  bool nodes = true;
  bool services = true;
};

/// Whether more messages follow at once: those marked so are written together with the next one
/// that is not. A program that stops there calls Node::flush().
enum class More : std::uint8_t { no, yes };

}  // namespace gimnet::inline GIMNET_GIMI_NAMESPACE
