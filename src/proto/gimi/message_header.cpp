#include "proto/gimi/message_header.hpp"

#include <algorithm>

#include "base/endian.hpp"
#include "proto/gimi/request.hpp"

namespace gimnet::proto::gimi {

MessageHeader load_message_header(const std::byte* bytes) {
  return {load_le<std::uint32_t>(bytes + 4), static_cast<MessageOperation>(bytes[8]),
          static_cast<std::uint8_t>(bytes[9]), load_le<std::uint16_t>(bytes + 10),
          load_le<std::uint32_t>(bytes)};
}

void store_message_header(std::byte* bytes, const MessageHeader& header) {
  store_le(bytes, header.epoch);
  store_le(bytes + 4, header.sequence);
  bytes[8] = static_cast<std::byte>(header.operation);
  bytes[9] = static_cast<std::byte>(header.flags);
  store_le(bytes + 10, header.extension_bytes);
}

std::optional<MessageView> parse_message(std::span<const std::byte> payload) {
  if (payload.size() < kMessageHeaderSize) return std::nullopt;
  MessageView view;
  view.header = load_message_header(payload.data());
  if (view.header.operation > MessageOperation::pong) return std::nullopt;
  const auto rest = payload.subspan(kMessageHeaderSize);
  if (view.header.extension_bytes > rest.size()) return std::nullopt;
  view.extension = rest.first(view.header.extension_bytes);
  view.data = rest.subspan(view.header.extension_bytes);
  if (view.header.has(kFlagTimestamp)) {
    if (view.extension.size() < kTimestampSize) return std::nullopt;
    view.timestamp_ns = load_le<std::int64_t>(view.extension.data());
  }
  return view;
}

std::uint32_t application_bytes(bool keyed, std::span<const std::byte> start, std::uint32_t size) {
  if (!keyed || start.size() < kMessageHeaderSize) return size;
  const MessageHeader header = load_message_header(start.data());
  std::uint32_t prefix = static_cast<std::uint32_t>(kMessageHeaderSize) + header.extension_bytes;
  if (header.operation == MessageOperation::request) prefix += kRequestPrefix;
  return header.operation <= MessageOperation::pong && prefix <= size ? size - prefix : size;
}

std::size_t write_message_prefix(MessageHeader header, std::optional<std::int64_t> timestamp_ns,
                                 std::span<std::byte, kMessagePrefixMax> bytes) {
  header.extension_bytes = timestamp_ns ? kTimestampSize : 0;
  header.flags = static_cast<std::uint8_t>(timestamp_ns ? header.flags | kFlagTimestamp
                                                        : header.flags & ~kFlagTimestamp);
  store_message_header(bytes.data(), header);
  if (timestamp_ns) store_le(bytes.data() + kMessageHeaderSize, *timestamp_ns);
  return kMessageHeaderSize + header.extension_bytes;
}

std::optional<Ack> decode_ack(std::span<const std::byte> data) {
  if (data.size() < kAckSize) return std::nullopt;
  Ack ack{load_le<std::uint64_t>(data.data()), load_le<std::uint32_t>(data.data() + 8), 0};
  if (data.size() >= kAckSizeMax) ack.group = load_le<std::uint32_t>(data.data() + kAckSize);
  return ack;
}

std::size_t encode_ack(const Ack& ack, std::span<std::byte, kAckSizeMax> data) {
  store_le(data.data(), ack.bitmap);
  store_le(data.data() + 8, ack.pong_sequence);
  if (ack.group == 0) return kAckSize;
  store_le(data.data() + kAckSize, ack.group);
  return kAckSizeMax;
}

std::optional<ErrorData> decode_error(std::span<const std::byte> data) {
  if (data.size() < kErrorStatusSize) return std::nullopt;
  ErrorData failure;
  failure.status = load_le<std::uint16_t>(data.data());
  data = data.subspan(kErrorStatusSize);
  if ((failure.status & kErrorGroupBit) != 0) {
    if (data.size() < sizeof failure.group) return std::nullopt;
    failure.status ^= kErrorGroupBit;
    failure.group = load_le<std::uint32_t>(data.data());
    data = data.subspan(sizeof failure.group);
  }
  failure.sentence = {reinterpret_cast<const char*>(data.data()), data.size()};
  return failure;
}

std::vector<std::byte> encode_error(const ErrorData& failure) {
  const bool to_service = failure.group != 0;
  const std::size_t head = kErrorStatusSize + (to_service ? sizeof failure.group : 0);
  std::vector<std::byte> data(head + failure.sentence.size());
  store_le(data.data(),
           static_cast<std::uint16_t>(failure.status | (to_service ? kErrorGroupBit : 0)));
  if (to_service) store_le(data.data() + kErrorStatusSize, failure.group);
  std::ranges::copy(std::as_bytes(std::span(failure.sentence)),
                    data.begin() + static_cast<std::ptrdiff_t>(head));
  return data;
}

}  // namespace gimnet::proto::gimi
