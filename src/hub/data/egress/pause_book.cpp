#include "hub/data/egress/pause_book.hpp"

#include <algorithm>

#include "hub/data/egress/source_bytes.hpp"

namespace gimnet::hub {
bool PauseBook::ask(const proto::FrameHeader& header, std::uint32_t bytes, const Excess& excess,
                    EgressContext& context) {
  const NodeId sender{header.src};
  const auto lane = static_cast<proto::Lane>(header.lane & proto::kLaneMask);
  // A link is always read, so nobody behind it can be held; and it may name any source.
  const bool afar = hub_of(sender) != context.hub;
  std::uint64_t since_held = 0;
  if (!afar || notes_.size() < kPausedAfarMost) {
    since_held = on_full(sender, {header.kind, lane, header.dst}, bytes,
                         excess.bytes > excess.reserve, context.signals);
  }
  // Many senders may come at once: each is held, and loses nothing. What one of them had under way
  // by then was in its shard's mailbox to this one, or came with the reads before its shard heard
  // of the hold.
  const std::uint64_t reserves = kReservesMax * excess.reserve;
  const Limits& limits = context.limits;
  if (!afar) {
    const bool comes_though_held = since_held > limits.mailbox_bytes + limits.turn_bytes + reserves;
    return !comes_though_held || excess.bytes <= reserves;
  }
  // Three links of 1 Gbit/s with a round trip of 50 ms bring 19 MB until PAUSE works.
  return excess.bytes <= reserves || excess.held <= excess.held_most;
}

std::uint64_t PauseBook::on_full(NodeId sender, const proto::flow::Target& target,
                                 std::uint32_t bytes, bool past_reserve, SenderSignals& signals) {
  auto note = std::find_if(notes_.begin(), notes_.end(), [&](const Note& each) {
    return each.sender == sender && each.target == target;
  });
  if (note == notes_.end()) {
    note = notes_.insert(notes_.end(), Note{sender, target});
    places_[static_cast<std::size_t>(target.lane)] |= 1u << SourceBytes::place_of(sender);
    signals.pause(sender, target);
  } else if (note->bytes_since += bytes; note->bytes_since >= kRemindBytes) {
    note->bytes_since = 0;
    signals.pause(sender, target);
  }
  if (past_reserve && !note->held) {
    note->held = true;
    signals.hold(sender);
  }
  if (!note->held) return 0;
  return note->held_bytes += bytes;
}

void PauseBook::on_room(proto::Lane lane, std::uint32_t places, SenderSignals& signals) {
  std::uint32_t& paused = places_[static_cast<std::size_t>(lane)];
  if ((paused & places) == 0) return;
  paused &= ~places;
  std::erase_if(notes_, [&](Note& note) {
    const bool has_room = (places >> SourceBytes::place_of(note.sender) & 1) != 0;
    if (note.target.lane != lane || !has_room) return false;
    let_go(note, signals);
    return true;
  });
}

void PauseBook::say_again(SenderSignals& signals) const {
  for (const Note& note : notes_)
    if (hub_of(NodeId{note.target.dst}) != hub_of(note.sender))
      signals.pause(note.sender, note.target);
}

void PauseBook::release_all(SenderSignals& signals) {
  for (Note& note : notes_) let_go(note, signals);
  notes_.clear();
  places_ = {};
}

void PauseBook::let_go(Note& note, SenderSignals& signals) {
  signals.resume(note.sender, note.target);
  if (note.held) signals.release(note.sender);
}

}  // namespace gimnet::hub
