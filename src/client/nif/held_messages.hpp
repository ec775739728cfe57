#pragma once

#include <cstddef>
#include <cstdint>
#include <list>
#include <memory>
#include <optional>

#include "client/nif/outgoing.hpp"
#include "proto/frame/fragmenter.hpp"
#include "proto/frame/report.hpp"
#include "proto/frame/taken.hpp"
#include "proto/frame/window.hpp"

namespace gimnet::nif {

/// Progress of sending a fragmented message. A value type.
struct SendProgress {
  std::uint32_t number = 0;  ///< 0: not begun
  std::uint64_t epoch = 0;
  std::uint32_t dst = 0;
  std::uint64_t tag = 0;  ///< as Outgoing::tag()
  bool windowed = false;
  bool refused = false;
  proto::DropReason undelivered = proto::DropReason::none;
  proto::SendWindow window{0, 0};

  /// The receiver allows no more at the moment.
  [[nodiscard]] bool stalled() const { return windowed && window.room() == 0; }
  /// It has begun, and cannot be finished any more.
  [[nodiscard]] bool lost(std::uint64_t epoch_now) const {
    return refused || undelivered != proto::DropReason::none || (number != 0 && epoch != epoch_now);
  }
};

/// A message that had begun when the time of its sender was over. The rest is copied, and the
/// library goes on to send it. Thread safety: guarded by its owner.
struct HeldMessage {
  std::unique_ptr<Outgoing> message;
  SendProgress progress;
  proto::Fragmenter fragmenter;
};

/// The messages of a node of which the library has the rest. Thread safety: guarded by its owner.
/// Limits: the owner asks has_place() before a message begins of which the rest may come here.
class HeldMessages {
 public:
  /// `bytes_max`: of several together. One alone may have any size.
  explicit HeldMessages(std::size_t bytes_max) : bytes_max_(bytes_max) {}

  [[nodiscard]] bool empty() const { return messages_.empty(); }
  /// Memory of their payloads.
  [[nodiscard]] std::size_t bytes() const { return bytes_; }
  [[nodiscard]] bool has_place(std::size_t message_bytes) const {
    return messages_.empty() || bytes_ + message_bytes <= bytes_max_;
  }

  /// Copies what the fragmenter has not given out. May throw std::bad_alloc. The reference stays
  /// good until the message is erased.
  HeldMessage& hold(Outgoing& message, const SendProgress& progress,
                    const proto::Fragmenter& fragmenter);
  using Messages = std::list<HeldMessage>;  ///< Limit: as messages_
  using Place = Messages::iterator;
  [[nodiscard]] Place begin() { return messages_.begin(); }
  [[nodiscard]] Place end() { return messages_.end(); }
  [[nodiscard]] Messages::const_iterator begin() const { return messages_.begin(); }
  [[nodiscard]] Messages::const_iterator end() const { return messages_.end(); }
  /// The one behind it.
  Place erase(Place place);
  void clear();

  /// A TAKEN by which the receiver gives up one of them whose sender asked for reports: the report
  /// that the sender gets of it.
  [[nodiscard]] std::optional<proto::Report> report_of(std::uint32_t from,
                                                       const proto::Taken& taken) const;

 private:
  [[nodiscard]] static std::size_t bytes_of(const HeldMessage& held) {
    return held.message->rest_bytes();
  }

  const std::size_t bytes_max_;
  Messages messages_;  ///< Limit: one, or bytes_max of payload
  std::size_t bytes_ = 0;
};

}  // namespace gimnet::nif
