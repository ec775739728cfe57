#include "client/nif/group_moves.hpp"

namespace gimnet::nif {

void GroupMoves::begin() {
  for (Waiting& waiting : waiting_) waiting.moved = false;
}

void GroupMoves::add(const Move& move) {
  for (Waiting& waiting : waiting_) {
    if (waiting.moved || move.former == 0 || waiting.message->parts().header.dst != move.former)
      continue;
    waiting.message->redirect(move.now);
    waiting.moved = true;
  }
  last_.erase(move.now);
  if (move.reused || move.former == 0 || move.former == move.now) return;
  std::erase_if(last_, [&](const auto& entry) { return entry.second == move.former; });
  last_[move.former] = move.now;
}

void GroupMoves::forget(std::uint32_t group) {
  last_.erase(group);
  std::erase_if(last_, [group](const auto& entry) { return entry.second == group; });
}

GroupMoves::Turn::~Turn() {
  std::erase_if(moves_.waiting_,
                [this](const Waiting& waiting) { return waiting.message == &message_; });
}

void GroupMoves::redirect_known(Outgoing& message) const {
  const auto moved = last_.find(message.parts().header.dst);
  if (moved != last_.end() && moved->second != 0) message.redirect(moved->second);
}

bool GroupMoves::refuses(std::uint32_t group) const {
  if (group == 0) return true;
  if (last_.empty()) return false;
  const auto moved = last_.find(group);
  return moved != last_.end() && moved->second == 0;
}

}  // namespace gimnet::nif
