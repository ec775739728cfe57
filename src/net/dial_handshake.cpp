#include "net/dial_handshake.hpp"

#include <algorithm>
#include <utility>

#include "proto/frame/frame_builder.hpp"
#include "proto/frame/frame_parser.hpp"

namespace gimnet::net {
namespace {

std::vector<std::byte> link_frame(const proto::Payload& payload) {
  proto::FrameParts parts;
  parts.header.kind = proto::Kind::link;
  parts.header.lane = static_cast<std::uint8_t>(proto::Lane::real_time);
  std::vector<std::byte> frame(proto::kHeaderSize + payload.size());
  static_cast<void>(proto::write_frame(parts, payload, frame));
  return frame;
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

DialHandshake::State DialHandshake::fail(Fault fault, std::string sentence) {
  error_ = {fault, std::move(sentence)};
  return State::failed;
}

std::size_t DialHandshake::missing() const {
  if (taken_ == 0) return proto::kOpeningSize - bytes_.size();
  const std::size_t has = bytes_.size() - taken_;
  if (has < proto::kHeaderSize) return proto::kHeaderSize - has;
  return proto::load_header(bytes_.data() + taken_).frame_size() - has;
}

DialHandshake::State DialHandshake::take(std::span<const std::byte> bytes) {
  bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
  if (taken_ == 0) {
    if (const State opening = take_opening(); opening != State::welcome) return opening;
  }
  const std::span<const std::byte> rest = std::span(bytes_).subspan(taken_);
  if (rest.size() < proto::kHeaderSize) return State::need_more;
  const proto::FrameHeader header = proto::load_header(rest.data());
  if (header.kind != proto::Kind::link || header.flags != 0) {
    return fail(Fault::protocol,
                "the peer answered HELLO with something else than WELCOME; is it a hub?");
  }
  if (header.length > kAnswerBytesMax)
    return fail(Fault::protocol, "the peer's answer to HELLO is too long");
  if (rest.size() < header.frame_size()) return State::need_more;
  taken_ += header.frame_size();
  return take_frame(rest.subspan(proto::kHeaderSize, header.length));
}

/// `welcome` here: the opening is whole and right.
DialHandshake::State DialHandshake::take_opening() {
  switch (proto::check_opening(bytes_)) {
    case proto::Opening::need_more:
      return State::need_more;
    case proto::Opening::other_protocol:
      return fail(Fault::protocol, "the peer does not speak GIMnet; is it a hub?");
    case proto::Opening::bad_version:
      return fail(Fault::bad_version, "the hub speaks version " + major_of(bytes_) +
                                          " of the protocol, this program version " +
                                          major_of(proto::kOpening) +
                                          "; use a program of the hub's version");
    case proto::Opening::accepted:
      break;
  }
  taken_ = proto::kOpeningSize;
  return State::welcome;
}

DialHandshake::State DialHandshake::take_frame(std::span<const std::byte> payload) {
  const auto control = proto::split_control(payload);
  if (!control) return fail(Fault::protocol, "the peer's answer to HELLO has no operation");
  if (control->header.operation == proto::Goodbye::kOperation) {
    auto goodbye = proto::decode<proto::Goodbye>(payload);
    if (!goodbye)
      return fail(Fault::protocol, "cannot read the hub's GOODBYE: " + goodbye.error().sentence);
    goodbye_ = std::move(*goodbye);
    return State::goodbye;
  }
  auto welcome = proto::decode<proto::Welcome>(payload);
  if (!welcome)
    return fail(Fault::protocol,
                "cannot read the hub's WELCOME: " + welcome.error().sentence + "; is it a hub?");
  welcome_ = std::move(*welcome);
  return State::welcome;
}

}  // namespace gimnet::net
