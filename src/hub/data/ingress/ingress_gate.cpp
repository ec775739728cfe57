#include "hub/data/ingress/ingress_gate.hpp"

#include <algorithm>

namespace gimnet::hub {
namespace {

/// A node that used up its share of lane 0 gets it back after so long below it.
constexpr std::uint64_t kDemotionMs = 1'000;
constexpr std::uint64_t kLane0WindowMs = 100;

Admission refuse(IngressState& state, proto::FrameError error) {
  state.error = error;
  return Admission::malformed;
}

void write_source(std::byte* run, const proto::RunView& view, std::uint32_t source) {
  for (std::uint32_t done = 0; done < view.size;) {
    const auto frame = static_cast<std::uint32_t>(proto::load_header(run + done).frame_size());
    store_le(run + done + IngressGate::kSourceOffset, source);
    done += frame;
  }
}

bool is_former(const IngressState& state, NodeId source) {
  return std::find(state.former_nodes.begin(), state.former_nodes.end(), source) != state.former_nodes.end();
}

/// Shortens the run to the frames before the first that has no room for its key.
void keep_frames_with_key(proto::RunView& view) {
  std::uint32_t size = 0;
  for (std::uint32_t frame = 0; frame < view.frames; ++frame) {
    const proto::FrameHeader header = proto::load_header(view.bytes + size);
    if (header.length < sizeof(std::uint64_t)) {
      view.size = size;
      view.frames = frame;
      return;
    }
    size += static_cast<std::uint32_t>(header.frame_size());
  }
}

}  // namespace

Admission IngressGate::look_at(IngressState& state, std::byte* run, proto::RunView& view, std::uint64_t now_ms) {
  proto::FrameHeader header = proto::load_header(view.bytes);
  const auto attributes = load_le<std::uint32_t>(view.bytes + kAttributesOffset);
#if defined(GIMNET_BUG_GATE_REMEMBERS_THE_SOURCE)
  if (attributes != state.admitted_attributes) {
#else
  if (attributes != state.admitted_attributes || header.src != state.node.value()) {
#endif
    if (is_former(state, NodeId{header.src})) {
      header.src = state.node.value();
      write_source(run, view, header.src);
    }
    if (const Admission refused = check(state, header, view); refused != Admission::data) return refused;
    const bool plain = proto::may_form_run(header) && !header.has(proto::kFlagKeyed);
    state.admitted_attributes = plain ? attributes : IngressState::kNoneAdmitted;
  }
  if (header.lane == static_cast<std::uint8_t>(proto::Lane::real_time)) limit_lane0(state, run, view, now_ms);
  return Admission::data;
}

Admission IngressGate::check(IngressState& state, const proto::FrameHeader& header, proto::RunView& view) {
  const proto::FrameError error = proto::check_header_from_node(header);
  if (error != proto::FrameError::none) return refuse(state, error);
  const bool own = header.src == state.node.value();
  const bool unnamed_allowed = header.kind == proto::Kind::flow || header.kind == proto::Kind::link;
  if (!own && !(unnamed_allowed && header.src == 0)) return Admission::wrong_source;
  if (header.kind == proto::Kind::link) return Admission::link;
  if (static_cast<std::uint8_t>(header.kind) >= proto::kFirstControlKind) return Admission::control;
  if (header.kind == proto::Kind::flow) return Admission::flow;
  if (proto::may_form_run(header)) {
    if (header.has(proto::kFlagKeyed)) keep_frames_with_key(view);
    return view.frames != 0 ? Admission::data : refuse(state, proto::FrameError::key_too_short);
  }
  const auto frame = proto::parse_frame({view.bytes, view.size}, proto::Origin::node);
  return frame ? Admission::data : refuse(state, frame.error());
}

/// A message is moved whole or not at all: its recipient puts together what came in one lane.
bool IngressGate::follows_to_lane1(IngressState& state, const proto::RunView& view, bool demoting) {
  const auto frame = proto::parse_frame({view.bytes, view.size}, proto::Origin::node);
  if (!frame || !frame->fragment) return demoting;
  const proto::FragmentHeader& fragment = *frame->fragment;
  const auto begin = state.demoted_messages.begin();
  const auto end = begin + state.demoted_message_count;
  const auto known = std::find(begin, end, fragment.message);
  const bool last = fragment.offset + frame->payload.size() == fragment.total;
  if (fragment.offset == 0) {
    const bool demote = demoting && state.demoted_message_count < state.demoted_messages.size();
    if (demote && !last && known == end) state.demoted_messages[state.demoted_message_count++] = fragment.message;
    return demote;
  }
  if (known == end) return false;
  if (last) {
    *known = *(end - 1);
    --state.demoted_message_count;
  }
  return true;
}

void IngressGate::limit_lane0(IngressState& state, std::byte* run, const proto::RunView& view, std::uint64_t now_ms) {
  if (now_ms >= state.lane0_since_ms + kLane0WindowMs) {
    state.lane0_since_ms = now_ms;
    state.lane0_bytes = 0;
  }
  state.lane0_bytes += view.size;
  if (state.lane0_bytes > limits_.lane0_bytes_per_s * kLane0WindowMs / 1'000) {
    state.demoted_until_ms = now_ms + kDemotionMs;
  }
  bool demote = now_ms < state.demoted_until_ms;
  if (proto::load_header(view.bytes).has(proto::kFlagFragment)) demote = follows_to_lane1(state, view, demote);
  if (!demote) return;
  for (std::uint32_t done = 0; done < view.size;) {
    const auto frame = static_cast<std::uint32_t>(proto::load_header(run + done).frame_size());
    run[done + kLaneOffset] = static_cast<std::byte>(proto::Lane::normal);
    done += frame;
  }
  tally_.lane0_demoted += view.frames;
}

}  // namespace gimnet::hub
