#include "hub/data/ingress/ingress_gate.hpp"

#include <algorithm>
#include <memory>

#include "proto/frame/report.hpp"

namespace gimnet::hub {
namespace {

/// A node that used up its share of lane 0 gets it back after so long below it.
constexpr std::uint64_t kDemotionMs = 1'000;
constexpr std::uint64_t kLane0WindowMs = 100;
/// A message that was counted when it began may be so much longer with the headers of its
/// fragments. Sent in smaller ones yet, the rest of it counts once more.
constexpr std::uint64_t kFrameBytesPerByte = 2;

Admission refuse(IngressState& state, proto::FrameError error) {
  state.error = error;
  return Admission::malformed;
}

/// Shortens the run to the frames before the first that has no room for its key.
void keep_frames_with_key(proto::RunView& view) {
  std::uint32_t size = 0;
  std::uint32_t last = 0;
  for (std::uint32_t frame = 0; frame < view.frames; ++frame) {
    const proto::FrameHeader header = proto::load_header(view.bytes + size);
    if (header.length < sizeof(std::uint64_t)) {
      view.size = size;
      view.frames = frame;
      view.last_bytes = last;
      return;
    }
    last = static_cast<std::uint32_t>(header.frame_size());
    size += last;
  }
}

}  // namespace

Admission IngressGate::look_at(IngressState& state, std::byte* run, proto::RunView& view,
                               std::uint64_t now_ms) {
  if (state.link != nullptr) return look_at_link(state, run, view);
  const proto::FrameHeader header = proto::load_header(view.bytes);
  const auto attributes = load_le<std::uint32_t>(view.bytes + proto::kAttributesOffset);
  if (attributes != state.admitted_attributes || header.src != state.node.value()) {
    if (const Admission refused = check(state, header, view); refused != Admission::data)
      return refused;
    if (proto::may_form_run(header) && !header.has(proto::kFlagKeyed))
      state.admitted_attributes = attributes;
  }
  if (header.lane == static_cast<std::uint8_t>(proto::Lane::real_time))
    limit_lane0(state, run, view, now_ms);
  return Admission::data;
}

Admission IngressGate::check(IngressState& state, const proto::FrameHeader& header,
                             proto::RunView& view) {
  const proto::FrameError error = proto::check_header_from_node(header);
  if (error != proto::FrameError::none) return refuse(state, error);
  const bool own = header.src == state.node.value();
  const bool unnamed_allowed = header.kind == proto::Kind::flow || header.kind == proto::Kind::link;
  if (!own && !(unnamed_allowed && header.src == 0)) return Admission::wrong_source;
  if (header.kind == proto::Kind::link) return Admission::link;
  if (static_cast<std::uint8_t>(header.kind) >= proto::kFirstControlKind)
    return check_request(state, header, view, proto::Origin::node);
  if (header.kind == proto::Kind::flow) return Admission::flow;
  return check_parts(state, header, view, proto::Origin::node);
}

Admission IngressGate::check_parts(IngressState& state, const proto::FrameHeader& header,
                                   proto::RunView& view, proto::Origin origin) {
  if (proto::may_form_run(header)) {
    if (header.has(proto::kFlagKeyed)) keep_frames_with_key(view);
    if (view.frames != 0) return Admission::data;
    // That frame alone: a link goes on behind it.
    view.size = view.last_bytes = static_cast<std::uint32_t>(header.frame_size());
    view.frames = 1;
    return refuse(state, proto::FrameError::key_too_short);
  }
  const auto frame = proto::parse_frame({view.bytes, view.size}, origin);
  return frame ? Admission::data : refuse(state, frame.error());
}

bool LinkRule::allows(HubId source) const {
  if (source == own || source == kOwnHub || source.value() > kHubIdMax) return false;
  return allow.empty() || std::ranges::binary_search(allow, source);
}

/// The rules for a node hold, but for hops, source and the kinds that hubs alone send.
Admission IngressGate::look_at_link(IngressState& state, std::byte* run, proto::RunView& view) {
  proto::FrameHeader header = proto::load_header(view.bytes);
  if (header.kind == proto::Kind::link) return Admission::link;
  if (header.kind == proto::Kind::route) return Admission::control;
  const std::uint8_t hops = std::exchange(header.hops, 0);
  const bool flow = header.kind == proto::Kind::flow;
  const bool report = header.kind == proto::Kind::report;
  const proto::FrameError error = flow || report ? proto::check_header_of_hub_word(header)
                                                 : proto::check_header_from_node(header);
  if (error != proto::FrameError::none) return refuse(state, error);
  if (flow) return Admission::flow;
  if (!state.link->allows(hub_of(NodeId{header.src}))) return Admission::wrong_source;
  if (report) return check_report(state, view);
  if (static_cast<std::uint8_t>(header.kind) >= proto::kFirstControlKind)
    return check_request(state, header, view, proto::Origin::hub);
  if (const Admission parts = check_parts(state, header, view, proto::Origin::hub);
      parts != Admission::data)
    return parts;
  if (hops >= proto::kHopsMax) return Admission::hop_limit;
  for (std::uint32_t done = 0; done < view.size;) {
    run[done + proto::kHopsOffset] = static_cast<std::byte>(hops + 1);
    done += static_cast<std::uint32_t>(proto::load_header(run + done).frame_size());
  }
  return Admission::data;
}

/// A library takes a REPORT for its hub's own word: one that it cannot read must not reach it.
Admission IngressGate::check_report(IngressState& state, const proto::RunView& view) {
  const bool whole = view.size >= proto::kHeaderSize + proto::kReportSizeMin;
  return whole ? Admission::report : refuse(state, proto::FrameError::report_too_short);
}

Admission IngressGate::check_request(IngressState& state, const proto::FrameHeader& header,
                                     const proto::RunView& view, proto::Origin origin) {
  if (!header.has(proto::kFlagExt)) return Admission::control;
  const auto frame = proto::parse_frame({view.bytes, view.size}, origin);
  return frame ? Admission::control : refuse(state, frame.error());
}

std::uint64_t IngressGate::lane0_window_bytes() const {
  return limits_.lane0_bytes_per_s * kLane0WindowMs / 1'000;
}

bool IngressGate::spend_lane0(IngressState& state, std::uint64_t bytes, std::uint64_t now_ms) {
  if (now_ms >= state.lane0_since_ms + kLane0WindowMs) {
    state.lane0_since_ms = now_ms;
    state.lane0_bytes = 0;
  }
  state.lane0_bytes += bytes;
  if (state.lane0_bytes > lane0_window_bytes()) state.demoted_until_ms = now_ms + kDemotionMs;
  return now_ms < state.demoted_until_ms;
}

/// A message is moved whole or not at all: its recipient puts together what came in one lane. So
/// all of it counts when it begins, and what comes of it then has been counted; of a message of
/// which no beginning is known each frame counts like any other. One that is too much by itself is
/// moved, and counts for nothing.
bool IngressGate::moves_fragment(IngressState& state, const proto::RunView& view,
                                 std::uint64_t now_ms) {
  const auto frame = proto::parse_frame({view.bytes, view.size}, proto::Origin::node);
  if (!frame || !frame->fragment) return spend_lane0(state, view.size, now_ms);
  const proto::FragmentHeader& fragment = *frame->fragment;
  const bool last = fragment.offset + frame->payload.size() == fragment.total;
  if (fragment.offset == 0) {
    const std::uint64_t all = fragment.total + (view.size - frame->payload.size());
    const bool moved = all > lane0_window_bytes() || spend_lane0(state, all, now_ms);
    if (last) return moved;
    if (!state.real_time_messages) state.real_time_messages = std::make_unique<RealTimeMessages>();
    state.real_time_messages->begin({.number = fragment.message,
                                     .known = true,
                                     .moved = moved,
                                     .left_bytes = kFrameBytesPerByte * all - view.size});
    return moved;
  }
  RealTimeMessages::Message* message =
      state.real_time_messages ? state.real_time_messages->find(fragment.message) : nullptr;
  if (message == nullptr) return spend_lane0(state, view.size, now_ms);
  if (message->moved) {
    message->known = !last;
    return true;
  }
  const bool counted = view.size <= message->left_bytes;
  if (counted) message->left_bytes -= view.size;
  message->known = counted && !last;
  return !counted && spend_lane0(state, view.size, now_ms);
}

void IngressGate::limit_lane0(IngressState& state, std::byte* run, const proto::RunView& view,
                              std::uint64_t now_ms) {
  const bool fragment = proto::load_header(view.bytes).has(proto::kFlagFragment);
  const bool moves =
      fragment ? moves_fragment(state, view, now_ms) : spend_lane0(state, view.size, now_ms);
  if (!moves) return;
  for (std::uint32_t done = 0; done < view.size;) {
    const auto frame = static_cast<std::uint32_t>(proto::load_header(run + done).frame_size());
    run[done + proto::kLaneOffset] = static_cast<std::byte>(proto::Lane::normal);
    done += frame;
  }
  tally_.lane0_demoted += view.frames;
}

}  // namespace gimnet::hub
