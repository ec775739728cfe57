#include "client/nif/frame_appender.hpp"

#include <algorithm>
#include <array>
#include <cstring>

#include "base/ids.hpp"
#include "proto/frame/extensions.hpp"
#include "proto/frame/frame_builder.hpp"
#include "proto/frame/taken.hpp"

namespace gimnet::nif {

void FrameAppender::put_frame(std::span<std::byte> memory, std::span<const std::byte> frame) const {
  proto::FrameHeader header = proto::load_header(frame.data());
  header.src = id_;
  std::memcpy(memory.data(), frame.data(), frame.size());
  proto::store_header(memory.data(), header);
}

void FrameAppender::append_control(std::span<const std::byte> frame) {
  put_frame(queue_.append_control(frame.size()), frame);
  appended_.add_urgent();  // before all messages
}

void FrameAppender::append_flow(const proto::flow::Message& message) {
  std::array<std::byte, proto::flow::kFrameSizeMax> frame;
  const std::size_t size = proto::flow::encode_frame(message, NodeId{0}, frame);
  append_control(std::span<const std::byte>(frame).first(size));
}

void FrameAppender::append_frame(std::span<const std::byte> frame) {
  put_frame(queue_.append(proto::load_header(frame.data()).lane, frame.size()), frame);
  appended_.add_urgent();
}

void FrameAppender::put(Outgoing& message, std::optional<proto::FragmentHeader> fragment,
                        std::uint32_t offset, std::uint32_t size, bool report) {
  const std::size_t bytes = frame_size(message, fragment.has_value(), size);
  const proto::FrameHeader& header = message.parts().header;
  const auto memory = memory_for(header, message.parts().key, message.replaceable(), bytes);
  message.write_frame(memory, id_, fragment, offset, size, report);
  if (header.lane == static_cast<std::uint8_t>(proto::Lane::real_time))
    appended_.add_urgent();
  else
    appended_.add(bytes);
}

/// Payload bytes of the largest frame with a prefix of that size.
std::uint32_t FrameAppender::room_behind(std::size_t prefix_size) const {
  return static_cast<std::uint32_t>(std::min<std::size_t>(
      proto::kFragmentPayload, frame_bytes_max_ - (prefix_size - proto::kHeaderSize)));
}

std::uint32_t FrameAppender::piece_max(const Outgoing& message) const {
  return room_behind(frame_size(message, true, 0));
}

void FrameAppender::append_piece(Outgoing& message, SendProgress& progress,
                                 proto::Fragmenter& fragmenter) {
  const proto::Piece piece = fragmenter.next(
      progress.windowed ? std::min(progress.window.room(), piece_max(message)) : UINT32_MAX);
  const proto::FragmentHeader fragment{progress.number, piece.offset, message.size()};
  put(message, fragment, piece.offset, piece.size, progress.windowed);
  if (progress.windowed) progress.window.on_sent(piece.size);
}

void FrameAppender::put_piece(const LastMessage& last, const proto::FrameParts& parts,
                              std::uint32_t offset) {
  const proto::FrameHeader& header = parts.header;
  const std::size_t bytes = proto::prefix_size(parts) + parts.payload_size;
  const bool replaceable =
      header.policy() == proto::Policy::latest && last.payload.size() <= proto::kUncutMessageMax;
  const auto memory = memory_for(header, parts.key, replaceable, bytes);
  const std::size_t prefix = proto::write_prefix(parts, memory);
  std::copy_n(last.payload.data() + offset, parts.payload_size, memory.data() + prefix);
  appended_.add(bytes);
}

void FrameAppender::append_last(const LastMessage& last) {
  proto::FrameParts parts = last.parts();
  parts.header.src = id_;
  parts.header.flags &=
      static_cast<std::uint8_t>(~proto::kFlagReport);  // it was asked for at its first sending
  const auto total = static_cast<std::uint32_t>(last.payload.size());
  std::uint32_t largest = proto::kUncutMessageMax;
  if (proto::needs_fragment_header(total))
    parts.fragment = proto::FragmentHeader{next_number(), 0, total};
  if (total > proto::kUncutMessageMax) largest = room_behind(proto::prefix_size(parts));
  std::uint32_t offset = 0;
  do {
    parts.payload_size = std::min(largest, total - offset);
    if (parts.fragment) parts.fragment->offset = offset;
    put_piece(last, parts, offset);
    offset += static_cast<std::uint32_t>(parts.payload_size);
  } while (offset < total);
}

void FrameAppender::append_probe(std::uint32_t receiver) {
  proto::FrameHeader header;
  header.length = proto::kTakenSize;
  header.dst = receiver;
  header.src = id_;
  header.kind = proto::Kind::taken;
  header.flags = proto::kFlagReport;
  header.lane = static_cast<std::uint8_t>(proto::Lane::real_time);
  const auto memory = queue_.append(header.lane, header.frame_size());
  proto::store_header(memory.data(), header);
  proto::encode_taken({}, memory.subspan<proto::kHeaderSize, proto::kTakenSize>());
  appended_.add_urgent();
}

}  // namespace gimnet::nif
