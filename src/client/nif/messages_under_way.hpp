#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <unordered_map>

#include "client/nif/frame_appender.hpp"
#include "client/nif/held_messages.hpp"
#include "client/nif/outgoing.hpp"
#include "client/nif/send_gate.hpp"
#include "gimnet/nif.h"
#include "proto/frame/fragmenter.hpp"
#include "proto/frame/frame_header.hpp"
#include "proto/frame/report.hpp"
#include "proto/frame/taken.hpp"

namespace gimnet::nif {

/// The fragmented messages that a node is sending, one of a stream at a time: how far they are, and
/// the rest of those whose senders do not wait any more.
/// Thread safety: guarded by its owner. Limits: one a sender, and those of HeldMessages.
class MessagesUnderWay {
 public:
  explicit MessagesUnderWay(std::size_t held_bytes_max) : held_(held_bytes_max) {}

  /// No other message of its stream is under way, and there is place for its rest if that may be
  /// held.
  [[nodiscard]] bool may_begin(const Outgoing& message) const {
    if (!by_stream_.empty() && by_stream_.contains(message.stream())) return false;
    const bool may_be_held = !message.patient() && message.size() > proto::kUncutMessageMax;
    return !may_be_held || held_.has_place(message.size());
  }
  /// From now on until end() the message is under way. The progress stays where it is. May throw
  /// std::bad_alloc. REQUIRES: may_begin().
  void add(const Outgoing& message, SendProgress& progress) {
    by_stream_.emplace(message.stream(), &progress);
  }
  /// Its first fragment goes out, under that number.
  void begin(const Outgoing& message, SendProgress& progress, std::uint32_t number) const;
  /// Its sender does not wait any more: the rest is copied, and goes on. May throw std::bad_alloc.
  /// REQUIRES: add().
  void hold(Outgoing& message, const SendProgress& progress, const proto::Fragmenter& fragmenter);
  /// Its sender is done with it. REQUIRES: add().
  void end(const Outgoing& message, const SendProgress& progress);
  /// Why the message cannot be finished, with a sentence; NIF_OK: it can.
  [[nodiscard]] nif_status check(const SendProgress& progress) const;
  /// The fragments of a message to that destination go on.
  [[nodiscard]] bool goes_on(const proto::FrameHeader& header) const;

  /// There are messages whose senders do not wait any more.
  [[nodiscard]] bool holds_any() const { return !held_.empty(); }
  [[nodiscard]] std::size_t held_bytes() const { return held_.bytes(); }
  struct Put {
    bool ended = false;  ///< messages are not under way any more
    bool lost = false;   ///< the hub refuses the service of some
  };
  /// Puts into the queue what may go of the messages that are held.
  Put put_held(SendGate& gate, FrameAppender& frames);
  /// Asks whether receivers are still there that allow no more of what is held.
  void ask_for_receivers(FrameAppender& frames) const;
  /// No connection will come. True: messages are lost.
  bool drop_held();
  /// The counts of the hub begin anew: all that had begun is lost. As drop_held().
  bool begin_epoch();

  /// The report of a message that is held, if its receiver gave it up.
  [[nodiscard]] std::optional<proto::Report> on_taken(std::uint32_t from,
                                                      const proto::Taken& taken);
  void on_report(const proto::Report& report);
  /// The receiver of the message with that tag says that it is larger than it takes. REQUIRES: not
  /// 0.
  void refuse(std::uint64_t tag);

 private:
  [[nodiscard]] bool put(HeldMessage& held, SendGate& gate, FrameAppender& frames, Put& all) const;

  std::unordered_map<std::uint64_t, SendProgress*> by_stream_;
  HeldMessages held_;
  std::uint64_t epoch_ = 0;  ///< grows when counts begin anew
};

}  // namespace gimnet::nif
