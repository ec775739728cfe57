#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "base/mutex.hpp"
#include "client/nif/connection_state.hpp"
#include "client/nif/error.hpp"
#include "client/nif/frame_appender.hpp"
#include "client/nif/held_messages.hpp"
#include "client/nif/last_messages.hpp"
#include "client/nif/messages_under_way.hpp"
#include "client/nif/outgoing.hpp"
#include "client/nif/reported_messages.hpp"
#include "client/nif/send_gate.hpp"
#include "client/nif/send_queue.hpp"
#include "client/nif/socket_writer.hpp"
#include "gimnet/nif.h"
#include "proto/frame/report.hpp"

namespace gimnet::nif {

/// Sends messages: each waits for its turn, and goes into the send queue in one frame or in
/// fragments. Its beginning is remembered for REPORTs, and the whole message if it is the last one
/// of a retained service.
/// Thread safety: guarded by its owner. Functions that take the owner's mutex give it up while they
/// wait or write. Errors: after std::bad_alloc the queue is not in order.
class MessageSender {
 public:
  struct Parts {
    const ConnectionState& connection;
    const SendQueue& queue;
    SendGate& gate;         ///< of `queue`
    FrameAppender& frames;  ///< into `queue`
    MessagesUnderWay& under_way;
    SocketWriter& writer;  ///< of `queue`
    Waiters& waiters;      ///< hear of each change of the others
    LastMessages& last;
  };
  /// The parts outlive it.
  explicit MessageSender(const Parts& parts) : parts_(parts) {}

  /// Answers when the message is in the queue, or when the library goes on with it.
  [[nodiscard]] nif_status send(Outgoing& message, Deadline deadline, Mutex& mutex)
      GIMNET_REQUIRES(mutex);
  /// The hub keeps last messages of so many bytes; nothing: it does not tell.
  void set_hub_retains(std::optional<std::uint32_t> bytes_max) { hub_retains_ = bytes_max; }

  /// The program sent something with NIF_FLAG_REPORT.
  [[nodiscard]] bool reports_wanted() const { return reports_wanted_; }
  /// The beginning of the message with a fragment header that the report is about, if it is known.
  [[nodiscard]] std::optional<ReportedMessages::Start> message_of(
      const proto::Report& report) const {
    return reported_.find(report);
  }
  [[nodiscard]] std::uint64_t messages_sent() const { return messages_sent_; }

 private:
  [[nodiscard]] bool may_go(const Outgoing& message, std::size_t frame_size,
                            const SendProgress* own);
  [[nodiscard]] nif_status wait_for_turn(Outgoing& message, std::size_t frame_size,
                                         Deadline deadline, Mutex& mutex) GIMNET_REQUIRES(mutex);
  [[nodiscard]] nif_status wait_until_it_may_go(const Outgoing& message, std::size_t frame_size,
                                                const SendProgress* own, Deadline deadline,
                                                Mutex& mutex) GIMNET_REQUIRES(mutex);
  [[nodiscard]] nif_status send_whole(Outgoing& message, Deadline deadline, Mutex& mutex)
      GIMNET_REQUIRES(mutex);
  [[nodiscard]] nif_status send_fragments(Outgoing& message, Deadline deadline, Mutex& mutex)
      GIMNET_REQUIRES(mutex);
  [[nodiscard]] nif_status send_pieces(Outgoing& message, SendProgress& progress, Deadline deadline,
                                       Mutex& mutex) GIMNET_REQUIRES(mutex);
  [[nodiscard]] std::uint32_t number_of(Outgoing& message, bool windowed);
  [[nodiscard]] bool is_retained(const Outgoing& message) const {
    return message.is_group() && parts_.last.follows(message.parts().header.dst);
  }
  [[nodiscard]] nif_status check_retained(Outgoing& message) const;

  const Parts parts_;
  ReportedMessages reported_;
  bool reports_wanted_ = false;
  std::optional<std::uint32_t> hub_retains_;
  std::uint64_t messages_sent_ = 0;
};

}  // namespace gimnet::nif
