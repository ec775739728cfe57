#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "base/endian.hpp"
#include "base/ids.hpp"
#include "base/result.hpp"
#include "proto/frame/fragment_header.hpp"
#include "proto/frame/frame_header.hpp"

// Finds frames in a read buffer, in place: no copy, no allocation, and nothing read beyond the
// bytes that are there. Thread safety: pure functions; views refer to the caller's bytes.

namespace gimnet::proto {

/// Why bytes are not a legal frame: each cause that docs/protocol.md, section 2, calls malformed.
enum class FrameError : std::uint8_t {
  none = 0,
  too_long,             ///< length over the largest frame
  incomplete,           ///< fewer bytes than the header says
  reserved_lane_bits,   ///< bits 2-7 of lane
  reserved_flag_bits,   ///< bits 6-7 of flags, from a node
  hops_not_zero,        ///< from a node
  unknown_kind,         ///< kinds 20 to 255
  kind_not_allowed,     ///< a kind that this role may not send
  block_not_allowed,    ///< BLOCK on GROUP, LIST or BROADCAST
  latest_without_key,   ///< LATEST on UNICAST or SERVICE without KEYED
  list_count,           ///< LIST with n outside 1..1024
  list_too_short,       ///< LIST whose ids do not fit
  list_not_ascending,   ///< LIST ids not strictly ascending
  ext_too_short,        ///< EXT, or one extension in it, that does not fit
  fragment_too_short,   ///< fragment header that does not fit
  key_too_short,        ///< key that does not fit
  fragment_empty,       ///< a fragment with no payload
  fragment_over_total,  ///< offset + payload > total
  dst_not_zero,         ///< FLOW or LINK for somebody else than the other end of the connection
  flag_not_allowed,     ///< a flag that this kind may not carry: what follows the header would be
                        ///< misread
  report_too_short,     ///< REPORT without the header of the frame that it is about
};
inline constexpr std::size_t kFrameErrorCount = 21;

/// A clause for the sentence of GOODBYE `malformed`, for example "hops is not 0".
[[nodiscard]] constexpr const char* frame_error_text(FrameError error) {
  constexpr const char* kTexts[kFrameErrorCount] = {
      "no error",
      "length is over the largest frame",
      "the frame is not complete",
      "reserved bits of lane are set",
      "reserved bits of flags are set",
      "hops is not 0",
      "the kind is not known",
      "this role may not send that kind",
      "BLOCK is not allowed on GROUP, LIST or BROADCAST",
      "LATEST needs KEYED here",
      "LIST names no or too many recipients",
      "the ids of LIST do not fit in the frame",
      "the ids of LIST are not strictly ascending",
      "an extension does not fit in the frame",
      "the fragment header does not fit in the frame",
      "the key does not fit in the frame",
      "a fragment without payload",
      "a fragment ends after the message's total",
      "FLOW and LINK are for this connection only: dst must be 0",
      "a flag (FRAGMENT, EXT, KEYED) that this kind may not carry",
      "REPORT is too short"};
  const auto index = static_cast<std::size_t>(error);
  return index < kFrameErrorCount ? kTexts[index] : "unknown error";
}

/// Neighbouring whole frames. Valid until: the buffer changes.
struct RunView {
  const std::byte* bytes = nullptr;
  std::uint32_t size = 0;
  std::uint32_t frames = 0;
  std::uint32_t last_bytes = 0;  ///< of its last frame, header included
};

enum class Found : std::uint8_t {
  run,        ///< `run` has at least one frame
  need_more,  ///< the first frame is not whole yet: `needed` says how many bytes that takes,
              ///< counted from `begin`
  too_long,   ///< the first frame is longer than allowed: the stream cannot be read on
};

struct NextRun {
  Found found = Found::need_more;
  RunView run;
  std::uint32_t needed = 0;
};

/// A run ends here, unless it is one larger frame. It bounds what is lost at a time at a full queue
/// (docs/protocol.md, section 5), and what it takes to look through a run.
inline constexpr std::size_t kRunBytesMax = 64 * 1024;

/// True where neighbouring frames with equal headers mean the same to a router, so that they may
/// travel as one run: not for LIST (its ids differ), FLOW, REPORT and control kinds, fragments,
/// extensions and LATEST, which are looked at singly.
[[nodiscard]] constexpr bool may_form_run(const FrameHeader& header) {
  constexpr std::uint32_t kRunKinds = 0xFFFFu & ~(1u << static_cast<unsigned>(Kind::list)) &
                                      ~(1u << static_cast<unsigned>(Kind::flow)) &
                                      ~(1u << static_cast<unsigned>(Kind::report));
  const auto kind = static_cast<unsigned>(header.kind);
  return kind < kFirstControlKind && ((kRunKinds >> kind) & 1u) != 0 &&
         !header.has(kFlagFragment | kFlagExt) && header.policy() != Policy::latest;
}

/// Of the frames at `next`, taken to be `frame_size` bytes each, how many of the first have all 16
/// bytes of `like` as their header, in fours: whoever sends a thousand small messages sends a
/// thousand equal headers. REQUIRES: frame_size
/// >= 16.
[[nodiscard]] std::uint32_t count_equal_fours(const std::byte* next, std::size_t available,
                                              std::size_t frame_size, const std::byte* like);

/// The longest run of whole frames at `begin` whose bytes 4..15 (dst, src, kind, flags, hops, lane)
/// are all equal, up to kRunBytesMax; a frame that may_form_run() excludes is a run of its own. Of
/// the rules of section 2 only the length is checked: the caller checks one header per run.
/// REQUIRES: begin <= end.
[[nodiscard]] inline NextRun next_run(const std::byte* begin, const std::byte* end,
                                      std::uint32_t max_length) {
  std::size_t available = static_cast<std::size_t>(end - begin);
  if (available < kHeaderSize)
    return {Found::need_more, {}, static_cast<std::uint32_t>(kHeaderSize)};
  const FrameHeader header = load_header(begin);
  if (header.length > max_length) return {Found::too_long, {}, 0};
  if (header.frame_size() > available)
    return {Found::need_more, {}, static_cast<std::uint32_t>(header.frame_size())};
  std::size_t size = header.frame_size();
  std::size_t frame_size = size;
  std::uint32_t frames = 1;
  if (may_form_run(header)) {
    if (available > kRunBytesMax) available = std::max(size, kRunBytesMax);
    auto length_and_dst = load_le<std::uint64_t>(begin);
    const auto dst = load_le<std::uint32_t>(begin + kDstOffset);
    const auto src_and_attributes = load_le<std::uint64_t>(begin + kSrcOffset);
    while (true) {
      // Most frames are as long as the one before. Where the next one begins is then known without
      // waiting for what this one says, so that several are compared at a time: half the time of a
      // run of small frames.
      while (available - size >= frame_size &&
             load_le<std::uint64_t>(begin + size) == length_and_dst &&
             load_le<std::uint64_t>(begin + size + kSrcOffset) == src_and_attributes) {
        size += frame_size;
        const std::uint32_t more = count_equal_fours(begin + size, available - size, frame_size,
                                                     begin + size - frame_size);
        size += more * frame_size;
        frames += 1 + more;
      }
      if (available - size < kHeaderSize) break;
      const std::byte* next = begin + size;
      const auto next_dst = load_le<std::uint32_t>(next + kDstOffset);
      if (next_dst != dst || load_le<std::uint64_t>(next + kSrcOffset) != src_and_attributes) break;
      const auto length = load_le<std::uint32_t>(next);
      if (length > max_length || kHeaderSize + length > available - size) break;
      frame_size = kHeaderSize + length;
      length_and_dst = load_le<std::uint64_t>(next);
    }
  }
  return {Found::run,
          {begin, static_cast<std::uint32_t>(size), frames, static_cast<std::uint32_t>(frame_size)},
          0};
}

/// The sender of a frame. A frame of a hub may have hops and reserved flags, and its LIST comes
/// with dst 0 and without ids.
enum class Origin : std::uint8_t { node, hub };

/// The rules for a frame of a node that its 16 bytes alone can break: reserved bits, hops, kind,
/// which flags that may carry, policy, n of LIST.
[[nodiscard]] constexpr FrameError check_header_from_node(const FrameHeader& header) {
  const auto kind = static_cast<std::uint8_t>(header.kind);
  if ((header.lane & ~kLaneMask) != 0) return FrameError::reserved_lane_bits;
  if (header.has(kFlagReservedMask)) return FrameError::reserved_flag_bits;
  if (header.hops != 0) return FrameError::hops_not_zero;
  if (kind > static_cast<std::uint8_t>(Kind::route)) return FrameError::unknown_kind;
  // Six kinds in one test: it is made for every frame that is not like the one before it.
  constexpr auto bit = [](Kind each) {
    return std::uint32_t{1} << static_cast<std::uint8_t>(each);
  };
  constexpr std::uint32_t kNotForNodes = bit(Kind::report) | bit(Kind::route);
  constexpr std::uint32_t kForThisConnection = bit(Kind::flow) | bit(Kind::link);
  constexpr std::uint32_t kRequests = bit(Kind::ns) | bit(Kind::ctrl);
  if (((kNotForNodes | kForThisConnection | kRequests) >> kind & 1) != 0) {
    if ((kNotForNodes >> kind & 1) != 0) return FrameError::kind_not_allowed;
    const bool for_this_connection = (kForThisConnection >> kind & 1) != 0;
    if (for_this_connection && header.dst != 0) return FrameError::dst_not_zero;
    const std::uint8_t forbidden =
        for_this_connection ? kFlagFragment | kFlagKeyed | kFlagExt : kFlagFragment | kFlagKeyed;
    if (header.has(forbidden)) return FrameError::flag_not_allowed;
  }
  const bool to_many =
      header.kind == Kind::group || header.kind == Kind::list || header.kind == Kind::broadcast;
  if (header.policy() == Policy::block && to_many) return FrameError::block_not_allowed;
  const bool to_one = header.kind == Kind::unicast || header.kind == Kind::service;
  if (header.policy() == Policy::latest && to_one && !header.has(kFlagKeyed))
    return FrameError::latest_without_key;
  if (header.kind == Kind::list && (header.dst == 0 || header.dst > kListRecipientsMax))
    return FrameError::list_count;
  return FrameError::none;
}

/// The rules for the header of a REPORT or FLOW of a hub. Nothing stands between it and the
/// payload.
[[nodiscard]] constexpr FrameError check_header_of_hub_word(const FrameHeader& header) {
  if ((header.lane & ~kLaneMask) != 0) return FrameError::reserved_lane_bits;
  const bool misread = header.has(kFlagFragment | kFlagKeyed | kFlagExt);
  return misread ? FrameError::flag_not_allowed : FrameError::none;
}

/// The node ids of a LIST frame, at any alignment. Valid until: the frame's bytes change.
class ListIds {
 public:
  constexpr ListIds() = default;
  /// REQUIRES: 4 * count readable bytes.
  ListIds(const std::byte* bytes, std::uint32_t count) : bytes_(bytes), count_(count) {}
  [[nodiscard]] std::uint32_t size() const { return count_; }
  [[nodiscard]] bool empty() const { return count_ == 0; }
  /// REQUIRES: index < size().
  [[nodiscard]] NodeId operator[](std::uint32_t index) const {
    GIMNET_ASSERT(index < count_);
    return NodeId{load_le<std::uint32_t>(bytes_ + std::size_t{4} * index)};
  }

 private:
  const std::byte* bytes_ = nullptr;
  std::uint32_t count_ = 0;
};

/// One legal frame, taken apart. Valid until: its bytes change.
struct FrameView {
  FrameHeader header;
  ListIds recipients;                      ///< LIST only
  std::span<const std::byte> extensions;   ///< without the u16 before them; see extensions.hpp
  std::optional<FragmentHeader> fragment;  ///< where FRAGMENT is set
  std::optional<std::uint64_t> key;  ///< where KEYED is set: its 8 bytes as a little-endian number
  std::span<const std::byte> payload;       ///< what is left
  std::span<const std::byte> after_header;  ///< everything after the 16 bytes

  /// It is a message, or the last fragment of one.
  [[nodiscard]] bool ends_message() const {
    return !fragment || fragment->offset + payload.size() == fragment->total;
  }
};

/// Takes one frame apart and checks all of section 2 that a frame shows by itself. `frame` may be
/// longer than the frame; shorter is FrameError::incomplete. The largest length and the source are
/// the caller's to check.
[[nodiscard]] Result<FrameView, FrameError> parse_frame(std::span<const std::byte> frame,
                                                        Origin origin);

}  // namespace gimnet::proto
