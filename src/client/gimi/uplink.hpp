#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "base/ids.hpp"
#include "client/gimi/message_queue.hpp"
#include "client/nif/hub_clock.hpp"
#include "client/nif/platform.hpp"
#include "gimnet/gimi/message.hpp"
#include "gimnet/gimi/outcome.hpp"
#include "gimnet/nif.h"
#include "net/wait.hpp"
#include "proto/gimi/message_header.hpp"

namespace gimnet::nif {
class Node;
}  // namespace gimnet::nif

namespace gimnet::gimi {

/// The fate of a message that was not sent within the time of its call.
enum class AtTimeout : std::uint8_t { give_up, try_again };

[[nodiscard]] Status status_of(nif_status status);
/// The last answer of NIF in this thread, as a Failure; `doing` as in "send to 7.17".
[[nodiscard]] Failure failure_of(nif_status status, std::string_view doing);

/// Does the id stand for all nodes of a hub, or of the network?
[[nodiscard]] inline bool is_every_node(Peer peer) {
  return index_of(NodeId{peer.id}) == kEveryIndex;
}

/// The destination of a message, and the terms it goes on.
struct Envelope {
  std::uint32_t to = 0;
  nif_kind kind = NIF_UNICAST;
  nif_policy policy = NIF_POLICY_DEFAULT;
  Lane lane = Lane::normal;
  MessageKey key;
  std::uint32_t age_ms_max = 0;
  unsigned flags = 0;  ///< NIF_FLAG_*; KEYED is added
  std::uint8_t trace_slots = 0;
  std::uint32_t left_ms = 0;  ///< of a request: goes before its data
};

/// Hubs of a way that a traced message tells of; as many as NIF allows.
inline constexpr std::uint8_t kTraceHopsMax = 8;

/// The process in which a part of a node was made. A child after fork() has a copy of it, whose
/// locks and threads are its parent's. Thread safety: any thread.
class Home {
 public:
  [[nodiscard]] bool left() const { return generation_ != nif::fork_generation(); }

 private:
  const std::uint32_t generation_ = nif::fork_generation();
};

/// The way to NIF: GIMI messages in, frames out. What happens for each message goes to NIF's node
/// itself, everything else by its handle. Thread safety: any thread. Both stay usable when the
/// handle was closed; NIF then answers NIF_CLOSED.
class Uplink {
 public:
  Uplink() = default;
  ~Uplink();
  Uplink(const Uplink&) = delete;
  Uplink& operator=(const Uplink&) = delete;

  void open(nif_node* node);
  [[nodiscard]] const Home& home() const { return home_; }
  /// Null: not connected for the first time yet.
  [[nodiscard]] nif_node* node() const { return node_.load(); }

  /// As nif_send(); `stamped`: with the time of this call.
  [[nodiscard]] nif_status transmit(const Envelope& envelope, proto::gimi::MessageHeader header,
                                    bool stamped, BytesView data, std::int32_t timeout_ms) const;

  /// The rest of the message with that header does not go any more: its receiver does not take it.
  void give_up(const proto::gimi::MessageHeader& header) const;

  /// As nif_credit() and nif_deliver().
  void credit(const TakenMessages& taken, bool more) const;
  void deliver() const;
  /// As NodeThread::set_task() and NodeThread::rouse().
  void set_task(std::function<net::Deadline()> task) const;
  void rouse() const;
  /// As Declarations::is_away().
  [[nodiscard]] bool is_away(const std::string& full_name) const;
  /// As CreditBook::tell_missed().
  [[nodiscard]] bool tell_missed(std::uint32_t group, std::uint64_t total) const;

  /// As HubClock::own_time().
  [[nodiscard]] std::optional<nif::HubClock::OwnTime> own_time(std::int64_t hub_ns) const;

  /// The node's name, or its id, for people.
  [[nodiscard]] std::string node_name() const;
  /// A message was not sent, and the status says why: counted if the hub was away, apart from a
  /// timeout after which the program may try again.
  void note_unsent(nif_status why, AtTimeout at_timeout) const;
  /// Messages that were not sent while the hub was away, since this was asked last.
  [[nodiscard]] std::uint64_t take_unsent() const;

  /// nif_last_error(), whole.
  [[nodiscard]] std::string trouble() const;

  /// A number for a PING; never 0.
  [[nodiscard]] std::uint32_t next_ping();
  /// For a stream that begins: 32 random bits (docs/protocol.md, section 7).
  [[nodiscard]] static std::uint32_t draw_epoch();

 private:
  const Home home_;
  std::atomic<nif_node*> node_{nullptr};
  std::atomic<nif::Node*> direct_{nullptr};
  std::atomic<std::uint32_t> pings_{0};
  mutable std::atomic<std::uint64_t> unsent_{0};  ///< numbers by themselves: relaxed
};

}  // namespace gimnet::gimi
