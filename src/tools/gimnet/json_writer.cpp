#include "tools/gimnet/json_writer.hpp"

#include <array>
#include <cmath>
#include <cstdio>

#include "proto/bitestream/utf8.hpp"
#include "tools/gimnet/table.hpp"

namespace gimnet::tool {
namespace {

constexpr std::string_view kHexDigits = "0123456789abcdef";

/// The code point of a control character in UTF-8 of up to three bytes.
unsigned code_point(std::string_view letter) {
  const auto byte = [letter](std::size_t i) { return static_cast<unsigned char>(letter[i]); };
  if (letter.size() == 1) return byte(0);
  if (letter.size() == 2) return (byte(0) & 0x1FU) << 6 | (byte(1) & 0x3FU);
  return (byte(0) & 0x0FU) << 12 | (byte(1) & 0x3FU) << 6 | (byte(2) & 0x3FU);
}

bool is_utf8(std::string_view text) {
  return proto::bitestream::valid_utf8(reinterpret_cast<const unsigned char*>(text.data()),
                                       text.size());
}

}  // namespace

void JsonWriter::separate() {
  if (!first_) json_ += ',';
  first_ = false;
}

JsonWriter& JsonWriter::open(char bracket) {
  separate();
  json_ += bracket;
  first_ = true;
  return *this;
}

JsonWriter& JsonWriter::close(char bracket) {
  json_ += bracket;
  first_ = false;
  return *this;
}

JsonWriter& JsonWriter::literal(std::string_view text) {
  separate();
  json_ += text;
  return *this;
}

JsonWriter& JsonWriter::key(std::string_view name) {
  separate();
  quote(name);
  json_ += ':';
  first_ = true;
  return *this;
}

JsonWriter& JsonWriter::text(std::string_view value) {
  separate();
  quote(value);
  return *this;
}

JsonWriter& JsonWriter::boolean(bool value) { return literal(value ? "true" : "false"); }

JsonWriter& JsonWriter::number(double value) {
  if (!std::isfinite(value)) return literal("null");
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.3f", value);
  return literal(text.data());
}

JsonWriter& JsonWriter::bytes_member(const std::string& name, std::span<const std::byte> bytes) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (is_utf8(text)) return member(name, text);
  std::string hex;
  hex.reserve(2 * bytes.size());
  for (const std::byte byte : bytes) {
    hex += kHexDigits[std::to_integer<std::size_t>(byte >> 4)];
    hex += kHexDigits[std::to_integer<std::size_t>(byte & std::byte{15})];
  }
  return member(name + "_hex", hex);
}

void JsonWriter::escape(unsigned code) {
  json_ += "\\u";
  for (int shift = 12; shift >= 0; shift -= 4) json_ += kHexDigits[code >> shift & 15U];
}

void JsonWriter::quote(std::string_view text) {
  const bool clean = is_utf8(text);
  json_ += '"';
  while (!text.empty()) {
    const char letter = text.front();
    const auto code = static_cast<unsigned char>(letter);
    std::size_t size = 1;
    if (letter == '"' || letter == '\\') {
      json_ += '\\';
      json_ += letter;
    } else if (letter == '\n') {
      json_ += "\\n";
    } else if (code >= 0x80 && !clean) {
      json_ += "\\ufffd";
    } else if (const std::size_t control = control_size(text); control != 0) {
      escape(code_point(text.substr(0, control)));
      size = control;
    } else {
      json_ += letter;
    }
    text.remove_prefix(size);
  }
  json_ += '"';
}

const char* direction_of(const ServiceRecord& service) {
  if (service.answers()) return "answers";
  return service.direction == Direction::accepts ? "accepts" : "provides";
}
std::string delivery_of(const ServiceRecord& service) {
  if (service.delivery == Delivery::sync) return "sync:" + std::to_string(service.window);
  return service.delivery == Delivery::latest ? "latest" : "stream";
}

void write(JsonWriter& json, const NodeRecord& node, std::optional<std::string_view> state) {
  json.begin_object().member("id", node.node.text()).member("name", node.name);
  json.member("hub", node.hub_name)
      .member("hub_id", node.hub_id)
      .member("connected", node.connected);
  if (state) json.member("state", *state);
  json.member("description", node.description).member("place", node.place);
  json.member("joined_ms", node.joined_ms).member("services", node.services).end_object();
}

void write(JsonWriter& json, const ServiceRecord& service, std::optional<Provider> provider) {
  json.begin_object().member("name", service.name).member("node", service.node.text());
  json.member("type", service.key.type).member("instance", service.key.instance);
  json.member("direction", direction_of(service)).member("delivery", delivery_of(service));
  json.member("retain", service.retain);
  json.member("group", service.group_id).member("subscribers", service.subscribers);
  json.member("metadata", service.metadata).member("hub", service.hub_name);
  if (provider) {
    json.member("missed", service.missed);
    if (service.missed != 0) json.member("missed_most", service.missed_most.text());
    json.member("place", provider->place).member("state", provider->state);
  }
  json.end_object();
}

}  // namespace gimnet::tool
