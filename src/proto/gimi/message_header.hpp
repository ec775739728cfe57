#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

// The header of GIMI messages: the first bytes of the payload of a KEYED frame (docs/protocol.md,
// section 7). Thread safety: value types and pure functions.

namespace gimnet::proto::gimi {

inline constexpr std::size_t kMessageHeaderSize = 12;
inline constexpr std::size_t kTimestampSize = 8;
inline constexpr std::size_t kAckSize = 12;
inline constexpr std::size_t kAckSizeMax = 16;
inline constexpr std::size_t kPingTimeSize = 8;
inline constexpr std::size_t kErrorStatusSize = 2;

/// The frame's key: which queue of the receiver a message belongs to.
struct StreamKey {
  std::uint32_t type = 0;
  std::uint32_t instance = 0;

  [[nodiscard]] constexpr std::uint64_t value() const {
    return type | (static_cast<std::uint64_t>(instance) << 32);
  }
  [[nodiscard]] static constexpr StreamKey of(std::uint64_t key) {
    return {static_cast<std::uint32_t>(key), static_cast<std::uint32_t>(key >> 32)};
  }
  friend constexpr bool operator==(const StreamKey&, const StreamKey&) = default;
};

enum class MessageOperation : std::uint8_t {
  data = 0,
  ack = 1,
  request = 2,
  reply = 3,
  error = 4,
  ping = 5,
  pong = 6
};

inline constexpr std::uint8_t kFlagAckWanted = 0x01;
inline constexpr std::uint8_t kFlagTimestamp = 0x02;

/// On the wire: epoch, sequence, operation, flags, extension_bytes.
struct MessageHeader {
  std::uint32_t sequence = 0;
  MessageOperation operation = MessageOperation::data;
  std::uint8_t flags = 0;
  std::uint16_t extension_bytes = 0;
  /// Of the sending stream; of an answer that of the message that it answers.
  std::uint32_t epoch = 0;
  [[nodiscard]] constexpr bool has(std::uint8_t flag) const { return (flags & flag) != 0; }
  friend constexpr bool operator==(const MessageHeader&, const MessageHeader&) = default;
};

/// REQUIRES: 12 readable bytes.
[[nodiscard]] MessageHeader load_message_header(const std::byte* bytes);
/// REQUIRES: 12 writable bytes.
void store_message_header(std::byte* bytes, const MessageHeader& header);

/// A message taken apart. Valid until: its bytes change.
struct MessageView {
  MessageHeader header;
  std::optional<std::int64_t> timestamp_ns;  ///< since 1970, where the flag is set
  std::span<const std::byte> extension;      ///< all of it, the time stamp included
  std::span<const std::byte> data;
};

/// Nothing: shorter than its header or extension, an unknown operation, or a time stamp flag
/// without 8 bytes.
[[nodiscard]] std::optional<MessageView> parse_message(std::span<const std::byte> payload);

/// Bytes of the application in a message of `size` bytes, of which `start` is the beginning: all
/// but the GIMI header and its extension, which a KEYED message has, and the time of a REQUEST.
[[nodiscard]] std::uint32_t application_bytes(bool keyed, std::span<const std::byte> start,
                                              std::uint32_t size);

/// The bytes before the data: the header and, if `timestamp_ns` is given, an extension with it.
/// Sets the flag and `extension_bytes` of the header. Returns the size, 12 or 20.
inline constexpr std::size_t kMessagePrefixMax = kMessageHeaderSize + kTimestampSize;
std::size_t write_message_prefix(MessageHeader header, std::optional<std::int64_t> timestamp_ns,
                                 std::span<std::byte, kMessagePrefixMax> bytes);

/// Data of ACK. The header's sequence is the highest DATA sequence taken.
struct Ack {
  std::uint64_t bitmap = 0;         ///< bit i: sequence - 1 - i was taken too
  std::uint32_t pong_sequence = 0;  ///< of the PONG that this repeats an ACK for, or 0
  std::uint32_t group =
      0;  ///< of the service that the stream leads to; 0 and not written: to a node
  friend constexpr bool operator==(const Ack&, const Ack&) = default;
};
/// Nothing: too short. Bytes after the layout are skipped.
[[nodiscard]] std::optional<Ack> decode_ack(std::span<const std::byte> data);
/// Returns the size, kAckSize or kAckSizeMax.
std::size_t encode_ack(const Ack& ack, std::span<std::byte, kAckSizeMax> data);

/// Data of ERROR. Valid until: its bytes change.
struct ErrorData {
  std::uint16_t status = 0;
  std::string_view sentence;
  std::uint32_t group =
      0;  ///< of the service that the stream leads to; 0 and not written: to a node
};
/// In the status as written: a group id follows it.
inline constexpr std::uint16_t kErrorGroupBit = 0x8000;
/// Nothing: too short.
[[nodiscard]] std::optional<ErrorData> decode_error(std::span<const std::byte> data);
[[nodiscard]] std::vector<std::byte> encode_error(const ErrorData& failure);

}  // namespace gimnet::proto::gimi
