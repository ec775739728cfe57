#include "client/nif/outgoing.hpp"

#include <algorithm>
#include <cstring>
#include <string>

#include "base/endian.hpp"
#include "client/nif/pause_table.hpp"
#include "client/nif/sized_struct.hpp"
#include "proto/frame/fragmenter.hpp"
#include "proto/gimi/message_header.hpp"

namespace gimnet::nif {
namespace {

constexpr std::uint8_t kKnownFlags =
    NIF_FLAG_REPORT | NIF_FLAG_KEYED | NIF_FLAG_MORE | NIF_FLAG_NOT_WHILE_AWAY;
/// Less than a TRACE can have (proto::kTraceSlotsMax).
constexpr std::uint8_t kOwnTraceSlotsMax = 8;
static_assert(kOwnTraceSlotsMax <= proto::kTraceSlotsMax);

static_assert(NIF_MESSAGE_BYTES_MAX == proto::kMessageBytesMax);
static_assert(NIF_LIST_RECIPIENTS_MAX == proto::kListRecipientsMax);

Failure bad(const char* why) { return {NIF_BAD_ARGUMENT, std::string("cannot send: ") + why}; }

std::optional<Failure> check_fields(const nif_outgoing& message) {
  if (message.kind > NIF_SERVICE) return bad("kind is not a nif_kind");
  if (message.lane > NIF_BACKGROUND) return bad("lane is not a nif_lane");
  if (message.policy > NIF_LATEST) return bad("policy is not a nif_policy");
  if ((message.flags & ~kKnownFlags) != 0) return bad("flags has unknown bits");
  if (message.trace_slots > kOwnTraceSlotsMax) return bad("trace_slots is over 8");
  const bool to_one = message.kind == NIF_UNICAST || message.kind == NIF_SERVICE;
  if (message.policy == NIF_BLOCK && !to_one) return bad("BLOCK is for UNICAST and SERVICE only");
  if (message.policy == NIF_LATEST && to_one && (message.flags & NIF_FLAG_KEYED) == 0) {
    return bad("LATEST on UNICAST and SERVICE needs a key");
  }
  if (message.part_count > NIF_PARTS_MAX) return bad("more than 64 parts");
  if (message.part_count > 0 && message.parts == nullptr) return bad("parts is NULL");
  return std::nullopt;
}

}  // namespace

std::optional<Failure> Outgoing::read_address(const nif_outgoing& message) {
  parts_.header.dst = message.to;
  if (message.kind == NIF_UNICAST && index_of(NodeId{message.to}) == kEveryIndex) {
    return bad("that id stands for every node: use BROADCAST");
  }
  if (message.kind == NIF_BROADCAST && index_of(NodeId{message.to}) != kEveryIndex) {
    return bad("a BROADCAST goes to hub << 20 | 0xFFFFF or NIF_EVERY_NODE");
  }
  if (message.kind == NIF_LIST) {
    if (message.recipient_count == 0 || message.recipient_count > NIF_LIST_RECIPIENTS_MAX) {
      return bad("a LIST has 1 to 1,024 recipients");
    }
    if (message.recipients == nullptr) return bad("recipients is NULL");
    for (std::size_t i = 0; i < message.recipient_count; ++i)
      recipients_.emplace_back(message.recipients[i]);
    std::sort(recipients_.begin(), recipients_.end());
    recipients_.erase(std::unique(recipients_.begin(), recipients_.end()), recipients_.end());
    parts_.recipients = recipients_;
    parts_.header.dst = 0;
  }
  stream_ = stream_code(parts_.header.kind, parts_.header.lane, parts_.header.dst);
  return std::nullopt;
}

std::optional<Failure> Outgoing::read_payload(const nif_outgoing& message) {
  payload_ = {message.parts, message.part_count};
  std::size_t size = 0;
  for (const nif_bytes& part : payload_) {
    if (part.size > 0 && part.data == nullptr) return bad("a part with a size has no data");
    if (part.size > NIF_MESSAGE_BYTES_MAX - size) {
      return Failure{NIF_TOO_LARGE, "cannot send: the message is larger than 1 GiB"};
    }
    size += part.size;
  }
  size_ = static_cast<std::uint32_t>(size);
  return std::nullopt;
}

void Outgoing::read_extensions(const nif_outgoing& message, HubClock* clock) {
  proto::ExtensionWriter writer(extensions_);
  // 8 TRACE slots and an AGE take 212 bytes: there is room.
  if (message.age_ms_max != 0) {
    const auto hub_ns = clock == nullptr ? std::nullopt : clock->hub_time(steady_now_ns());
    static_cast<void>(writer.add_age({hub_ns.value_or(wall_now_ns()), message.age_ms_max}));
  }
  if (message.trace_slots != 0) static_cast<void>(writer.add_trace(message.trace_slots));
  parts_.extensions = writer.written();
}

std::optional<Failure> Outgoing::read(const nif_outgoing& given, HubClock* clock) {
  nif_outgoing whole;
  const nif_outgoing* known = &given;
  if (auto failure = read_struct(known, whole, "send", "nif_outgoing")) return failure;
  const nif_outgoing& message = *known;
  if (auto failure = check_fields(message)) return failure;
  parts_.header.kind = static_cast<proto::Kind>(message.kind);
  parts_.header.lane = message.lane;
  parts_.header.flags = message.policy;
  if ((message.flags & NIF_FLAG_REPORT) != 0) parts_.header.flags |= proto::kFlagReport;
  if ((message.flags & NIF_FLAG_KEYED) != 0) parts_.key = message.key;
  more_ = (message.flags & NIF_FLAG_MORE) != 0;
  not_while_away_ = (message.flags & NIF_FLAG_NOT_WHILE_AWAY) != 0;
  if (auto failure = read_address(message)) return failure;
  if (auto failure = read_payload(message)) return failure;
  if (message.age_ms_max != 0 || message.trace_slots != 0) read_extensions(message, clock);
  return std::nullopt;
}

std::uint32_t Outgoing::application_bytes() {
  std::array<std::byte, proto::gimi::kMessageHeaderSize> start;
  const auto bytes = std::min(size_, static_cast<std::uint32_t>(start.size()));
  copy_payload(start.data(), 0, bytes);
  return proto::gimi::application_bytes(parts_.key.has_value(), std::span(start).first(bytes),
                                        size_);
}

void Outgoing::redirect(std::uint32_t dst) {
  parts_.header.dst = dst;
  stream_ = stream_code(parts_.header.kind, parts_.header.lane, dst);
}

bool Outgoing::replaceable() const {
  return parts_.header.policy() == proto::Policy::latest &&
         parts_.header.kind != proto::Kind::list && size_ <= proto::kUncutMessageMax;
}

std::unique_ptr<Outgoing> Outgoing::copy_rest(std::uint32_t offset) {
  auto copy = std::make_unique<Outgoing>();
  copy->parts_ = parts_;
  copy->recipients_ = recipients_;
  copy->parts_.recipients = copy->recipients_;
  copy->extensions_ = extensions_;
  copy->parts_.extensions = std::span(copy->extensions_).first(parts_.extensions.size());
  copy->rest_.resize(size_ - offset);
  copy_payload(copy->rest_.data(), offset, size_ - offset);
  copy->rest_part_ = {copy->rest_.data(), copy->rest_.size()};
  copy->payload_ = {&copy->rest_part_, 1};
  copy->part_offset_ = offset;
  copy->size_ = size_;
  copy->stream_ = stream_;
  return copy;
}

/// Pieces are asked for in order, so the search goes on where the last one ended.
void Outgoing::copy_payload(std::byte* to, std::uint32_t offset, std::uint32_t bytes) {
  if (offset < part_offset_) {
    part_ = 0;
    part_offset_ = 0;
  }
  while (bytes > 0) {
    const nif_bytes& part = payload_[part_];
    if (offset >= part_offset_ + part.size) {
      part_offset_ += part.size;
      ++part_;
      continue;
    }
    const std::size_t from = offset - part_offset_;
    const auto count = static_cast<std::uint32_t>(std::min<std::size_t>(part.size - from, bytes));
    std::memcpy(to, static_cast<const std::byte*>(part.data) + from, count);
    to += count;
    offset += count;
    bytes -= count;
  }
}

void Outgoing::write_frame(std::span<std::byte> frame, std::uint32_t src,
                           std::optional<proto::FragmentHeader> fragment, std::uint32_t offset,
                           std::uint32_t piece_size, bool report) {
  proto::FrameParts parts = parts_;
  parts.header.src = src;
  parts.fragment = fragment;
  parts.payload_size = piece_size;
  if (report) parts.header.flags |= proto::kFlagReport;
  const std::size_t prefix = proto::write_prefix(parts, frame);
  copy_payload(frame.data() + prefix, offset, piece_size);
}

void Outgoing::write_start(std::span<std::byte> start) {
  if (parts_.key) {
    store_le(start.data(), *parts_.key);
    start = start.subspan(sizeof *parts_.key);
  }
  copy_payload(start.data(), 0, static_cast<std::uint32_t>(start.size()));
}

}  // namespace gimnet::nif
