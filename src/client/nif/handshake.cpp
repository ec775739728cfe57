#include "client/nif/handshake.hpp"

#include <algorithm>
#include <utility>

#include "base/ids.hpp"
#include "proto/frame/frame_builder.hpp"
#include "proto/frame/frame_parser.hpp"

namespace gimnet::nif {
namespace {

/// Smaller frames than this no hub has reason to ask for; LIST ids and extensions need room.
constexpr std::uint32_t kFrameLengthMin = 16 * 1024;
constexpr std::uint32_t kKeepAliveMsDefault = 1'000;
constexpr std::uint32_t kSilentMsDefault = 3'000;
constexpr std::uint32_t kKeepAliveMsMin = 10;
constexpr std::uint32_t kKeepAliveMsMax = 60'000;

std::vector<std::byte> link_frame(const proto::Payload& payload) {
  proto::FrameParts parts;
  parts.header.kind = proto::Kind::link;
  parts.header.lane = static_cast<std::uint8_t>(proto::Lane::real_time);
  std::vector<std::byte> frame(proto::kHeaderSize + payload.size());
  static_cast<void>(proto::write_frame(parts, payload, frame));
  return frame;
}

std::int64_t milliseconds(std::uint32_t value, std::uint32_t fallback) {
  return std::clamp(value == 0 ? fallback : value, kKeepAliveMsMin, kKeepAliveMsMax) * kNsPerMs;
}

/// REQUIRES: an opening at least up to its major version, the last byte but one.
std::string major_of(std::span<const std::byte> opening) {
  return std::to_string(std::to_integer<unsigned>(opening[proto::kOpeningSize - 2]));
}

}  // namespace

std::vector<std::byte> encode_hello(const proto::Hello& hello) {
  const std::vector<std::byte> frame = link_frame(proto::encode(hello));
  std::vector<std::byte> bytes(proto::kOpeningSize + frame.size());
  std::copy(frame.begin(), frame.end(),
            std::copy(proto::kOpening.begin(), proto::kOpening.end(), bytes.begin()));
  return bytes;
}

std::vector<std::byte> encode_goodbye(proto::GoodbyeCode code, std::string sentence) {
  return link_frame(proto::encode(proto::Goodbye{code, std::move(sentence)}));
}

nif_status status_of(proto::GoodbyeCode code) {
  switch (code) {
    case proto::GoodbyeCode::bad_version:
      return NIF_BAD_VERSION;
    case proto::GoodbyeCode::name_taken:
      return NIF_NAME_TAKEN;
    case proto::GoodbyeCode::bad_name:
      return NIF_BAD_NAME;
    case proto::GoodbyeCode::hub_full:
    case proto::GoodbyeCode::no_memory:
      return NIF_HUB_FULL;
    case proto::GoodbyeCode::not_allowed:
      return NIF_DENIED;
    case proto::GoodbyeCode::replaced:
      return NIF_REPLACED;
    default:
      return NIF_REFUSED;
  }
}

Handshake::State Handshake::fail(nif_status status, std::string sentence) {
  failure_ = {status, std::move(sentence)};
  return State::failed;
}

Handshake::State Handshake::take(std::span<const std::byte> bytes) {
  bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
  if (taken_ == 0) {
    if (const State opening = take_opening(); opening != State::welcome) return opening;
  }
  const std::span<const std::byte> rest = std::span(bytes_).subspan(taken_);
  if (rest.size() < proto::kHeaderSize) return State::need_more;
  const proto::FrameHeader header = proto::load_header(rest.data());
  if (header.kind != proto::Kind::link || header.flags != 0) {
    return fail(NIF_PROTOCOL, "the peer answered HELLO with something else than WELCOME");
  }
  if (header.length > kAnswerBytesMax)
    return fail(NIF_PROTOCOL, "the peer's answer to HELLO is too long");
  if (rest.size() < header.frame_size()) return State::need_more;
  taken_ += header.frame_size();
  return take_frame(rest.subspan(proto::kHeaderSize, header.length));
}

/// `welcome` here: the opening is whole and right.
Handshake::State Handshake::take_opening() {
  switch (proto::check_opening(bytes_)) {
    case proto::Opening::need_more:
      return State::need_more;
    case proto::Opening::other_protocol:
      return fail(NIF_PROTOCOL, "the peer does not speak GIMnet; is it a hub?");
    case proto::Opening::bad_version:
      return fail(NIF_BAD_VERSION, "the hub speaks version " + major_of(bytes_) +
                                       " of the protocol, this program version " +
                                       major_of(proto::kOpening) +
                                       "; use a program of the hub's version");
    case proto::Opening::accepted:
      break;
  }
  taken_ = proto::kOpeningSize;
  return State::welcome;
}

Handshake::State Handshake::take_frame(std::span<const std::byte> payload) {
  const auto control = proto::split_control(payload);
  if (!control) return fail(NIF_PROTOCOL, "the peer's answer to HELLO has no operation");
  if (control->header.operation == proto::Goodbye::kOperation) {
    auto goodbye = proto::decode<proto::Goodbye>(payload);
    if (!goodbye)
      return fail(NIF_PROTOCOL, "cannot read the hub's GOODBYE: " + goodbye.error().sentence);
    goodbye_ = std::move(*goodbye);
    return State::goodbye;
  }
  const auto welcome = proto::decode<proto::Welcome>(payload);
  if (!welcome)
    return fail(NIF_PROTOCOL, "cannot read the hub's WELCOME: " + welcome.error().sentence);
  return take_welcome(*welcome);
}

Handshake::State Handshake::take_welcome(const proto::Welcome& welcome) {
  const std::uint32_t index = index_of(welcome.node);
  const HubId hub = hub_of(welcome.node);
  if (index == kHubIndex || index == kEveryIndex || hub == kOwnHub || hub == kEveryHub ||
      hub != welcome.hub) {
    return fail(NIF_PROTOCOL, "the hub's WELCOME gives an impossible node id");
  }
  if (welcome.token.empty() || welcome.token.size() > proto::kTokenBytesMax) {
    return fail(NIF_PROTOCOL, "the hub's WELCOME has no token");
  }
  if (welcome.frame_length_max < kFrameLengthMin) {
    return fail(NIF_PROTOCOL, "the hub's largest frame is smaller than 16 KiB");
  }
  session_.id = welcome.node.value();
  session_.hub_id = welcome.hub.value();
  session_.hub_name = welcome.hub_name;
  session_.name = welcome.name;
  session_.token = welcome.token;
  session_.hub_epoch = welcome.epoch;
  session_.frame_bytes_max = std::min(welcome.frame_length_max, proto::kFrameLengthDefault);
  session_.keep_alive_ns = milliseconds(welcome.keep_alive_ms, kKeepAliveMsDefault);
  session_.silent_after_ns =
      std::max(milliseconds(welcome.silent_ms, kSilentMsDefault), session_.keep_alive_ns * 2);
  session_.grace_ns = std::int64_t{welcome.grace_ms} * kNsPerMs;
  session_.hub_time_ns = welcome.hub_time_ns;
  session_.retained_bytes_max = welcome.retained_bytes_max;
  session_.resume = resume_ && welcome.resume_buffer_bytes > 0;
  session_.resumed = session_.resume && welcome.resumed && former_hub_epoch_ != 0;
  if (session_.resumed && welcome.epoch != former_hub_epoch_) {
    return fail(NIF_PROTOCOL, "the hub's WELCOME resumes another epoch than the one asked for");
  }
  session_.hub_taken = session_.resumed ? welcome.taken : 0;
  session_.hub_resume_bytes = welcome.resume_buffer_bytes;
  session_.earlier_goodbye.clear();
  if (!welcome.last_goodbye_sentence.empty()) {
    const auto code = static_cast<proto::GoodbyeCode>(welcome.last_goodbye_code);
    session_.earlier_goodbye = proto::goodbye_name(code) + (": " + welcome.last_goodbye_sentence);
  }
  return State::welcome;
}

}  // namespace gimnet::nif
