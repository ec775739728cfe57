#include "hub/data/egress/pause_book.hpp"

#include <algorithm>

namespace gimnet::hub {

std::uint64_t PauseBook::on_full(NodeId sender, const proto::flow::Target& target,
                                 std::uint32_t bytes, bool past_reserve, SenderSignals& signals) {
  auto note = std::find_if(notes_.begin(), notes_.end(), [&](const Note& each) {
    return each.sender == sender && each.target == target;
  });
  if (note == notes_.end()) {
    note = notes_.insert(notes_.end(), Note{sender, target});
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

void PauseBook::on_room(proto::Lane lane, SenderSignals& signals) {
  std::erase_if(notes_, [&](Note& note) {
    if (note.target.lane != lane) return false;
    let_go(note, signals);
    return true;
  });
}

void PauseBook::release_all(SenderSignals& signals) {
  for (Note& note : notes_) let_go(note, signals);
  notes_.clear();
}

void PauseBook::let_go(Note& note, SenderSignals& signals) {
  signals.resume(note.sender, note.target);
  if (note.held) signals.release(note.sender);
}

}  // namespace gimnet::hub
