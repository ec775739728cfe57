#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "base/endian.hpp"
#include "base/ids.hpp"
#include "hub/data/tally.hpp"
#include "hub/limits.hpp"
#include "proto/frame/frame_parser.hpp"

namespace gimnet::hub {

/// Fragmented lane 0 messages of one connection that have begun: whether they were moved to lane 1,
/// since a message is moved whole or not at all, and how much of what was counted when they began
/// is left. Where more are begun at a time, the one that began longest ago is forgotten: a sender
/// may give up any without a word. Thread safety: one shard.
class RealTimeMessages {
 public:
  static constexpr std::size_t kMessagesMax = 8;

  struct Message {
    std::uint32_t number = 0;
    bool known = false;
    bool moved = false;
    std::uint64_t left_bytes = 0;  ///< of frames that were counted already
  };

  /// nullptr: not known. Valid until: the next begin().
  [[nodiscard]] Message* find(std::uint32_t number) {
    for (Message& message : messages_) {
      if (message.known && message.number == number) return &message;
    }
    return nullptr;
  }
  void begin(const Message& message) {
    Message* place = find(message.number);
    if (place == nullptr) {
      place = &messages_[next_];
      next_ = (next_ + 1) % kMessagesMax;
    }
    *place = message;
  }

 private:
  std::array<Message, kMessagesMax> messages_{};
  std::size_t next_ = 0;  ///< whose place the next one gets: all are taken in turns
};

/// The gate's decision on frames that a connection sent.
enum class Admission : std::uint8_t {
  data,          ///< kinds 0 to 15 but FLOW: to the router
  flow,          ///< FLOW, for this connection
  link,          ///< LINK, for this connection
  control,       ///< NS or CTRL, for the conductor
  malformed,     ///< breaks docs/protocol.md, section 2: close a node, drop a link's frame
  wrong_source,  ///< speaks for somebody else: close a node, drop a link's frame
  hop_limit,     ///< of a link: crossed as many links as it may; drop
  report,        ///< of a link: REPORT, for the node that it names
};

/// The frames that a link may carry. Immutable.
struct LinkRule {
  HubId own;                   ///< this hub, for which nobody else speaks
  std::vector<HubId> allow{};  ///< sources' hubs, ascending; empty: all
  [[nodiscard]] bool allows(HubId source) const;
};

/// The gate's memory of one connection. Thread safety: one shard.
struct IngressState {
  /// Of a plain UNICAST frame in lane 1, which is always legal.
  static constexpr std::uint32_t kPlainUnicast = 1u << 24;

  NodeId node;
  const LinkRule* link = nullptr;  ///< nullptr: a node
  /// Kind, flags, hops and lane of the last legal run of plain data.
  std::uint32_t admitted_attributes = kPlainUnicast;
  std::uint64_t lane0_bytes = 0;  ///< since lane0_since_ms
  std::uint64_t lane0_since_ms = 0;
  std::uint64_t demoted_until_ms = 0;
  std::unique_ptr<RealTimeMessages> real_time_messages;  ///< nullptr: it has not begun any
  proto::FrameError error = proto::FrameError::none;     ///< why the last frame was malformed
};

/// The one gate that every frame from a connection passes, whatever the connection is: is it legal,
/// and does its sender speak for itself? Frames of a node that sends more in lane 0 than it may are
/// moved to lane 1. Thread safety: one shard.
class IngressGate {
 public:
  IngressGate(const Limits& limits, Tally& tally) : limits_(limits), tally_(tally) {}

  /// One run of the parser (neighbouring frames with one header but for the length). `run` may be
  /// changed in its lane byte: its bytes belong to the reading connection alone until they are
  /// handed on. Where a later frame of the run is malformed, `view` is shortened to the frames
  /// before it, and the next run begins with that one.
  [[nodiscard]] Admission admit(IngressState& state, std::byte* run, proto::RunView& view,
                                std::uint64_t now_ms) {
    // Most runs are like the one before.
    if (load_le<std::uint32_t>(view.bytes + proto::kAttributesOffset) ==
            state.admitted_attributes &&
        load_le<std::uint32_t>(view.bytes + proto::kSrcOffset) == state.node.value() &&
        view.bytes[proto::kLaneOffset] != static_cast<std::byte>(proto::Lane::real_time)) {
      return Admission::data;
    }
    return look_at(state, run, view, now_ms);
  }

 private:
  [[nodiscard]] Admission look_at(IngressState& state, std::byte* run, proto::RunView& view,
                                  std::uint64_t now_ms);
  /// Counts the hop in each frame that goes on.
  [[nodiscard]] static Admission look_at_link(IngressState& state, std::byte* run,
                                              proto::RunView& view);
  [[nodiscard]] static Admission check_parts(IngressState& state, const proto::FrameHeader& header,
                                             proto::RunView& view, proto::Origin origin);
  [[nodiscard]] Admission check(IngressState& state, const proto::FrameHeader& header,
                                proto::RunView& view);
  [[nodiscard]] static Admission check_report(IngressState& state, const proto::RunView& view);
  [[nodiscard]] static Admission check_request(IngressState& state,
                                               const proto::FrameHeader& header,
                                               const proto::RunView& view, proto::Origin origin);
  /// Are the frames to be moved to lane 1?
  [[nodiscard]] bool spend_lane0(IngressState& state, std::uint64_t bytes, std::uint64_t now_ms);
  [[nodiscard]] bool moves_fragment(IngressState& state, const proto::RunView& view,
                                    std::uint64_t now_ms);
  [[nodiscard]] std::uint64_t lane0_window_bytes() const;
  void limit_lane0(IngressState& state, std::byte* run, const proto::RunView& view,
                   std::uint64_t now_ms);

  const Limits& limits_;
  Tally& tally_;
};

}  // namespace gimnet::hub
