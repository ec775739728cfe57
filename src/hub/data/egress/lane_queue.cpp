#include "hub/data/egress/lane_queue.hpp"

#include <algorithm>

#include "proto/frame/frame_parser.hpp"

namespace gimnet::hub {
namespace {

bool same_header(const std::byte* a, const std::byte* b) {
  return load_le<std::uint64_t>(a + proto::kAddressesOffset) ==
             load_le<std::uint64_t>(b + proto::kAddressesOffset) &&
         load_le<std::uint32_t>(a + proto::kAttributesOffset) ==
             load_le<std::uint32_t>(b + proto::kAttributesOffset);
}

/// Streams and messages that left may stay in their index until they are more than the others, and
/// these.
constexpr std::size_t kForgottenMin = 64;
/// A larger index is freed when it is not needed, since clearing it takes time.
constexpr std::size_t kKeptBuckets = 4'096;

std::uint64_t message_key(std::uint32_t src, std::uint32_t number) {
  return std::uint64_t{src} << 32 | number;
}

/// The message is not whole yet.
bool waits_for(const Entry& entry, NodeId src, std::uint32_t number) {
  return entry.frames != 0 && entry.fragmented && entry.message_number == number &&
         !entry.complete && entry.run.header().src == src.value();
}

template <class Index>
void forget(std::unique_ptr<Index>& index) {
  if (index->bucket_count() > kKeptBuckets) {
    index.reset();
  } else {
    index->clear();
  }
}

bool is_droppable(const Entry& entry) {
  return entry.frames != 0 && !entry.block && !entry.touched;
}

bool is_plain(const Entry& entry) {
  return !entry.fragmented && !entry.latest && !entry.extended && !entry.touched;
}

}  // namespace

std::size_t hash_value(const LatestStream& stream) {
  constexpr std::uint64_t kGolden = 0x9E3779B97F4A7C15u;  // 2^64 divided by the golden ratio
  std::uint64_t hash = stream.addresses;
  for (const std::uint64_t word : {stream.key, std::uint64_t{stream.kind_and_keyed}}) {
    hash = (hash ^ (hash >> 32)) * kGolden + word;
  }
  return hash ^ (hash >> 32);
}

LatestStream LaneQueue::stream_of(const Entry& entry) {
  const proto::FrameHeader header = entry.run.header();
  std::uint64_t key = 0;
  if (header.has(proto::kFlagKeyed)) {
    const auto frame = proto::parse_frame({entry.run.bytes, entry.run.size}, proto::Origin::hub);
    if (frame) key = frame->key.value_or(0);
  }
  const auto kind = static_cast<std::uint16_t>(static_cast<std::uint16_t>(header.kind) << 8);
  return {load_le<std::uint64_t>(entry.run.bytes + proto::kAddressesOffset), key,
          static_cast<std::uint16_t>(kind | (header.flags & proto::kFlagKeyed))};
}

void LaneQueue::count(const Entry& entry) {
  bytes_ += entry.size;
  if (counts_sources_) sources_.add(entry.source, entry.size);
  if (entry.block) block_bytes_ += entry.size;
  if (entry.latest) latest_bytes_ += entry.size;
  if (entry.touched) touched_bytes_ += entry.size;
}

void LaneQueue::discount(const Entry& entry) {
  bytes_ -= entry.size;
  if (counts_sources_) sources_.take(entry.source, entry.size);
  if (entry.block) block_bytes_ -= entry.size;
  if (entry.latest) latest_bytes_ -= entry.size;
  if (entry.touched) touched_bytes_ -= entry.size;
}

void LaneQueue::push(Entry&& entry) {
  if (counts_sources_) note_source(entry);
  count(entry);
  if (!entries_.empty()) {
    Entry& last = entries_.back();
    if (is_plain(entry) && is_plain(last) && last.frames != 0 && !last.more &&
        last.size + entry.size <= proto::kRunBytesMax &&
        same_header(last.run.bytes, entry.run.bytes) && last.run.extend(entry.run)) {
      last.size += entry.size;
      last.frames += entry.frames;
      return;
    }
  }
  const bool index = indexed_ && entry.latest && !entry.touched;
  const Entry& placed = entries_.push_back(std::move(entry));
  if (index) (*streams_)[stream_of(placed)] = entries_.end_number() - 1;
  note_message(placed, entries_.end_number() - 1);
}

Entry* LaneQueue::find_message(NodeId src, std::uint32_t message_number) {
  if (entries_.size() <= kSearchMax) return search_message(src, message_number);
  if (!messages_indexed_) index_messages();
  const auto found = messages_->find(message_key(src.value(), message_number));
  if (found == messages_->end() || found->second < entries_.first_number()) return nullptr;
  Entry& entry = entries_.at(found->second);
  return waits_for(entry, src, message_number) ? &entry : nullptr;
}

Entry* LaneQueue::search_message(NodeId src, std::uint32_t message_number) {
  for (std::uint64_t number = entries_.end_number(); number-- > entries_.first_number();) {
    Entry& entry = entries_.at(number);
    if (waits_for(entry, src, message_number)) return &entry;
  }
  return nullptr;
}

void LaneQueue::index_messages() {
  if (!messages_) messages_ = std::make_unique<MessageIndex>();
  messages_indexed_ = true;
  for (std::uint64_t number = entries_.first_number(); number != entries_.end_number(); ++number) {
    note_message(entries_.at(number), number);
  }
}

void LaneQueue::note_message(const Entry& entry, std::uint64_t number) {
  if (!messages_indexed_ || !entry.fragmented || entry.complete || entry.frames == 0) return;
  // Messages that left are forgotten when there are more of them than of others.
  if (messages_->size() > 2 * entries_.size() + kForgottenMin) return forget_messages();
  (*messages_)[message_key(entry.run.header().src, entry.message_number)] = number;
}

void LaneQueue::append_fragment(Entry& entry, Run fragment, bool last, PiecePool& pool) {
  discount(entry);
  entry.append(std::move(fragment), pool);
  entry.complete = last;
  count(entry);
}

bool LaneQueue::replace_latest(Entry& entry, Entry& older) {
  // Streams that left are forgotten when there are more of them than of others.
  if (streams() > 2 * entries_.size() + kForgottenMin) forget_streams();
  if (!indexed_) {
    begin_streams();
    for (std::uint64_t number = entries_.first_number(); number != entries_.end_number();
         ++number) {
      const Entry& each = entries_.at(number);
      if (each.frames != 0 && each.latest && !each.touched) (*streams_)[stream_of(each)] = number;
    }
  }
  const LatestStream stream = stream_of(entry);
  const auto found = streams_->find(stream);
  if (found == streams_->end() || found->second < entries_.first_number()) return false;
  Entry& waiting = entries_.at(found->second);
  if (waiting.frames == 0 || !waiting.latest || waiting.touched) return false;
  if (stream_of(waiting) != stream) return false;  // it took the place of one that was dropped
  discount(waiting);
  if (counts_sources_) note_source(entry);
  count(entry);
  older = std::exchange(waiting, std::move(entry));
  note_message(waiting, found->second);
  return true;
}

bool LaneQueue::drop_oldest(Entry& dropped) {
  oldest_hint_ = std::max(oldest_hint_, entries_.first_number());
  while (oldest_hint_ != entries_.end_number() && !is_droppable(entries_.at(oldest_hint_)))
    ++oldest_hint_;
  if (oldest_hint_ == entries_.end_number()) return false;
  const std::uint64_t number = find_oldest_of(sources().loser());
  dropped = std::move(entries_.at(number));
  discount(dropped);
  close_gap(number);
  // The counts stay, since a new entry may be among them (Outbox::admit_to_full()).
  while (!entries_.empty() && entries_.front().frames == 0) entries_.pop_front();
  return true;
}

std::uint64_t LaneQueue::find_oldest_of(std::uint8_t place) {
  const std::uint64_t end = std::min(entries_.end_number(), oldest_hint_ + kSearchMax);
  for (std::uint64_t number = oldest_hint_; number != end; ++number) {
    const Entry& entry = entries_.at(number);
    if (entry.source == place && is_droppable(entry)) return number;
  }
  return oldest_hint_;
}

/// Moves the entries before an empty one up, at most 63. Else a lane whose first entry waits for
/// long would fill with empty ones, and the search would find nothing else.
void LaneQueue::close_gap(std::uint64_t number) {
  for (; number != oldest_hint_; --number) {
    Entry& moved = entries_.at(number);
    moved = std::move(entries_.at(number - 1));
    if (indexed_ && moved.frames != 0 && moved.latest && !moved.touched)
      (*streams_)[stream_of(moved)] = number;
    note_message(moved, number);
  }
  entries_.at(number) = Entry{};
}

std::uint64_t LaneQueue::messages_of(GroupId group) {
  std::uint64_t messages = 0;
  for (std::uint64_t number = entries_.first_number(); number != entries_.end_number(); ++number) {
    const Entry& entry = entries_.at(number);
    if (entry.frames == 0) continue;
    const proto::FrameHeader header = entry.run.header();
    if (header.kind == proto::Kind::group && header.dst == group.value())
      messages += entry.messages();
  }
  return messages;
}

NodeId LaneQueue::source_at(std::uint8_t place) {
  const std::uint64_t end = std::min(entries_.end_number(), entries_.first_number() + kSearchMax);
  for (std::uint64_t number = entries_.first_number(); number != end; ++number) {
    const Entry& entry = entries_.at(number);
    if (entry.frames != 0 && entry.source % SourceBytes::kFixed == place)
      return NodeId{entry.run.header().src};
  }
  return NodeId{};
}

Entry& LaneQueue::front() {
  skip_dead();
  return entries_.front();
}

void LaneQueue::on_left(const Entry& entry, std::uint32_t bytes) {
  bytes_ -= bytes;
  if (counts_sources_) sources_.take(entry.source, bytes);
  if (entry.block) block_bytes_ -= bytes;
  if (entry.latest) latest_bytes_ -= bytes;
  if (entry.touched) touched_bytes_ -= bytes;
}

void LaneQueue::pop_front() {
  entries_.pop_front();
  skip_dead();
}

void LaneQueue::skip_dead() {
  while (!entries_.empty() && entries_.front().frames == 0) entries_.pop_front();
  if (!entries_.empty()) return;
  counts_sources_ = false;
  forget_streams();
  forget_messages();
}

void LaneQueue::count_sources() {
  sources_ = SourceBytes{};
  for (std::uint64_t number = entries_.first_number(); number != entries_.end_number(); ++number) {
    Entry& each = entries_.at(number);
    if (each.frames == 0) continue;
    note_source(each);
    sources_.add(each.source, each.size);
  }
  counts_sources_ = true;
}

/// From here on LATEST entries that are pushed are remembered by their stream.
void LaneQueue::begin_streams() {
  forget_streams();
  if (!streams_) streams_ = std::make_unique<StreamIndex>();
  indexed_ = true;
}

/// Keeps the memory: the next burst fills it again.
void LaneQueue::forget_streams() {
  if (!indexed_) return;
  indexed_ = false;
  forget(streams_);
}

void LaneQueue::forget_messages() {
  if (!messages_indexed_) return;
  messages_indexed_ = false;
  forget(messages_);
}

std::size_t LaneQueue::capacity_bytes() const {
  std::size_t bytes = entries_.capacity_bytes();
  if (streams_) bytes += streams_->bucket_count() * (sizeof(StreamIndex::value_type) + 1);
  if (messages_) bytes += messages_->bucket_count() * (sizeof(MessageIndex::value_type) + 1);
  return bytes;
}

void LaneQueue::trim() {
  entries_.trim();
  if (!entries_.empty()) return;
  // An empty lane has indexes if the message that was looked up in it was then refused.
  forget_streams();
  forget_messages();
  streams_.reset();
  messages_.reset();
}

}  // namespace gimnet::hub
