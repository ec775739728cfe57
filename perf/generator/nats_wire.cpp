#include "generator/nats_wire.hpp"

#include <charconv>
#include <string>

#include "generator/topic.hpp"
#include "net/socket.hpp"

namespace gimnet::perf {
namespace {

constexpr std::string_view kLineEnd = "\r\n";
constexpr std::string_view kConnect =
    "CONNECT "
    "{\"verbose\":false,\"pedantic\":false,\"tls_required\":false,\"name\":\"\",\"lang\":\"raw\","
    "\"version\":\"1\",\"protocol\":1}\r\n";

/// The last word of `MSG subject sid [reply-to] bytes`.
std::size_t payload_size(std::string_view line) {
  const std::string_view word = line.substr(line.rfind(' ') + 1);
  std::size_t size = 0;
  if (std::from_chars(word.data(), word.data() + word.size(), size).ec != std::errc{})
    fail("a MSG without a size");
  return size;
}

}  // namespace

void NatsWire::open(Client& client) {
  client.write_control(
      as_bytes(std::string{kConnect} + "SUB " + topic_of(client) + " 1\r\nPING\r\n"));
}

void NatsWire::subscribe(Client& client) {
  client.write_control(as_bytes("SUB " + std::string{kGroupTopic} + " 2\r\nPING\r\n"));
}

void NatsWire::append_message(const Client&, const Target& target, std::uint8_t,
                              std::span<const std::byte> payload, MessageBlock& block) {
  append_around("PUB " + topic_of(target) + " " + std::to_string(payload.size()) + "\r\n", payload,
                kLineEnd, target.stream, block);
}

std::size_t NatsWire::take(Client& client, std::span<const std::byte> bytes) {
  const std::string_view text = as_text(bytes);
  std::size_t at = 0;
  for (;;) {
    const std::size_t end = text.find('\n', at);
    if (end == std::string_view::npos) return at;
    const std::string_view line = text.substr(at, end - at - 1);  // without CR and LF
    const std::size_t body = end + 1;
    if (!line.starts_with("MSG ")) {
      take_line(client, line);
      at = body;
      continue;
    }
    const std::size_t size = payload_size(line);
    if (bytes.size() - body < size + kLineEnd.size()) return at;
    client.inbox.on_message(bytes.subspan(body, size));
    if (text.substr(body + size, kLineEnd.size()) != kLineEnd) client.inbox.on_wrong();
    at = body + size + kLineEnd.size();
  }
}

void NatsWire::take_line(Client& client, std::string_view line) {
  if (line == "PONG") {
    if (client.is_joined) client.is_in_group = true;
    admit(client);
  } else if (line == "PING") {
    client.write_control(as_bytes("PONG\r\n"));
  } else if (line.starts_with("-ERR")) {
    fail("nats-server refused: " + std::string{line});
  } else if (!line.starts_with("INFO ") && line != "+OK") {
    client.inbox.on_wrong();
  }
}

}  // namespace gimnet::perf
