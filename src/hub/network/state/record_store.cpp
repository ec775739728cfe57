#include "hub/network/state/record_store.hpp"

#include <algorithm>
#include <array>
#include <iterator>

#include "base/endian.hpp"
#include "hub/crypto/hmac.hpp"

namespace gimnet::hub {
namespace {

using proto::route::RecordPart;

constexpr std::uint64_t kFarApart = std::uint64_t{1} << 32;

/// The first 8 bytes of the SHA-256 of {u16 hub id, u8[16] unique id, u16 part, u64 sequence, u64
/// instance}.
std::uint64_t mark_of(const RecordPart& part) {
  std::array<std::byte, 36> text{};
  store_le(text.data(), part.hub.hub.value());
  std::ranges::copy(std::as_bytes(std::span(part.hub.unique.bytes)), text.begin() + 2);
  store_le(text.data() + 18, part.part);
  store_le(text.data() + 20, part.sequence);
  store_le(text.data() + 28, part.instance.value());
  return load_le<std::uint64_t>(sha256(text).data());
}

/// A part in memory is larger than what came.
constexpr std::size_t kPartOverhead = 256;

std::size_t bytes_of(const StoredPart& part) { return part.bytes.size() + kPartOverhead; }

auto place_of(const std::vector<PartRef>& parts, std::uint16_t number) {
  return std::ranges::lower_bound(parts, number, {},
                                  [](const PartRef& each) { return each->said.part; });
}

}  // namespace

PartRef read_part(proto::Payload bytes) {
  if (bytes.size() > proto::route::kPartBytesMax) return nullptr;
  auto said = proto::decode<RecordPart>(bytes);
  if (!said) return nullptr;
  const std::uint64_t mark = mark_of(*said);
  return std::make_shared<const StoredPart>(StoredPart{std::move(*said), std::move(bytes), mark});
}

PartRef make_part(const RecordPart& said) {
  return std::make_shared<const StoredPart>(StoredPart{said, proto::encode(said), mark_of(said)});
}

bool is_newer(const RecordPart& part, const RecordPart& than) {
  if (part.sequence == than.sequence) return part.instance > than.instance;
  const bool higher = part.sequence > than.sequence;
  const std::uint64_t apart =
      higher ? part.sequence - than.sequence : than.sequence - part.sequence;
  return higher == (apart <= kFarApart);
}

bool is_newer(const StoredPart& part, const StoredPart& than) {
  return is_newer(part.said, than.said) || (contradict(part, than) && part.bytes > than.bytes);
}

bool contradict(const StoredPart& one, const StoredPart& other) {
  return one.said.sequence == other.said.sequence && one.said.instance == other.said.instance &&
         one.bytes != other.bytes;
}

PartRef StoredRecord::part(std::uint16_t number) const {
  const auto found = place_of(parts_, number);
  return found != parts_.end() && (*found)->said.part == number ? *found : nullptr;
}

const RecordPart* StoredRecord::head() const {
  const PartRef first = part(0);
  return first == nullptr ? nullptr : &first->said;
}

void StoredRecord::put(PartRef part) {
  const auto number = part->said.part;
  const auto at = parts_.begin() + (place_of(parts_, number) - parts_.cbegin());
  bytes_ += bytes_of(*part);
  if (at != parts_.end() && (*at)->said.part == number) {
    bytes_ -= bytes_of(**at);
    *at = std::move(part);
  } else {
    parts_.insert(at, std::move(part));
  }
}

RecordStore::Taken RecordStore::take(const PartRef& part, std::chrono::milliseconds now) {
  const RecordPart& said = part->said;
  auto found = records_.find(said.hub);
  const PartRef before = found == records_.end() ? nullptr : found->second.part(said.part);
  if (before != nullptr && !is_newer(*part, *before)) return Taken::known;
  if (!is_linked(said.hub)) {
    const std::size_t freed = before == nullptr ? 0 : bytes_of(*before);
    const std::size_t added = bytes_of(*part) - std::min(freed, bytes_of(*part));
    const bool reachable = found != records_.end() && !found->second.unreachable_since;
    const bool fits =
        (found != records_.end() || has_room_for(said.hub.hub)) && has_room_for(added, reachable);
    if (!fits) {
      ++too_many_;
      return Taken::too_many;
    }
  }
  // It may have been the one that had to go.
  const auto [record, is_new] = records_.try_emplace(said.hub);
  if (is_new) record->second.unreachable_since = now;
  put(record->second, part);
  return Taken::newer;
}

void RecordStore::put_own(const PartRef& part) { put(records_[part->said.hub], part); }

void RecordStore::put(StoredRecord& record, const PartRef& part) {
  bytes_ -= record.bytes();
  if (record.unreachable_since) unreachable_bytes_ -= record.bytes();
  record.put(part);
  bytes_ += record.bytes();
  if (record.unreachable_since) unreachable_bytes_ += record.bytes();
}

RecordStore::Records::iterator RecordStore::drop(Records::iterator record) {
  bytes_ -= record->second.bytes();
  if (record->second.unreachable_since) unreachable_bytes_ -= record->second.bytes();
  return records_.erase(record);
}

bool RecordStore::is_linked(const proto::HubKey& hub) const {
  return std::ranges::binary_search(linked_, hub);
}

/// At the limit the record of that hub id goes that could not be reached for longest.
bool RecordStore::has_room_for(HubId hub) {
  const auto first = records_.lower_bound(proto::HubKey{hub, {}});
  std::size_t count = 0;
  auto oldest = records_.end();
  for (auto each = first; each != records_.end() && each->first.hub == hub; ++each, ++count) {
    const auto& since = each->second.unreachable_since;
    if (!since || is_linked(each->first)) continue;
    if (oldest == records_.end() || *since < *oldest->second.unreachable_since) oldest = each;
  }
  if (count < kRecordsOfOneId) return true;
  if (oldest == records_.end()) return false;
  drop(oldest);
  ++too_many_;
  return true;
}

/// At the limit those that could not be reached for longest go, until half of the bound is free: to
/// look for them costs more than to take a record.
bool RecordStore::has_room_for(std::size_t bytes, bool reachable) {
  const auto fits = [&] {
    return bytes_ + bytes <= kBytesMax &&
           (reachable || unreachable_bytes_ + bytes <= kUnreachableBytesMax);
  };
  if (fits()) return true;
  std::vector<Records::iterator> lost;
  for (auto each = records_.begin(); each != records_.end(); ++each) {
    if (each->second.unreachable_since && !is_linked(each->first)) lost.push_back(each);
  }
  std::ranges::sort(lost, {}, [](const auto& each) {
    return std::pair{*each->second.unreachable_since, each->first};
  });
  for (const auto& each : lost) {
    if (unreachable_bytes_ <= kUnreachableBytesMax / 2 && fits()) break;
    drop(each);
    ++too_many_;
  }
  return fits();
}

const StoredRecord* RecordStore::find(const proto::HubKey& hub) const {
  const auto found = records_.find(hub);
  return found == records_.end() ? nullptr : &found->second;
}

std::vector<PartRef> RecordStore::all() const {
  std::vector<PartRef> parts;
  for (const auto& [hub, record] : records_) {
    parts.insert(parts.end(), record.parts().begin(), record.parts().end());
  }
  return parts;
}

std::vector<PartRef> RecordStore::reachable() const {
  std::vector<PartRef> parts;
  for (const auto& [hub, record] : records_) {
    if (!record.unreachable_since)
      parts.insert(parts.end(), record.parts().begin(), record.parts().end());
  }
  return parts;
}

void RecordStore::set_reachable(std::span<const proto::HubKey> hubs,
                                std::chrono::milliseconds now) {
  named_.clear();
  for (auto& [hub, record] : records_) {
    if (std::ranges::binary_search(hubs, hub)) {
      record.each_counting([&](const StoredPart& part) {
        for (const auto& each : part.said.neighbours)
          if (!std::ranges::binary_search(hubs, each.hub)) named_.push_back(each.hub);
      });
      if (record.unreachable_since) unreachable_bytes_ -= record.bytes();
      record.unreachable_since.reset();
      record.was_reached = true;
    } else if (!record.unreachable_since) {
      unreachable_bytes_ += record.bytes();
      record.unreachable_since = now;
    }
  }
  std::ranges::sort(named_);
  const auto [repeated, end] = std::ranges::unique(named_);
  named_.erase(repeated, end);
}

bool RecordStore::is_near(const proto::HubKey& hub) const {
  const StoredRecord* record = find(hub);
  if (record != nullptr && !record->unreachable_since) return true;
  return is_linked(hub) || std::ranges::binary_search(named_, hub);
}

void RecordStore::forget(std::chrono::milliseconds now) {
  for (auto each = records_.begin(); each != records_.end();) {
    const auto& since = each->second.unreachable_since;
    each = since && now - *since >= kForgetAfter ? drop(each) : std::next(each);
  }
}

std::uint64_t RecordStore::digest() const {
  std::uint64_t digest = 0;
  for (const auto& [hub, record] : records_) {
    if (record.unreachable_since) continue;
    record.each_counting([&digest](const StoredPart& part) { digest ^= part.mark; });
  }
  return digest;
}

}  // namespace gimnet::hub
