#include "client/nif/group_moves.hpp"

namespace gimnet::nif {

void GroupMoves::add(const SendQueue::GroupMap& moves) {
  for (auto& [former, now] : moves_) {
    if (const auto moved = moves.find(now); now != 0 && moved != moves.end()) now = moved->second;
  }
  for (const auto& [former, now] : moves) {
    if (former != now) moves_[former] = now;
  }
  for (const auto& [former, now] : moves) {
    if (now != 0) moves_.erase(now);
  }
}

void GroupMoves::forget(std::uint32_t group) {
  moves_.erase(group);
  std::erase_if(moves_, [group](const auto& entry) { return entry.second == group; });
}

void GroupMoves::redirect_group(Outgoing& message) const {
  const auto moved = moves_.find(message.parts().header.dst);
  if (moved != moves_.end() && moved->second != 0) message.redirect(moved->second);
}

bool GroupMoves::refuses(std::uint32_t group) const {
  const auto moved = moves_.find(group);
  return group == 0 || (moved != moves_.end() && moved->second == 0);
}

}  // namespace gimnet::nif
