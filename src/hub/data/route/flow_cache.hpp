#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "base/endian.hpp"
#include "hub/data/fanout/recipient.hpp"
#include "proto/frame/frame_parser.hpp"

namespace gimnet::hub {

/// The recipients here of frames to one node, by destination and attributes (kind, flags, hops,
/// lane): what the tables said last. A frame like the one before to its recipient goes right behind
/// that, and neither parser, gate nor tables are asked again. They would say the same: all that
/// they decide by is in the header, and the source is the connection's own. Frames of which the
/// header is not all (a limit on lane 0, keys that may be missing) are not noted.
///
/// Emptied by begin(), for another connection or another epoch of the node table, and by forget(),
/// when a recipient goes or has another connection. Thread safety: one shard.
class FlowCache {
 public:
  /// Bytes of `source`'s connection are looked at from here on, or those that other shards handed
  /// over and have admitted (0). `epoch`: of the node table.
  void begin(NodeId source, std::uint64_t epoch) {
    if (source == source_ && epoch == epoch_) return;
    source_ = source;
    epoch_ = epoch;
    forget();
  }
  void forget() {
    if (noted_) places_.fill({});
    noted_ = false;
  }

  /// nullptr: the tables have to be asked. REQUIRES: a whole header.
  [[nodiscard]] Recipient* find(const std::byte* frame) const {
    const auto dst = load_le<std::uint32_t>(frame + proto::kDstOffset);
    const Place& place = places_[dst % kPlaces];
    const bool same = place.dst == dst && place.attributes == attributes_of(frame);
    return same ? place.recipient : nullptr;
  }
  /// The tables gave that recipient for the frame, which it has not got yet. REQUIRES: admitted, to
  /// one node.
  void note(Recipient& recipient, const std::byte* frame) {
    // From here on it has no open run but of these bytes: one of another connection would take
    // frames that say they are from there.
    recipient.outbox.close_run();
    const proto::FrameHeader header = proto::load_header(frame);
    if (header.lane == static_cast<std::uint8_t>(proto::Lane::real_time) ||
        header.has(proto::kFlagKeyed))
      return;
    // Nothing that Outbox::append() takes may be too large for the recipient, of which nobody asks
    // then.
    if (recipient.frame_bytes < Outbox::kAppendBytesMax) return;
    noted_ = true;
    places_[header.dst % kPlaces] = {header.dst, attributes_of(frame), &recipient};
  }

  /// Appends frames from `begin` on, up to the first that is not like one before it, or for the
  /// recipient of the one before: those are found and handed on as one run, which is cheaper.
  /// Returns what was appended, as one stretch.
  [[nodiscard]] proto::RunView append(const std::byte* begin, const std::byte* end, Tally& tally) {
    proto::RunView appended{begin, 0, 0, 0};
    if (!noted_) return appended;
    const auto available = static_cast<std::size_t>(end - begin);
    const Recipient* before = nullptr;
    while (available - appended.size >= proto::kHeaderSize) {
      const std::byte* frame = begin + appended.size;
      const Place& place = places_[load_le<std::uint32_t>(frame + proto::kDstOffset) % kPlaces];
      Recipient* const recipient = place.recipient;
      if (recipient == before || recipient == nullptr) break;
      if (attributes_of(frame) != place.attributes) break;
      const std::size_t size = proto::kHeaderSize + std::size_t{load_le<std::uint32_t>(frame)};
      // The outbox compares destination and source.
      if (size > available - appended.size ||
          !recipient->outbox.append(frame, static_cast<std::uint32_t>(size), 1))
        break;
      before = recipient;
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
  struct Place {
    std::uint32_t dst = 0;
    std::uint32_t attributes = 0;
    Recipient* recipient = nullptr;
  };

  [[nodiscard]] static std::uint32_t attributes_of(const std::byte* frame) {
    return load_le<std::uint32_t>(frame + proto::kAttributesOffset);
  }
  NodeId source_;
  bool noted_ = false;  ///< anybody
  std::uint64_t epoch_ = 0;
  std::array<Place, kPlaces> places_{};
};

}  // namespace gimnet::hub
