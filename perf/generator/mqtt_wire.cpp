#include "generator/mqtt_wire.hpp"

#include <optional>
#include <string>

#include "generator/topic.hpp"
#include "net/socket.hpp"

namespace gimnet::perf {
namespace {

// Section 2.2 of the standard: type << 4 | flags.
constexpr std::uint8_t kConnect = 0x10;
constexpr std::uint8_t kConnack = 0x20;
constexpr std::uint8_t kPublish = 0x30;
constexpr std::uint8_t kSubscribe = 0x82;
constexpr std::uint8_t kSuback = 0x90;
constexpr std::uint8_t kCleanSession = 0x02;
constexpr std::uint16_t kKeepAliveSeconds = 3600;
constexpr std::uint16_t kOwnPacketId = 1;
constexpr std::uint16_t kGroupPacketId = 2;
constexpr std::size_t kLengthBytesMax = 4;

std::string u16(std::size_t value) {
  return {static_cast<char>(value >> 8), static_cast<char>(value & 0xFF)};
}

std::string text_field(std::string_view text) { return u16(text.size()) + std::string{text}; }

/// Head byte and "remaining length", 7 bits a byte, low ones first.
std::string packet_head(std::uint8_t head, std::size_t length) {
  std::string bytes(1, static_cast<char>(head));
  do {
    const std::size_t low = length & 0x7F;
    length >>= 7;
    bytes.push_back(static_cast<char>(low | (length > 0 ? 0x80 : 0)));
  } while (length > 0);
  return bytes;
}

std::string packet(std::uint8_t head, const std::string& body) {
  return packet_head(head, body.size()) + body;
}

std::string subscribe_packet(std::uint16_t id, std::string_view topic) {
  return packet(kSubscribe, u16(id) + text_field(topic) + std::string(1, '\0'));
}

std::uint8_t byte_at(std::span<const std::byte> bytes, std::size_t at) {
  return std::to_integer<std::uint8_t>(bytes[at]);
}

struct Frame {
  std::size_t body_at;
  std::size_t length;
};

/// Nothing while bytes are missing.
std::optional<Frame> find_packet(std::span<const std::byte> bytes) {
  std::size_t length = 0;
  for (std::size_t count = 0; count < kLengthBytesMax; ++count) {
    if (bytes.size() < 2 + count) return std::nullopt;
    const std::size_t digit = byte_at(bytes, 1 + count);
    length |= (digit & 0x7F) << (7 * count);
    if ((digit & 0x80) != 0) continue;
    if (bytes.size() - 2 - count < length) return std::nullopt;
    return Frame{2 + count, length};
  }
  fail("an MQTT packet with an impossible length arrived");
}

}  // namespace

void MqttWire::open(Client& client) {
  const std::string body =
      text_field("MQTT") + std::string{'\x04', static_cast<char>(kCleanSession)} +
      u16(kKeepAliveSeconds) + text_field("c" + std::to_string(client.index()));
  client.write_control(
      as_bytes(packet(kConnect, body) + subscribe_packet(kOwnPacketId, topic_of(client))));
}

void MqttWire::subscribe(Client& client) {
  client.write_control(as_bytes(subscribe_packet(kGroupPacketId, kGroupTopic)));
}

void MqttWire::append_message(const Client&, const Target& target, std::uint8_t,
                              std::span<const std::byte> payload, MessageBlock& block) {
  const std::string topic = text_field(topic_of(target));
  append_around(packet_head(kPublish, topic.size() + payload.size()) + topic, payload, {},
                target.stream, block);
}

std::size_t MqttWire::take(Client& client, std::span<const std::byte> bytes) {
  std::size_t at = 0;
  while (const auto frame = find_packet(bytes.subspan(at))) {
    take_packet(client, byte_at(bytes, at), bytes.subspan(at + frame->body_at, frame->length));
    at += frame->body_at + frame->length;
  }
  return at;
}

void MqttWire::take_packet(Client& client, std::uint8_t head, std::span<const std::byte> body) {
  if (head == kPublish && body.size() >= 2) {
    const std::size_t topic_bytes = std::size_t{byte_at(body, 0)} << 8 | byte_at(body, 1);
    if (body.size() < 2 + topic_bytes) return client.inbox.on_wrong();
    client.inbox.on_message(body.subspan(2 + topic_bytes));
  } else if (head == kConnack && body.size() == 2) {
    if (byte_at(body, 1) != 0)
      fail("the MQTT hub refused with code " + std::to_string(byte_at(body, 1)));
  } else if (head == kSuback && body.size() == 3) {
    if (byte_at(body, 2) != 0) fail("the MQTT hub refused a subscription");
    byte_at(body, 1) == kOwnPacketId ? admit(client) : static_cast<void>(client.is_in_group = true);
  } else {
    client.inbox.on_wrong();
  }
}

}  // namespace gimnet::perf
