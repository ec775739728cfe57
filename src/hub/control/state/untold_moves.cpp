#include "hub/control/state/untold_moves.hpp"

#include <algorithm>

namespace gimnet::hub {

void UntoldMoves::on_moved(const std::vector<NodeIndex>& subscribers, GroupIndex old_group,
                           std::uint64_t move) {
  if (!entries_.empty() && old_group != kNoGroup) {
    if (ended_.size() == kBetweenMax) ended_.erase(ended_.begin());
    ended_.push_back(old_group);
    ++ended_count_;
  }
  for (const NodeIndex subscriber : subscribers) {
    entries_.try_emplace(subscriber, Entry{old_group, ended_count_, 0}).first->second.move = move;
  }
}

void UntoldMoves::on_read(NodeIndex subscriber, std::uint64_t move) {
  const auto found = entries_.find(subscriber);
  if (found == entries_.end() || found->second.move > move) return;
  entries_.erase(found);
  clear_if_empty();
}

void UntoldMoves::forget(NodeIndex subscriber) {
  entries_.erase(subscriber);
  clear_if_empty();
}

void UntoldMoves::renumber(NodeIndex subscriber, NodeIndex new_index) {
  auto entry = entries_.extract(subscriber);
  if (entry.empty()) return;
  entry.key() = new_index;
  entries_.insert(std::move(entry));
}

std::optional<UntoldMoves::Untold> UntoldMoves::of(NodeIndex subscriber) const {
  const auto found = entries_.find(subscriber);
  if (found == entries_.end()) return std::nullopt;
  const Entry& entry = found->second;
  Untold untold{entry.known, entry.move, {}};
  const std::size_t count = std::min<std::size_t>(ended_.size(), ended_count_ - entry.since);
  untold.between.assign(ended_.end() - static_cast<std::ptrdiff_t>(count), ended_.end());
  return untold;
}

void UntoldMoves::clear_if_empty() {
  if (!entries_.empty()) return;
  ended_ = {};
  ended_count_ = 0;
}

}  // namespace gimnet::hub
