#pragma once

#include <cstddef>
#include <cstdint>

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
};
inline constexpr std::size_t kFrameErrorCount = 20;

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
      "a flag (FRAGMENT, EXT, KEYED) that this kind may not carry"};
  const auto index = static_cast<std::size_t>(error);
  return index < kFrameErrorCount ? kTexts[index] : "unknown error";
}

}  // namespace gimnet::proto
