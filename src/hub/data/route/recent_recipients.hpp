#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "base/endian.hpp"
#include "hub/data/fanout/recipient.hpp"
#include "proto/frame/frame_parser.hpp"

namespace gimnet::hub {

/// Who got the last small frames of the bytes that are being looked at. A frame for one of them
/// with the header of the one before goes right behind that one: neither gate nor tables are asked
/// again. They would say the same, for all that they decide by is in the header, and nothing
/// changes while a shard looks at bytes; where it is not all (a limit on lane 0, keys that may be
/// missing) nothing is noted. Thread safety: one shard. Lifetime: what is noted stands until
/// forget(), and no recipient may go meanwhile.
class RecentRecipients {
 public:
  /// REQUIRES: its outbox has just taken `frame`, UNICAST, admitted, for it and from these bytes,
  /// by Outbox::append().
  void note(Recipient& recipient, const std::byte* frame) {
    const proto::FrameHeader header = proto::load_header(frame);
    const auto attributes = load_le<std::uint32_t>(frame + proto::kAttributesOffset);
    Outbox*& place = outboxes_[header.dst % kPlaces];
    if (place == &recipient.outbox && attributes == attributes_) return;
    if (header.lane == static_cast<std::uint8_t>(proto::Lane::real_time) ||
        header.has(proto::kFlagKeyed))
      return;
    // Nothing that append() takes may be too large for the recipient, of which nobody asks then.
    if (recipient.frame_bytes < Outbox::kAppendBytesMax) return;
    if (attributes != attributes_) forget();
    attributes_ = attributes;
    noted_ = true;
    place = &recipient.outbox;
  }
  void forget() {
    if (noted_) outboxes_.fill(nullptr);
    noted_ = false;
  }

  /// Appends frames from `begin` on, up to the first that is not like one before it, or for the
  /// recipient of the one before: those are found and handed on as one run, which is cheaper.
  /// Returns what was appended, as one stretch.
  [[nodiscard]] proto::RunView append(const std::byte* begin, const std::byte* end, Tally& tally) {
    proto::RunView appended{begin, 0, 0};
    if (!noted_) return appended;
    const auto available = static_cast<std::size_t>(end - begin);
    const Outbox* before = nullptr;
    while (available - appended.size >= proto::kHeaderSize) {
      const std::byte* frame = begin + appended.size;
      Outbox* outbox = outboxes_[load_le<std::uint32_t>(frame + proto::kDstOffset) % kPlaces];
      if (outbox == before || outbox == nullptr) break;
      if (load_le<std::uint32_t>(frame + proto::kAttributesOffset) != attributes_) break;
      const std::size_t size = proto::kHeaderSize + std::size_t{load_le<std::uint32_t>(frame)};
      if (size > available - appended.size ||
          !outbox->append(frame, static_cast<std::uint32_t>(size), 1))
        break;
      before = outbox;
      appended.size += static_cast<std::uint32_t>(size);
      ++appended.frames;
    }
    tally.queued += appended.frames;
    tally.copied_bytes += appended.size;
    return appended;
  }

 private:
  /// Nodes with neighbouring ids, as those that joined together have, do not share a place.
  static constexpr std::size_t kPlaces = 32;

  std::array<Outbox*, kPlaces> outboxes_{};
  std::uint32_t attributes_ = 0;  ///< of all that was noted
  bool noted_ = false;            ///< anybody
};

}  // namespace gimnet::hub
