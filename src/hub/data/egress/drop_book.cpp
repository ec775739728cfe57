#include "hub/data/egress/drop_book.hpp"

#include <algorithm>
#include <cstring>

namespace gimnet::hub {

void DropBook::drop(const std::byte* first, std::uint32_t size, std::uint32_t frames, proto::DropReason reason) {
  tally_.drop(reason, frames);
  const proto::FrameHeader header = proto::load_header(first);
  if (!header.has(proto::kFlagReport) || header.kind == proto::Kind::report) return;
  const std::byte* last = first;
  for (const std::byte* next = first; next < first + size; next += proto::load_header(next).frame_size()) last = next;
  remember(last, frames, reason);
}

void DropBook::drop_mixed(const std::byte* first, std::uint32_t size, proto::DropReason reason) {
  for (std::uint32_t done = 0; done < size;) {
    const auto frame = static_cast<std::uint32_t>(proto::load_header(first + done).frame_size());
    drop(first + done, frame, 1, reason);
    done += frame;
  }
}

void DropBook::remember(const std::byte* frame, std::uint32_t frames, proto::DropReason reason) {
  const proto::FrameHeader header = proto::load_header(frame);
  const NodeId sender{header.src};
  auto note = std::find_if(notes_.begin(), notes_.end(),
                           [&](const Note& each) { return each.sender == sender && each.reason == reason; });
  if (note == notes_.end()) {
    if (notes_.size() == notes_max_) return;
    note = notes_.emplace(notes_.end());
    note->sender = sender;
    note->reason = reason;
  }
  note->count += frames;
  note->last = header;
  note->following_size = static_cast<std::uint8_t>(std::min<std::size_t>(header.length, proto::kReportFollowingMax));
  std::memcpy(note->following, frame + proto::kHeaderSize, note->following_size);
}

std::size_t DropBook::encode(const Note& note, std::span<std::byte, proto::kReportSizeMax> payload) {
  return proto::encode_report({note.reason, note.count, note.last, std::span(note.following, note.following_size)},
                              payload);
}

}  // namespace gimnet::hub
