#include "client/gimi/ack_book.hpp"

#include <iterator>
#include <utility>

namespace gimnet::gimi {
namespace {

constexpr std::uint32_t kBits = 64;

void advance(AckBook::Entry& entry, std::uint32_t sequence) {
  const std::uint32_t step = sequence - entry.sequence;
  entry.bitmap = step >= kBits ? 0 : entry.bitmap << step;
  if (step <= kBits) entry.bitmap |= std::uint64_t{1} << (step - 1);
  entry.sequence = sequence;
}

}  // namespace

bool AckBook::take(const StreamName& sender, const proto::gimi::MessageHeader& data) {
  if (entries_.size() >= kStreamsMax && !entries_.contains(sender)) {
    // Who begins too many streams loses its own.
    const auto above = entries_.lower_bound(sender);
    entries_.erase(above != entries_.begin() ? std::prev(above) : above);
  }
  const auto [place, is_new] =
      entries_.try_emplace(sender, Entry{data.epoch, data.sequence, 0, true});
  if (is_new) return true;
  Entry& entry = place->second;
  const bool was_due = std::exchange(entry.due, true);
  const auto distance = static_cast<std::int32_t>(data.sequence - entry.sequence);
  if (data.epoch != entry.epoch) {
    entry = {data.epoch, data.sequence, 0, true};
  } else if (distance > 0) {
    advance(entry, data.sequence);
  } else if (distance < 0 && distance >= -static_cast<std::int32_t>(kBits)) {
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

bool AckBook::hold(const StreamName& sender) {
  const auto found = entries_.find(sender);
  return found == entries_.end() || std::exchange(found->second.due, true);
}

}  // namespace gimnet::gimi
