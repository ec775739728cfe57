#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>

#include "generator/wire.hpp"

// What the wires of the other hubs share: they know neither recipients nor lists, only topics.
// Every client subscribes to a topic of its own, under which it is addressed, and the group of a
// run is one more topic.

namespace gimnet::perf {

inline constexpr std::string_view kGroupTopic = "g";

[[nodiscard]] inline std::string topic_of(const Client& client) {
  return "n" + std::to_string(client.index());
}

/// Ends the program for a list or a broadcast, which these hubs do not have.
[[nodiscard]] std::string topic_of(const Target& target);

[[nodiscard]] inline std::string_view as_text(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}
[[nodiscard]] inline std::span<const std::byte> as_bytes(std::string_view text) {
  return {reinterpret_cast<const std::byte*>(text.data()), text.size()};
}
inline void append(std::span<const std::byte> bytes, std::vector<std::byte>& to) {
  to.insert(to.end(), bytes.begin(), bytes.end());
}
inline void append(std::string_view text, std::vector<std::byte>& to) {
  append(as_bytes(text), to);
}

/// Appends a message whose payload is one piece between `head` and `tail`.
inline void append_around(std::string_view head, std::span<const std::byte> payload,
                          std::string_view tail, StreamId stream, MessageBlock& block) {
  append(head, block.bytes);
  block.mark_stamp(block.bytes.size(), stream);
  append(payload, block.bytes);
  append(tail, block.bytes);
  block.mark_end();
}

}  // namespace gimnet::perf
