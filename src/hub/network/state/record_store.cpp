#include "hub/network/state/record_store.hpp"

#include <algorithm>
#include <array>

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

const StoredPart* StoredRecord::part(std::uint16_t number) const {
  const auto found = place_of(parts_, number);
  return found != parts_.end() && (*found)->said.part == number ? found->get() : nullptr;
}

const RecordPart* StoredRecord::head() const {
  const StoredPart* first = part(0);
  return first == nullptr ? nullptr : &first->said;
}

void StoredRecord::put(PartRef part) {
  const auto number = part->said.part;
  const auto at = parts_.begin() + (place_of(parts_, number) - parts_.cbegin());
  if (at != parts_.end() && (*at)->said.part == number) {
    *at = std::move(part);
  } else {
    parts_.insert(at, std::move(part));
  }
}

RecordStore::Taken RecordStore::take(const PartRef& part, std::chrono::milliseconds now) {
  const RecordPart& said = part->said;
  auto found = records_.find(said.hub);
  const StoredPart* before = found == records_.end() ? nullptr : found->second.part(said.part);
  if (before != nullptr && !is_newer(said, before->said)) return Taken::known;
  const std::size_t freed = before == nullptr ? 0 : before->bytes.size();
  if (bytes_ - freed + part->bytes.size() > kBytesMax) {
    ++too_many_;
    return Taken::too_many;
  }
  if (found == records_.end()) {
    if (!has_room_for(said.hub.hub)) {
      ++too_many_;
      return Taken::too_many;
    }
    found = records_.try_emplace(said.hub).first;
    found->second.unreachable_since = now;
  }
  bytes_ += part->bytes.size() - freed;
  found->second.put(part);
  return Taken::newer;
}

void RecordStore::put_own(const PartRef& part) { records_[part->said.hub].put(part); }

bool RecordStore::has_room_for(HubId hub) const {
  const auto first = records_.lower_bound(proto::HubKey{hub, {}});
  const auto end =
      records_.lower_bound(proto::HubKey{HubId{static_cast<std::uint16_t>(hub.value() + 1)}, {}});
  return static_cast<std::size_t>(std::distance(first, end)) < kRecordsOfOneId;
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

void RecordStore::set_reachable(std::span<const proto::HubKey> hubs,
                                std::chrono::milliseconds now) {
  for (auto& [hub, record] : records_) {
    if (std::ranges::binary_search(hubs, hub)) {
      record.unreachable_since.reset();
    } else if (!record.unreachable_since) {
      record.unreachable_since = now;
    }
  }
}

void RecordStore::forget(std::chrono::milliseconds now) {
  std::erase_if(records_, [now, this](const auto& entry) {
    const auto& since = entry.second.unreachable_since;
    if (!since || now - *since < kForgetAfter) return false;
    for (const PartRef& part : entry.second.parts()) bytes_ -= part->bytes.size();
    return true;
  });
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
