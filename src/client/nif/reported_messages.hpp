#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "client/nif/outgoing.hpp"
#include "proto/frame/report.hpp"

namespace gimnet::nif {

/// The beginnings of the last messages with a fragment header that ask for reports. A REPORT
/// repeats 16 bytes of a frame, and of a fragment those are hardly more than its header: they tell
/// the number of the message, and nothing of what it is. Thread safety: one thread at a time.
/// Memory: 48 KiB, from the first message on.
class ReportedMessages {
 public:
  /// REPORTs come a round trip and a report_interval_ms of the hub after their messages.
  static constexpr std::size_t kMessagesMax = 1024;
  /// Of each: the key, if it has one, and what follows. As much as a REPORT repeats of a frame.
  using Start = std::array<std::byte, proto::kReportFollowingMax>;

  /// REQUIRES: the message has over 4 KiB.
  void remember(std::uint32_t number, Outgoing& message);

  /// The bytes behind the header of the message that the report is about. Nothing: it has no
  /// fragment header, that is behind other bytes (EXT, LIST ids), or the message is too old.
  [[nodiscard]] std::optional<Start> find(const proto::Report& report) const;

  /// The number of the message that the report is about; nothing: it has none, or does not tell.
  [[nodiscard]] static std::optional<std::uint32_t> number_of(const proto::Report& report);

 private:
  struct Message {
    std::uint32_t number = 0;  ///< 0: none
    std::uint32_t dst = 0;
    proto::Kind kind = proto::Kind::unicast;
    Start start{};
  };

  std::vector<Message> messages_;
  std::size_t next_ = 0;  ///< the oldest, which the next one replaces
};

}  // namespace gimnet::nif
