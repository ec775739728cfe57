#pragma once

#include <cstddef>
#include <cstdint>
#include <exception>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/mutex.hpp"
#include "client/nif/connection_state.hpp"
#include "client/nif/error.hpp"
#include "client/nif/frame_appender.hpp"
#include "client/nif/group_moves.hpp"
#include "client/nif/last_messages.hpp"
#include "client/nif/message_sender.hpp"
#include "client/nif/messages_under_way.hpp"
#include "client/nif/outgoing.hpp"
#include "client/nif/pause_table.hpp"
#include "client/nif/reported_messages.hpp"
#include "client/nif/send_gate.hpp"
#include "client/nif/send_queue.hpp"
#include "client/nif/session_terms.hpp"
#include "client/nif/socket_writer.hpp"
#include "gimnet/nif.h"
#include "net/wait.hpp"
#include "proto/frame/flow.hpp"
#include "proto/frame/frame_header.hpp"
#include "proto/frame/taken.hpp"
#include "proto/frame/window.hpp"

namespace gimnet::nif {

/// The sending half of a node: any thread puts messages in, whoever finds the socket idle writes
/// what is there (SocketWriter).
///
/// Where memory runs out inside, the call throws std::bad_alloc, and the connection ends: the
/// library's thread begins anew with an empty queue.
///
/// Thread safety: send, flush, drain, post and the counters from any thread; the rest from the
/// library's thread.
class Outbound final : private SocketWriter::Source {
 public:
  /// `wake` rouses the library's thread, which then calls write_pending().
  Outbound(const SendQueue::Limits& limits, net::WakeSignal& wake,
           std::size_t last_message_bytes = LastMessages::kMessageBytesDefault)
      : queue_(limits),
        frames_(queue_),
        writer_({queue_, frames_.appended(), *this, connection_, waiters_, wake}),
        gate_(pauses_, moves_, queue_),
        under_way_(limits.queue_bytes),
        last_(last_message_bytes),
        sender_({connection_, queue_, gate_, frames_, under_way_, writer_, waiters_, last_}) {}

  // Any thread.
  [[nodiscard]] nif_status send(Outgoing& message, Deadline deadline) GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] nif_status flush() GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] nif_status drain(Deadline deadline) GIMNET_EXCLUDES(mutex_);
  /// A frame of the connection itself (FLOW, LINK, NS, CTRL), before all messages. The source is
  /// filled in here, where it cannot change on the way. False: not connected.
  bool post(std::span<const std::byte> frame) GIMNET_EXCLUDES(mutex_);
  bool post(const proto::flow::Message& message) GIMNET_EXCLUDES(mutex_);
  /// A frame of a data kind that the library sends by itself; it does not wait for room. False: the
  /// hub paused its way, not connected.
  bool post_data(std::span<const std::byte> frame) GIMNET_EXCLUDES(mutex_);
  /// The own service of that name is retained and has this group now (0: none): its last message is
  /// kept, see LastMessages.
  void follow_retained(const std::string& service, std::uint32_t group) GIMNET_EXCLUDES(mutex_);
  void forget_retained(const std::string& service) GIMNET_EXCLUDES(mutex_);
  /// The receiver of the message that was sent with that tag does not take it, since it is too
  /// large: its rest does not go any more.
  void give_up(std::uint64_t tag) GIMNET_EXCLUDES(mutex_);
  /// Waits until connected. NIF_OK, or why it will not be.
  [[nodiscard]] nif_status wait_connected(Deadline deadline) GIMNET_EXCLUDES(mutex_);
  void add_counters(nif_counters& counters) GIMNET_EXCLUDES(mutex_);
  /// Threads that wait in one of these calls at this moment.
  [[nodiscard]] std::uint32_t waiting() GIMNET_EXCLUDES(mutex_);

  // The library's thread.
  /// The connection stands. Returns the count that SKIP has to announce; nothing: the hub's count
  /// is impossible, and it is not attached.
  [[nodiscard]] std::optional<std::uint64_t> attach(net::Stream& stream,
                                                    const SessionTerms& session)
      GIMNET_EXCLUDES(mutex_);
  /// The connection broke; `again`: another one will come. When this returns nobody uses the stream
  /// any more. After Wants::no_memory nothing is kept for the next one.
  void detach(bool again) GIMNET_EXCLUDES(mutex_);
  /// No connection will come any more: what waits answers with this.
  void end(const Failure& failure) GIMNET_EXCLUDES(mutex_);
  /// Writes what waits, as far as the kernel takes it. `writable`: it has room again after it was
  /// full.
  void write_pending(bool writable) GIMNET_EXCLUDES(mutex_);
  /// The handle closes: what waits, a CONFIRM of the frames `taken` so far (0: none), and then this
  /// frame, are the last that go out; write_last() sends them on. True: more is left. Without the
  /// CONFIRM the hub would count as lost what was taken last.
  void begin_leaving(std::uint64_t taken, std::span<const std::byte> goodbye)
      GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] bool write_last() GIMNET_EXCLUDES(mutex_);
  using Wants = SocketWriter::Wants;
  [[nodiscard]] Wants wants() GIMNET_EXCLUDES(mutex_);
  /// The program's callback is called from now on, until end_callbacks(): nothing is left to the
  /// library's thread meanwhile, and what was left to it before is written now.
  void begin_callbacks() GIMNET_EXCLUDES(mutex_);
  void end_callbacks() GIMNET_EXCLUDES(mutex_);
  /// Sends the last message of a retained service, of which the hub may know nothing, behind what
  /// waits in its lane, unless a newer one goes on that had begun. Does not wait for room.
  void send_last_again(const std::string& service) GIMNET_EXCLUDES(mutex_);
  /// GROUP messages wait until end_declaring().
  void begin_declaring() GIMNET_EXCLUDES(mutex_);
  /// The services are declared again, and have these groups now, by their former ones (0: the hub
  /// refuses the service): what waits for them goes there, and so does what a program still sends
  /// to a former one. Returns how many frames that had been accepted before a break have no service
  /// any more, and are lost.
  std::uint64_t readdress(const SendQueue::GroupMap& moves) GIMNET_EXCLUDES(mutex_);
  /// GROUP messages go on.
  void end_declaring() GIMNET_EXCLUDES(mutex_);
  /// An own service has that group from now on, or had it until now.
  void forget_moves(std::uint32_t group) GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] std::uint32_t id() GIMNET_EXCLUDES(mutex_);

  void on_pause(const proto::flow::Target& target) GIMNET_EXCLUDES(mutex_);
  void on_resume(const proto::flow::Target& target) GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] bool on_confirm(std::uint64_t count) GIMNET_EXCLUDES(mutex_);
  /// A report of a message that its receiver gave up after send() had answered.
  [[nodiscard]] std::optional<proto::Report> on_taken(std::uint32_t from, const proto::Taken& taken)
      GIMNET_EXCLUDES(mutex_);
  /// Now and then: asks whether receivers are still there that allow no more of what is held.
  void look_after_held() GIMNET_EXCLUDES(mutex_);
  /// True: the program never asked for reports, or this is about a question of the library alone.
  /// The library asks for reports of every message of more than a window, and some come when it is
  /// sent. Once the program does, it gets all: a hub merges them, whatever they are about.
  bool on_report(const proto::Report& report) GIMNET_EXCLUDES(mutex_);
  /// The beginning of the message with a fragment header that the report is about, if it is known.
  [[nodiscard]] std::optional<ReportedMessages::Start> message_of(const proto::Report& report)
      GIMNET_EXCLUDES(mutex_);

 private:
  /// Holds the lock. Memory that runs out meanwhile leaves a queue that is not in order.
  class GIMNET_SCOPED_CAPABILITY Inside {
   public:
    explicit Inside(Outbound& outbound) GIMNET_ACQUIRE(outbound.mutex_)
        : outbound_(outbound), exceptions_(std::uncaught_exceptions()) {
      outbound.mutex_.lock();
    }
    ~Inside() GIMNET_RELEASE() GIMNET_NO_THREAD_SAFETY_ANALYSIS {
      if (std::uncaught_exceptions() != exceptions_) outbound_.writer_.give_up();
      outbound_.mutex_.unlock();
    }
    Inside(const Inside&) = delete;
    Inside& operator=(const Inside&) = delete;

   private:
    Outbound& outbound_;
    const int exceptions_;
  };
  void write_or_leave() GIMNET_REQUIRES(mutex_) { writer_.write_or_leave(false, mutex_); }
  /// Of the writer, within its own calls.
  void refill() override GIMNET_REQUIRES(mutex_);
  [[nodiscard]] bool has_more() const override GIMNET_REQUIRES(mutex_) {
    return under_way_.holds_any();
  }
  /// More may go of the messages that are held.
  void write_held() GIMNET_REQUIRES(mutex_) {
    if (under_way_.holds_any()) write_or_leave();
  }
  [[nodiscard]] bool ask_for_confirm() GIMNET_REQUIRES(mutex_);
  [[nodiscard]] std::optional<std::uint64_t> take_up(const SessionTerms& session)
      GIMNET_REQUIRES(mutex_);

  Mutex mutex_;
  Waiters waiters_ GIMNET_GUARDED_BY(mutex_);
  ConnectionState connection_ GIMNET_GUARDED_BY(mutex_);
  SendQueue queue_ GIMNET_GUARDED_BY(mutex_);
  FrameAppender frames_ GIMNET_GUARDED_BY(mutex_);
  SocketWriter writer_ GIMNET_GUARDED_BY(mutex_);
  PauseTable pauses_ GIMNET_GUARDED_BY(mutex_);
  GroupMoves moves_ GIMNET_GUARDED_BY(mutex_);
  SendGate gate_ GIMNET_GUARDED_BY(mutex_);
  MessagesUnderWay under_way_ GIMNET_GUARDED_BY(mutex_);
  LastMessages last_ GIMNET_GUARDED_BY(mutex_);
  MessageSender sender_ GIMNET_GUARDED_BY(mutex_);

  bool lost_ GIMNET_GUARDED_BY(mutex_) =
      false;  ///< frames were given up unconfirmed, and drain() has not said so yet
  bool asked_ GIMNET_GUARDED_BY(mutex_) =
      false;  ///< drain() asked this hub for a CONFIRM, and none came since
  bool leaving_ GIMNET_GUARDED_BY(mutex_) = false;  ///< what waits is the last that goes
  std::vector<std::byte> goodbye_
      GIMNET_GUARDED_BY(mutex_);  ///< waits until everything else is written
  std::uint64_t pause_count_ GIMNET_GUARDED_BY(mutex_) = 0;
};

}  // namespace gimnet::nif
