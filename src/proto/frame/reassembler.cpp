#include "proto/frame/reassembler.hpp"

#include <iterator>
#include <utility>

namespace gimnet::proto {

using State = Reassembled::State;

Reassembler::Reassembler(const ReassemblyLimits& limits) : limits_(limits) {
  GIMNET_CHECK(limits.message_bytes_max <= kMessageBytesMax);
  GIMNET_CHECK(limits.message_bytes_max <= limits.waiting_bytes_max && limits.streams_max >= 1);
}

std::size_t Reassembler::StreamHash::operator()(const FragmentStream& stream) const noexcept {
  const std::uint64_t ids = (static_cast<std::uint64_t>(stream.src) << 32) | stream.dst;
  const std::uint64_t rest = (static_cast<std::uint64_t>(stream.kind) << 8) | stream.lane;
  constexpr std::uint64_t kOdd =
      0x9E3779B97F4A7C15ull;  // 2^64 over the golden ratio: spreads neighbouring ids
  return static_cast<std::size_t>(((ids ^ (rest << 48)) * kOdd) >> 17);
}

Reassembled Reassembler::take(const FragmentStream& stream, const FragmentHeader& fragment,
                              std::span<const std::byte> payload, ByteBuffer memory) {
  const std::uint64_t lost_before = lost_messages_;
  Entry& entry = touch(stream);
  Reassembled result;
  if (entry.open && entry.message == fragment.message) {
    const bool follows = fragment.offset == entry.bytes.size() && fragment.total == entry.total;
    result = follows ? append(entry, payload) : refuse(entry, fragment.message, State::lost);
  } else {
    lose(entry);
    result = fragment.offset == 0 ? begin(entry, fragment, payload, std::move(memory))
                                  : refuse(entry, fragment.message, State::lost);
  }
  result.lost_messages =
      static_cast<std::uint32_t>(lost_messages_ - lost_before - displaced_.size());
  result.displaced = std::exchange(displaced_, {});
  return result;
}

std::uint32_t Reassembler::interrupt(const FragmentStream& stream) {
  const auto found = by_stream_.find(stream);
  if (found == by_stream_.end() || !found->second->open) return 0;
  lose(*found->second);
  return 1;
}

std::uint32_t Reassembler::forget(NodeId src) {
  std::uint32_t lost = 0;
  for (auto entry = entries_.begin(); entry != entries_.end();) {
    if (entry->stream.src != src.value()) {
      ++entry;
      continue;
    }
    lost += entry->open ? 1 : 0;
    lose(*entry);
    by_stream_.erase(entry->stream);
    entry = entries_.erase(entry);
  }
  return lost;
}

std::uint32_t Reassembler::clear() {
  const auto lost = static_cast<std::uint32_t>(open_messages_);
  lost_messages_ += lost;
  entries_.clear();
  by_stream_.clear();
  waiting_bytes_ = 0;
  open_messages_ = 0;
  return lost;
}

std::vector<Reassembler::Standing> Reassembler::standings(std::optional<NodeId> src) const {
  std::vector<Standing> found;
  for (const Entry& entry : entries_) {
    if (src && entry.stream.src != src->value()) continue;
    Standing& standing = found.emplace_back(Standing{entry.stream, std::nullopt, std::nullopt});
    const auto taken = static_cast<std::uint32_t>(entry.bytes.size());
    if (entry.open) standing.open = FragmentHeader{entry.message, taken, entry.total};
    if (entry.has_lost) standing.lost = entry.lost_message;
  }
  return found;
}

template <class AmountOf>
Reassembler::Entries::iterator Reassembler::fullest(AmountOf amount_of) {
  std::vector<Holding> holdings;
  holdings.reserve(entries_.size());
  for (const Entry& entry : entries_)
    holdings.push_back({.src = entry.stream.src, .amount = amount_of(entry)});
  return std::next(entries_.begin(),
                   static_cast<std::ptrdiff_t>(first_of_fullest_source(holdings)));
}

void Reassembler::displace(Entry& entry) {
  const std::uint64_t lost_before = lost_messages_;
  lose(entry);
  if (lost_messages_ != lost_before) displaced_.push_back(entry.stream.src);
}

/// The stream's entry, moved to the end of those that wait. Where there are too many, one goes of
/// the source that has most of them.
Reassembler::Entry& Reassembler::touch(const FragmentStream& stream) {
  if (const auto found = by_stream_.find(stream); found != by_stream_.end()) {
    entries_.splice(entries_.end(), entries_, found->second);
    return *found->second;
  }
  if (entries_.size() >= limits_.streams_max) {
    const auto goes = fullest([](const Entry&) { return std::uint64_t{1}; });
    displace(*goes);
    by_stream_.erase(goes->stream);
    entries_.erase(goes);
  }
  entries_.push_back(Entry{.stream = stream, .bytes = {}});
  by_stream_.emplace(stream, std::prev(entries_.end()));
  return entries_.back();
}

void Reassembler::remember_lost(Entry& entry, std::uint32_t message) {
  if (entry.has_lost && entry.lost_message == message) return;
  entry.has_lost = true;
  entry.lost_message = message;
  ++lost_messages_;
}

void Reassembler::close(Entry& entry) {
  waiting_bytes_ -= entry.bytes.size();
  --open_messages_;
  entry.open = false;
  entry.bytes = ByteBuffer();
}

void Reassembler::lose(Entry& entry) {
  if (!entry.open) return;
  close(entry);
  remember_lost(entry, entry.message);
}

/// Displaces messages until `bytes` more fit. False: the one that is kept is the next that would
/// go.
bool Reassembler::make_room(const Entry& keep, std::size_t bytes) {
  while (waiting_bytes_ + bytes > limits_.waiting_bytes_max) {
    const auto goes = fullest(
        [&](const Entry& entry) { return entry.bytes.size() + (&entry == &keep ? bytes : 0); });
    if (&*goes == &keep) return false;
    displace(*goes);
  }
  return true;
}

Reassembled Reassembler::begin(Entry& entry, const FragmentHeader& fragment,
                               std::span<const std::byte> payload, ByteBuffer memory) {
  if (fragment.total > limits_.message_bytes_max)
    return refuse(entry, fragment.message, State::too_large);
  if (payload.size() == fragment.total) {
    return {.state = State::whole, .taken = fragment.total, .message = payload, .storage = {}};
  }
  entry.open = true;
  entry.message = fragment.message;
  entry.total = fragment.total;
  entry.bytes = std::move(memory);
  ++open_messages_;
  return append(entry, payload);
}

Reassembled Reassembler::append(Entry& entry, std::span<const std::byte> payload) {
  const bool room = make_room(entry, payload.size()) && entry.bytes.append(payload, entry.total);
  if (!room) return refuse(entry, entry.message, State::no_memory);
  waiting_bytes_ += payload.size();
  const auto taken = static_cast<std::uint32_t>(entry.bytes.size());
  if (taken < entry.total)
    return {.state = State::part, .taken = taken, .message = {}, .storage = {}};
  waiting_bytes_ -= entry.bytes.size();
  Reassembled whole{
      .state = State::whole, .taken = taken, .message = {}, .storage = std::move(entry.bytes)};
  entry.bytes = ByteBuffer();
  entry.open = false;
  --open_messages_;
  whole.message = whole.storage.span();
  return whole;
}

Reassembled Reassembler::refuse(Entry& entry, std::uint32_t message, State state) {
  lose(entry);
  remember_lost(entry, message);
  return {.state = state, .message = {}, .storage = {}};
}

}  // namespace gimnet::proto
