#include "client/gimi/ack_book.hpp"

#include <iterator>
#include <utility>

namespace gimnet::gimi {
namespace {

constexpr std::uint32_t kBits = 64;

bool has(const AckBook::Entry& entry, std::uint32_t sequence) {
  const std::uint32_t behind = entry.sequence - sequence;
  if (behind == 0) return true;
  return behind <= kBits && ((entry.bitmap >> (behind - 1)) & 1) != 0;
}

void advance(AckBook::Entry& entry, std::uint32_t sequence) {
  const std::uint32_t step = sequence - entry.sequence;
  entry.bitmap = step >= kBits ? 0 : entry.bitmap << step;
  if (step <= kBits) entry.bitmap |= std::uint64_t{1} << (step - 1);
  entry.sequence = sequence;
}

}  // namespace

bool AckBook::take(const StreamName& sender, std::uint32_t sequence) {
  if (entries_.size() >= kStreamsMax && !entries_.contains(sender)) {
    // Who begins too many streams loses its own.
    const auto above = entries_.lower_bound(sender);
    entries_.erase(above != entries_.begin() ? std::prev(above) : above);
  }
  const auto [place, is_new] = entries_.try_emplace(sender, Entry{sequence, 0, true});
  if (is_new) return true;
  Entry& entry = place->second;
  const bool was_due = std::exchange(entry.due, true);
  const auto distance = static_cast<std::int32_t>(sequence - entry.sequence);
  if (distance > 0) {
    advance(entry, sequence);
  } else if (distance < -static_cast<std::int32_t>(kBits) || (sequence == 1 && has(entry, 1))) {
    entry = {sequence, 0,
             true};  // a stream that begins again: its sender is a new one under an old id
  } else if (distance < 0) {
    entry.bitmap |= std::uint64_t{1} << (static_cast<std::uint32_t>(-distance) - 1);
  }
  return !was_due;
}

AckBook::Entry AckBook::acknowledge(const StreamName& sender) {
  const auto found = entries_.find(sender);
  if (found == entries_.end()) return {};
  found->second.due = false;
  return found->second;
}

}  // namespace gimnet::gimi
