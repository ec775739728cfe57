#include "generator/resp_wire.hpp"

#include <charconv>
#include <initializer_list>
#include <string>

#include "generator/topic.hpp"
#include "net/socket.hpp"

namespace gimnet::perf {
namespace {

constexpr std::string_view kLineEnd = "\r\n";
constexpr std::string_view kMessage = ">3\r\n$7\r\nmessage\r\n";
constexpr std::string_view kSubscribed = ">3\r\n$9\r\nsubscribe\r\n";

std::string bulk_head(std::size_t size) { return "$" + std::to_string(size) + "\r\n"; }

std::string command(std::initializer_list<std::string_view> words) {
  std::string text = "*" + std::to_string(words.size()) + "\r\n";
  for (const std::string_view word : words)
    text += bulk_head(word.size()) + std::string{word} + "\r\n";
  return text;
}

std::size_t number_in(std::string_view digits) {
  std::size_t number = 0;
  if (std::from_chars(digits.data(), digits.data() + digits.size(), number).ec != std::errc{})
    fail("a bad RESP size");
  return number;
}

struct Bulk {
  std::size_t begin;
  std::size_t size;
  [[nodiscard]] std::size_t end() const { return begin + size + kLineEnd.size(); }
};

/// The `$` string at `at`; nothing while bytes are missing.
std::optional<Bulk> find_bulk(std::string_view text, std::size_t at) {
  const std::size_t line_end = text.find('\n', at);
  if (line_end == std::string_view::npos) return std::nullopt;
  if (text[at] != '$') fail("a RESP message of an unknown form arrived");
  const Bulk bulk{line_end + 1, number_in(text.substr(at + 1, line_end - at - 2))};
  return bulk.end() <= text.size() ? std::optional(bulk) : std::nullopt;
}

/// Where the value that begins at `at` ends; nothing while bytes are missing.
std::optional<std::size_t> value_end(std::string_view text, std::size_t at) {
  // Values still to come, instead of a call into itself for each nested one.
  for (std::size_t open = 1; open > 0; --open) {
    const std::size_t line_end = text.find('\n', at);
    if (line_end == std::string_view::npos) return std::nullopt;
    const char type = text[at];
    const std::string_view rest = text.substr(at + 1, line_end - at - 2);
    at = line_end + 1;
    if (type == '$') {
      at += number_in(rest) + kLineEnd.size();
      if (at > text.size()) return std::nullopt;
    } else if (type == '*' || type == '>' || type == '~') {
      open += number_in(rest);
    } else if (type == '%') {
      open += 2 * number_in(rest);
    }
  }
  return at;
}

}  // namespace

void RespWire::open(Client& client) {
  client.write_control(as_bytes(command({"HELLO", "3"}) + command({"SUBSCRIBE", topic_of(client)}) +
                                command({"CLIENT", "REPLY", "OFF"})));
}

void RespWire::subscribe(Client& client) {
  client.write_control(as_bytes(command({"SUBSCRIBE", kGroupTopic})));
}

void RespWire::append_message(const Client&, const Target& target, std::uint8_t,
                              std::span<const std::byte> payload, MessageBlock& block) {
  const std::string topic = topic_of(target);
  const std::string head = "*3\r\n$7\r\nPUBLISH\r\n" + bulk_head(topic.size()) + topic + "\r\n";
  append_around(head + bulk_head(payload.size()), payload, kLineEnd, target.stream, block);
}

std::size_t RespWire::take(Client& client, std::span<const std::byte> bytes) {
  const std::string_view text = as_text(bytes);
  std::size_t at = 0;
  while (at < text.size()) {
    const std::string_view rest = text.substr(at);
    if (rest.starts_with(kMessage)) {
      const std::size_t size = take_message(client, rest);
      if (size == 0) break;
      at += size;
      continue;
    }
    const auto end = value_end(text, at);
    if (!end) break;
    take_other(client, text.substr(at, *end - at));
    at = *end;
  }
  return at;
}

std::size_t RespWire::take_message(Client& client, std::string_view text) {
  const auto channel = find_bulk(text, kMessage.size());
  if (!channel) return 0;
  const auto payload = find_bulk(text, channel->end());
  if (!payload) return 0;
  client.inbox.on_message(as_bytes(text.substr(payload->begin, payload->size)));
  return payload->end();
}

void RespWire::take_other(Client& client, std::string_view value) {
  if (value.starts_with('-'))
    fail("redis-server refused: " + std::string{value.substr(1, value.size() - 3)});
  if (!value.starts_with(kSubscribed)) return;
  client.is_joined ? static_cast<void>(client.is_in_group = true) : admit(client);
}

}  // namespace gimnet::perf
