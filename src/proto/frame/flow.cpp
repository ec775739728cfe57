#include "proto/frame/flow.hpp"

#include <cstring>

#include "base/endian.hpp"

namespace gimnet::proto::flow {
namespace {

constexpr std::size_t kTargetSize = 8;
constexpr std::size_t kCountSize = 16;
constexpr std::size_t kPingSize = 16;
constexpr std::size_t kPongSize = 24;

/// 0: not an operation.
constexpr std::size_t size_of(FlowOperation operation) {
  switch (operation) {
    case FlowOperation::ping:
      return kPingSize;
    case FlowOperation::pong:
      return kPongSize;
    case FlowOperation::credit:
    case FlowOperation::confirm:
    case FlowOperation::skip:
    case FlowOperation::dropped:
    case FlowOperation::missed:
      return kCountSize;
    case FlowOperation::pause:
    case FlowOperation::resume:
      return kTargetSize;
  }
  return 0;
}

std::optional<Target> load_target(const std::byte* bytes) {
  const auto lane = static_cast<std::uint8_t>(bytes[2]);
  if (lane >= kLaneCount) return std::nullopt;
  return Target{static_cast<Kind>(bytes[1]), static_cast<Lane>(lane),
                load_le<std::uint32_t>(bytes + 4)};
}

void store_target(std::byte* bytes, const Target& target) {
  bytes[1] = static_cast<std::byte>(target.kind);
  bytes[2] = static_cast<std::byte>(target.lane);
  store_le(bytes + 4, target.dst);
}

DropReason known_reason(std::byte reason) {
  const auto value = static_cast<std::uint8_t>(reason);
  return value < kDropReasonCount ? static_cast<DropReason>(value) : DropReason::none;
}

/// The operation's byte and the zeros behind it.
void store_operation(std::byte* bytes, FlowOperation operation, std::size_t size) {
  std::memset(bytes, 0, size);
  bytes[0] = static_cast<std::byte>(operation);
}

struct PayloadEncoder {
  std::byte* bytes;

  std::size_t operator()(const Ping& ping) const {
    store_operation(bytes, FlowOperation::ping, kPingSize);
    store_le(bytes + 4, ping.sequence);
    store_le(bytes + 8, ping.sent_ns);
    return kPingSize;
  }
  std::size_t operator()(const Pong& pong) const {
    store_operation(bytes, FlowOperation::pong, kPongSize);
    store_le(bytes + 4, pong.sequence);
    store_le(bytes + 8, pong.sent_ns);
    store_le(bytes + 16, pong.now_ns);
    return kPongSize;
  }
  std::size_t operator()(const Credit& credit) const {
    store_operation(bytes, FlowOperation::credit, kCountSize);
    bytes[1] = static_cast<std::byte>(credit.number);
    store_le(bytes + 4, credit.group.value());
    store_le(bytes + 8, credit.taken);
    return kCountSize;
  }
  std::size_t operator()(const Pause& pause) const {
    store_operation(bytes, FlowOperation::pause, kTargetSize);
    store_target(bytes, pause.target);
    return kTargetSize;
  }
  std::size_t operator()(const Resume& resume) const {
    store_operation(bytes, FlowOperation::resume, kTargetSize);
    store_target(bytes, resume.target);
    return kTargetSize;
  }
  std::size_t operator()(const Confirm& confirm) const {
    store_operation(bytes, FlowOperation::confirm, kCountSize);
    store_le(bytes + 8, confirm.count);
    return kCountSize;
  }
  std::size_t operator()(const Skip& skip) const {
    store_operation(bytes, FlowOperation::skip, kCountSize);
    bytes[1] = static_cast<std::byte>(skip.reason);
    store_le(bytes + 8, skip.count);
    return kCountSize;
  }
  std::size_t operator()(const Dropped& dropped) const {
    store_operation(bytes, FlowOperation::dropped, kCountSize);
    bytes[1] = static_cast<std::byte>(dropped.reason);
    store_le(bytes + 4, dropped.source.value());
    store_le(bytes + 8, dropped.count);
    return kCountSize;
  }
  std::size_t operator()(const Missed& missed) const {
    store_operation(bytes, FlowOperation::missed, kCountSize);
    store_le(bytes + 4, missed.group.value());
    store_le(bytes + 8, missed.total);
    return kCountSize;
  }
};

}  // namespace

std::optional<Message> decode(std::span<const std::byte> payload) {
  if (payload.empty()) return std::nullopt;
  const auto operation = static_cast<FlowOperation>(payload[0]);
  const std::size_t size = size_of(operation);
  if (size == 0 || payload.size() < size) return std::nullopt;
  const std::byte* bytes = payload.data();
  switch (operation) {
    case FlowOperation::ping:
      return Ping{load_le<std::uint32_t>(bytes + 4), load_le<std::int64_t>(bytes + 8)};
    case FlowOperation::pong:
      return Pong{load_le<std::uint32_t>(bytes + 4), load_le<std::int64_t>(bytes + 8),
                  load_le<std::int64_t>(bytes + 16)};
    case FlowOperation::credit:
      return Credit{GroupId{load_le<std::uint32_t>(bytes + 4)}, load_le<std::uint64_t>(bytes + 8),
                    static_cast<std::uint8_t>(bytes[1])};
    case FlowOperation::pause:
      if (const auto target = load_target(bytes)) return Pause{*target};
      return std::nullopt;
    case FlowOperation::resume:
      if (const auto target = load_target(bytes)) return Resume{*target};
      return std::nullopt;
    case FlowOperation::confirm:
      return Confirm{load_le<std::uint64_t>(bytes + 8)};
    case FlowOperation::skip:
      return Skip{known_reason(bytes[1]), load_le<std::uint64_t>(bytes + 8)};
    case FlowOperation::dropped:
      return Dropped{known_reason(bytes[1]), NodeId{load_le<std::uint32_t>(bytes + 4)},
                     load_le<std::uint64_t>(bytes + 8)};
    case FlowOperation::missed:
      return Missed{GroupId{load_le<std::uint32_t>(bytes + 4)}, load_le<std::uint64_t>(bytes + 8)};
  }
  return std::nullopt;
}

std::size_t encode(const Message& message, std::span<std::byte, kSizeMax> payload) {
  return std::visit(PayloadEncoder{payload.data()}, message);
}

std::size_t encode_frame(const Message& message, NodeId src,
                         std::span<std::byte, kFrameSizeMax> frame) {
  const std::size_t size = encode(message, frame.subspan<kHeaderSize, kSizeMax>());
  FrameHeader header;
  header.length = static_cast<std::uint32_t>(size);
  header.src = src.value();
  header.kind = Kind::flow;
  header.lane = static_cast<std::uint8_t>(Lane::real_time);
  store_header(frame.data(), header);
  return kHeaderSize + size;
}

}  // namespace gimnet::proto::flow
