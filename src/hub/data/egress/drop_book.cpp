#include "hub/data/egress/drop_book.hpp"

#include <algorithm>
#include <bit>
#include <cstring>
#include <utility>

namespace gimnet::hub {

void DropBook::drop(const std::byte* start, std::uint32_t frames, proto::DropReason reason) {
  tally_.drop(reason, frames);
  if (wants_report(proto::load_header(start))) remember(start, frames, reason);
}

void DropBook::drop_mixed(const std::byte* first, std::uint32_t size, proto::DropReason reason) {
  for (std::uint32_t done = 0; done < size;) {
    const auto frame = static_cast<std::uint32_t>(proto::load_header(first + done).frame_size());
    drop(first + done, 1, reason);
    done += frame;
  }
}

void DropBook::remember(const std::byte* frame, std::uint32_t frames, proto::DropReason reason) {
  const proto::FrameHeader header = proto::load_header(frame);
  Note* note = find(subject_of(header, reason));
  if (note == nullptr) {
    if (notes_.size() == notes_max_) return;
    note = &notes_.emplace_back();
    note->sender = NodeId{header.src};
    note->reason = reason;
    note->last = header;
    if (heads_.empty()) heads_.resize(std::bit_ceil(notes_max_));
    link(static_cast<std::uint32_t>(notes_.size()));
  }
  note->count += frames;
  note->last = header;
  note->following_size =
      static_cast<std::uint8_t>(std::min<std::size_t>(header.length, proto::kReportFollowingMax));
  std::memcpy(note->following, frame + proto::kHeaderSize, note->following_size);
}

DropBook::Subject DropBook::subject_of(const proto::FrameHeader& header, proto::DropReason reason) {
  const bool by_group = reason == proto::DropReason::not_retained;
  return {NodeId{header.src}, reason, by_group ? header.dst : 0};
}

DropBook::Note* DropBook::find(const Subject& subject) {
  if (notes_.empty()) return nullptr;
  for (std::uint32_t number = heads_[place_of(subject)]; number != 0;
       number = notes_[number - 1].next) {
    Note& note = notes_[number - 1];
    if (subject_of(note.last, note.reason) == subject) return &note;
  }
  return nullptr;
}

std::size_t DropBook::place_of(const Subject& subject) const {
  // Neighbouring ids, as those of nodes that joined together, have places of their own; so have a
  // node's reasons and groups.
  return (subject.sender.value() + subject.group * std::size_t{31} +
          static_cast<std::size_t>(subject.reason) * 0x9E3779B1u) &
         (heads_.size() - 1);
}

void DropBook::link(std::uint32_t number) {
  Note& note = notes_[number - 1];
  std::uint32_t& head = heads_[place_of(subject_of(note.last, note.reason))];
  note.next = std::exchange(head, number);
}

void DropBook::link_all() {
  std::fill(heads_.begin(), heads_.end(), 0u);
  for (std::uint32_t number = 1; number <= notes_.size(); ++number) link(number);
}

std::size_t DropBook::encode(const Note& note,
                             std::span<std::byte, proto::kReportSizeMax> payload) {
  return proto::encode_report(
      {note.reason, note.count, note.last, std::span(note.following, note.following_size)},
      payload);
}

}  // namespace gimnet::hub
