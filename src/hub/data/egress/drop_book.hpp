#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "base/ids.hpp"
#include "hub/data/tally.hpp"
#include "proto/frame/frame_header.hpp"
#include "proto/frame/report.hpp"

namespace gimnet::hub {

/// Counts every frame that is not delivered, by reason, and remembers it for a REPORT if its sender
/// asked for one. Reports for one sender and reason are merged until they are due. Thread safety:
/// one shard.
class DropBook {
 public:
  /// interval_ms: the shortest time between two reports to one sender for one reason.
  /// notes_max: senders and reasons remembered at once; the drops of more are counted but not
  /// reported.
  DropBook(Tally& tally, std::uint64_t interval_ms, std::uint64_t notes_max)
      : tally_(tally), interval_ms_(interval_ms), notes_max_(notes_max) {}

  /// Counts `frames` that have one header, apart from the length. A REPORT shows the one at
  /// `start`; of the others no byte need be there.
  void drop(const std::byte* start, std::uint32_t frames, proto::DropReason reason);

  /// The same for frames with any headers.
  void drop_mixed(const std::byte* first, std::uint32_t size, proto::DropReason reason);

  /// Reports on a frame that is delivered, whether its sender asked for reports or not. Nothing is
  /// counted. Reports on group frames are merged for each group.
  void tell(const std::byte* frame, proto::DropReason reason) { remember(frame, 1, reason); }

  /// Of a frame that is dropped its sender is told.
  [[nodiscard]] static bool wants_report(const proto::FrameHeader& header) {
    return header.has(proto::kFlagReport) && header.kind != proto::Kind::report;
  }

  /// True while reports wait for their time, or senders are to be forgotten: flush() has something
  /// to do.
  [[nodiscard]] bool pending() const { return !notes_.empty(); }

  /// A report that cannot be sent is kept for so long.
  static constexpr std::uint64_t kKeptMs = 5'000;

  /// Calls send(NodeId sender, payload span) for each report that is due, and forgets senders that
  /// dropped nothing for a while. send() returns whether there is a way to the sender. Without one
  /// the report waits, and grows, for kKeptMs at most; take_lost() counts it after that.
  template <class Send>
  void flush(std::uint64_t now_ms, Send&& send) {
    const std::size_t before = notes_.size();
    for (std::size_t i = 0; i < notes_.size();) {
      Note& note = notes_[i];
      const bool due = now_ms >= note.sent_ms + interval_ms_;
      if (due && note.count != 0) {
        std::byte payload[proto::kReportSizeMax];
        const std::size_t size = encode(note, payload);
        note.sent_ms = now_ms;
        const bool sent = send(note.sender, std::span<const std::byte>(payload, size));
        if (!sent && note.kept_since_ms == 0) note.kept_since_ms = now_ms;
        const bool kept = !sent && now_ms < note.kept_since_ms + kKeptMs;
        lost_ += sent || kept ? 0 : 1;
        if (!kept) note.count = 0;
        if (!kept) note.kept_since_ms = 0;
      } else if (due) {
        notes_[i] = notes_.back();
        notes_.pop_back();
        continue;
      }
      ++i;
    }
    if (notes_.size() != before) link_all();
  }

  /// Reports that could not be sent, since the last call.
  [[nodiscard]] std::uint64_t take_lost() { return std::exchange(lost_, 0); }

 private:
  struct Note {
    NodeId sender;
    proto::DropReason reason{};
    std::uint32_t count = 0;
    std::uint32_t next = 0;  ///< number of the next one with the same place; 0: none
    std::uint64_t sent_ms = 0;
    std::uint64_t kept_since_ms = 0;  ///< without a way to the sender; 0: there is one
    proto::FrameHeader last;
    std::uint8_t following_size = 0;
    std::byte following[proto::kReportFollowingMax];
  };

  void remember(const std::byte* frame, std::uint32_t frames, proto::DropReason reason);
  /// Reports of one subject are merged.
  struct Subject {
    NodeId sender;
    proto::DropReason reason{};
    std::uint32_t group = 0;  ///< of `not_retained`; else 0
    friend bool operator==(const Subject&, const Subject&) = default;
  };
  [[nodiscard]] static Subject subject_of(const proto::FrameHeader& header,
                                          proto::DropReason reason);
  /// Found by a table, since who drops much has many notes.
  [[nodiscard]] Note* find(const Subject& subject);
  [[nodiscard]] std::size_t place_of(const Subject& subject) const;
  void link(std::uint32_t number);
  void link_all();
  static std::size_t encode(const Note& note, std::span<std::byte, proto::kReportSizeMax> payload);

  Tally& tally_;
  const std::uint64_t interval_ms_;
  const std::uint64_t notes_max_;
  std::uint64_t lost_ = 0;
  std::vector<Note> notes_;  ///< Limit: reports
  std::vector<std::uint32_t>
      heads_;  ///< by place_of(): a note's number, its index + 1; empty before the first
};

}  // namespace gimnet::hub
