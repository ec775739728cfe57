#include "proto/frame/extensions.hpp"

#include <algorithm>
#include <cstring>

#include "base/check.hpp"
#include "base/endian.hpp"

namespace gimnet::proto {
namespace {

constexpr std::int64_t kNsPerMs = 1'000'000;

bool is_trace(const Extension& extension) {
  const std::size_t size = extension.value.size();
  return extension.type == ExtensionType::trace && size >= kTraceHeadSize &&
         (size - kTraceHeadSize) % kTraceSlotSize == 0;
}

void store_slot(std::byte* bytes, const TraceSlot& slot) {
  store_le<std::uint32_t>(bytes, slot.hub.value());
  store_le<std::uint32_t>(bytes + 4, 0);
  store_le(bytes + 8, slot.arrival_ns);
  store_le(bytes + 16, slot.departure_ns);
}

}  // namespace

std::optional<Extension> ExtensionReader::next() {
  if (rest_.empty() || failed_) return std::nullopt;
  if (rest_.size() < kExtensionHeadSize) {
    failed_ = true;
    return std::nullopt;
  }
  const auto size = static_cast<std::size_t>(rest_[1]);
  if (size > rest_.size() - kExtensionHeadSize) {
    failed_ = true;
    return std::nullopt;
  }
  const Extension extension{static_cast<ExtensionType>(rest_[0]),
                            {rest_.data() + kExtensionHeadSize, size}};
  rest_ = {rest_.data() + kExtensionHeadSize + size, rest_.size() - kExtensionHeadSize - size};
  return extension;
}

bool valid_extensions(std::span<const std::byte> extensions) {
  ExtensionReader reader(extensions);
  while (reader.next()) {
  }
  return !reader.failed();
}

std::optional<Age> find_age(std::span<const std::byte> extensions) {
  ExtensionReader reader(extensions);
  while (const auto extension = reader.next()) {
    if (extension->type != ExtensionType::age || extension->value.size() != kAgeSize) continue;
    const std::byte* value = extension->value.data();
    return Age{load_le<std::int64_t>(value), load_le<std::uint32_t>(value + 8)};
  }
  return std::nullopt;
}

bool too_old(const Age& age, std::int64_t now_ns) {
  if (now_ns <= age.origin_ns) return false;
  // Unsigned, so that a time from the far past cannot overflow.
  const auto passed_ns =
      static_cast<std::uint64_t>(now_ns) - static_cast<std::uint64_t>(age.origin_ns);
  return passed_ns > static_cast<std::uint64_t>(age.longest_ms) * kNsPerMs;
}

void adopt_origin(std::span<std::byte> extensions, std::optional<std::int64_t> ahead_ns,
                  std::int64_t now_ns) {
  ExtensionReader reader(extensions);
  while (const auto extension = reader.next()) {
    if (extension->type != ExtensionType::age || extension->value.size() != kAgeSize) continue;
    std::byte* value = extensions.data() + (extension->value.data() - extensions.data());
    std::int64_t origin_ns = now_ns;
    const bool fits =
        ahead_ns && !__builtin_sub_overflow(load_le<std::int64_t>(value), *ahead_ns, &origin_ns);
    store_le(value, fits ? std::min(origin_ns, now_ns) : now_ns);
    return;
  }
}

std::size_t TraceView::used() const {
  return std::min(static_cast<std::size_t>(value_[0]), slots());
}

TraceSlot TraceView::slot(std::size_t index) const {
  GIMNET_ASSERT(index < slots());
  const std::byte* bytes = value_.data() + kTraceHeadSize + index * kTraceSlotSize;
  const auto hub = load_le<std::uint32_t>(bytes) & kEveryHub.value();
  return {HubId{static_cast<std::uint16_t>(hub)}, load_le<std::int64_t>(bytes + 8),
          load_le<std::int64_t>(bytes + 16)};
}

std::optional<TraceView> find_trace(std::span<const std::byte> extensions) {
  ExtensionReader reader(extensions);
  while (const auto extension = reader.next()) {
    if (is_trace(*extension)) return TraceView(extension->value);
  }
  return std::nullopt;
}

bool fill_trace(std::span<std::byte> extensions, const TraceSlot& slot) {
  ExtensionReader reader(extensions);
  while (const auto extension = reader.next()) {
    if (!is_trace(*extension)) continue;
    const auto used = static_cast<std::size_t>(extension->value[0]);
    std::byte* value = extensions.data() + (extension->value.data() - extensions.data());
    if (used >= TraceView(extension->value).slots()) return false;
    store_slot(value + kTraceHeadSize + used * kTraceSlotSize, slot);
    value[0] = static_cast<std::byte>(used + 1);
    return true;
  }
  return false;
}

bool stamp_departure(std::span<std::byte> extensions, HubId hub, std::int64_t departure_ns) {
  const std::optional<TraceView> trace = find_trace(extensions);
  if (!trace || trace->used() == 0) return false;
  const std::size_t last = trace->used() - 1;
  const TraceSlot slot = trace->slot(last);
  if (slot.hub != hub) return false;
  std::byte* value = extensions.data() + (trace->bytes().data() - extensions.data());
  store_slot(value + kTraceHeadSize + last * kTraceSlotSize, {hub, slot.arrival_ns, departure_ns});
  return true;
}

bool ExtensionWriter::add(ExtensionType type, std::span<const std::byte> value) {
  GIMNET_CHECK(value.size() <= 255);
  if (memory_.size() - size_ < kExtensionHeadSize + value.size()) return false;
  std::byte* at = memory_.data() + size_;
  at[0] = static_cast<std::byte>(type);
  at[1] = static_cast<std::byte>(value.size());
  if (!value.empty()) std::memcpy(at + kExtensionHeadSize, value.data(), value.size());
  size_ += kExtensionHeadSize + value.size();
  return true;
}

bool ExtensionWriter::add_age(const Age& age) {
  std::byte value[kAgeSize];
  store_le(value, age.origin_ns);
  store_le(value + 8, age.longest_ms);
  return add(ExtensionType::age, value);
}

bool ExtensionWriter::add_trace(std::size_t slots) {
  GIMNET_CHECK(slots >= 1 && slots <= kTraceSlotsMax);
  constexpr std::byte kFree[kTraceHeadSize + kTraceSlotsMax * kTraceSlotSize] = {};
  return add(ExtensionType::trace, std::span(kFree).first(kTraceHeadSize + slots * kTraceSlotSize));
}

}  // namespace gimnet::proto
