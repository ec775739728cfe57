#include "generator/zmtp_wire.hpp"

#include <optional>
#include <string>

#include "generator/topic.hpp"
#include "net/socket.hpp"

namespace gimnet::perf {
namespace {

constexpr std::size_t kGreetingBytes = 64;
constexpr std::uint8_t kMore = 1;
constexpr std::uint8_t kLong = 2;
constexpr std::uint8_t kCommand = 4;
constexpr std::size_t kShortBytesMax = 255;
constexpr char kSubscribe = 1;

// Topics are matched by their beginning, so all have one length: what it is, and the client's
// index.
constexpr std::size_t kTopicBytes = 3;
constexpr char kOwn = 'n';
constexpr char kMarker = 's';

std::string topic(char what, std::size_t index) {
  return {what, static_cast<char>(index >> 8), static_cast<char>(index & 0xFF)};
}

std::string zmtp_topic_of(const Target& target) {
  if (target.kind == Target::Kind::unicast) return topic(kOwn, target.recipients.front()->index());
  return topic(topic_of(target).front(), 0);
}

std::string frame_head(std::uint8_t flags, std::size_t size) {
  if (size <= kShortBytesMax) return {static_cast<char>(flags), static_cast<char>(size)};
  std::string bytes(1, static_cast<char>(flags | kLong));
  for (int shift = 56; shift >= 0; shift -= 8)
    bytes.push_back(static_cast<char>(size >> shift & 0xFF));
  return bytes;
}

/// Signature, version 3.0, mechanism NULL, client; then READY with the socket's type.
std::string greeting(const std::string& socket_type) {
  std::string bytes =
      std::string{'\xFF'} + std::string(8, '\0') + "\x7F\x03" + std::string(1, '\0') + "NULL";
  bytes.resize(kGreetingBytes, '\0');
  const std::string ready = std::string{"\x05READY\x0BSocket-Type"} + std::string(3, '\0') +
                            static_cast<char>(socket_type.size()) + socket_type;
  return bytes + frame_head(kCommand, ready.size()) + ready;
}

std::string subscription(const std::string& to) {
  return frame_head(0, 1 + to.size()) + std::string(1, kSubscribe) + to;
}

std::uint8_t byte_at(std::span<const std::byte> bytes, std::size_t at) {
  return std::to_integer<std::uint8_t>(bytes[at]);
}

struct Frame {
  std::size_t body_at;
  std::size_t size;
};

/// Nothing while bytes are missing.
std::optional<Frame> find_frame(std::span<const std::byte> bytes) {
  if (bytes.size() < 2) return std::nullopt;
  Frame frame{2, byte_at(bytes, 1)};
  if ((byte_at(bytes, 0) & kLong) != 0) {
    frame = {9, 0};
    if (bytes.size() < frame.body_at) return std::nullopt;
    for (std::size_t at = 1; at < frame.body_at; ++at)
      frame.size = frame.size << 8 | byte_at(bytes, at);
  }
  return bytes.size() - frame.body_at >= frame.size ? std::optional(frame) : std::nullopt;
}

}  // namespace

ZmtpWire::Session& ZmtpWire::session_of(const Client& client) {
  if (client.index() >= sessions_.size()) sessions_.resize(client.index() + 1);
  return sessions_[client.index()];
}

void ZmtpWire::open(Client& client) {
  session_of(client).client = &client;
  client.write_control(as_bytes(greeting("SUB")));
}

void ZmtpWire::open_side(Client& side) { side.write_control(as_bytes(greeting("PUB"))); }

void ZmtpWire::subscribe(Client& client) {
  client.write_control(as_bytes(subscription(topic(kGroupTopic.front(), 0)) +
                                subscription(topic(kMarker, client.index()))));
}

void ZmtpWire::append_message(const Client&, const Target& target, std::uint8_t,
                              std::span<const std::byte> payload, MessageBlock& block) {
  append_around(frame_head(0, kTopicBytes + payload.size()) + zmtp_topic_of(target), payload, {},
                target.stream, block);
}

std::size_t ZmtpWire::take(Client& client, std::span<const std::byte> bytes) {
  Session& session = session_of(client);
  bool& is_greeted = client.is_side ? session.is_side_greeted : session.is_greeted;
  std::size_t at = 0;
  if (!is_greeted) {
    if (bytes.size() < kGreetingBytes) return 0;
    is_greeted = true;
    at = kGreetingBytes;
  }
  while (const auto frame = find_frame(bytes.subspan(at))) {
    const std::uint8_t flags = byte_at(bytes, at);
    const auto body = bytes.subspan(at + frame->body_at, frame->size);
    at += frame->body_at + frame->size;
    if ((flags & kCommand) != 0) {
      take_command(client, body);
    } else if (client.is_side) {
      take_subscription(body);
    } else if ((flags & kMore) != 0 || body.size() < kTopicBytes) {
      client.inbox.on_wrong();
    } else {
      client.inbox.on_message(body.subspan(kTopicBytes));
    }
  }
  return at;
}

void ZmtpWire::take_command(Client& client, std::span<const std::byte> body) {
  const std::string_view text = as_text(body);
  if (text.starts_with("\x05"
                       "ERROR"))
    fail("the proxy refused: " + std::string{text.substr(7)});
  if (!text.starts_with("\x05READY")) return;
  if (client.is_side) return admit(client);
  // Not before: libzmq takes what comes during its handshake for a part of that.
  client.write_control(as_bytes(subscription(topic(kOwn, client.index()))));
}

void ZmtpWire::take_subscription(std::span<const std::byte> body) {
  if (body.size() != 1 + kTopicBytes || byte_at(body, 0) != kSubscribe) return;
  const std::size_t index = std::size_t{byte_at(body, 2)} << 8 | byte_at(body, 3);
  if (index >= sessions_.size() || sessions_[index].client == nullptr) return;
  Client& subscriber = *sessions_[index].client;
  const char what = as_text(body)[1];
  if (what == kOwn) admit(subscriber);
  if (what == kMarker) subscriber.is_in_group = true;
}

}  // namespace gimnet::perf
