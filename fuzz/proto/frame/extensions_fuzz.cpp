// Any bytes as the extensions of a frame: read as by the plainest code, and a TRACE filled nowhere
// but in its slot. Input: extensions without the u16 in front.

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "fuzz/support/fuzz_input.hpp"
#include "proto/frame/extensions.hpp"

namespace {

using namespace gimnet;
using namespace gimnet::proto;
using Bytes = std::span<const std::byte>;

struct Found {
  std::size_t at;    ///< of the value
  std::size_t size;  ///< of the value
  int type;
};

/// Nothing: one does not fit.
std::optional<std::vector<Found>> walk_naively(Bytes bytes) {
  std::vector<Found> found;
  std::size_t at = 0;
  while (at < bytes.size()) {
    if (bytes.size() - at < 2) return std::nullopt;
    const auto size = static_cast<std::size_t>(bytes[at + 1]);
    if (bytes.size() - at - 2 < size) return std::nullopt;
    found.push_back({at + 2, size, static_cast<int>(bytes[at])});
    at += 2 + size;
  }
  return found;
}

void check_reading(Bytes bytes, const std::optional<std::vector<Found>>& expected) {
  FUZZ_MUST(valid_extensions(bytes) == expected.has_value());
  ExtensionReader reader(bytes);
  std::size_t count = 0;
  while (const auto extension = reader.next()) {
    if (expected) {
      const Found& found = (*expected)[count];
      FUZZ_MUST(static_cast<int>(extension->type) == found.type &&
                extension->value.size() == found.size);
      FUZZ_MUST(extension->value.data() == bytes.data() + found.at);
    }
    ++count;
  }
  FUZZ_MUST(reader.failed() == !expected.has_value());
  FUZZ_MUST(!expected || count == expected->size());
}

void check_age(Bytes bytes) {
  const auto age = find_age(bytes);
  if (!age) return;
  const auto latest = std::numeric_limits<std::int64_t>::max();
  FUZZ_MUST(!too_old(*age, std::numeric_limits<std::int64_t>::min()));
  FUZZ_MUST(!too_old(*age, age->origin_ns));
  FUZZ_MUST(!too_old(*age, latest) || age->origin_ns < latest);
}

void check_filling(Bytes bytes) {
  const auto before = find_trace(bytes);
  fuzz::ExactCopy filled(bytes);
  const TraceSlot slot{HubId{7}, 1, 2};
  const bool done = fill_trace(filled.writable(), slot);
  const auto after = find_trace(filled.span());
  FUZZ_MUST(before.has_value() == after.has_value());
  if (!done) {
    FUZZ_MUST(fuzz::same(bytes, filled.span()));
    FUZZ_MUST(!before || before->used() == before->slots());
    return;
  }
  FUZZ_MUST(before && before->used() < before->slots());
  FUZZ_MUST(after->used() == before->used() + 1 && after->slot(before->used()) == slot);
  std::size_t changed = 0;
  for (std::size_t i = 0; i < bytes.size(); ++i) changed += bytes[i] != filled.span()[i] ? 1 : 0;
  FUZZ_MUST(changed <= 1 + kTraceSlotSize);
  for (std::size_t i = 0; i < before->used(); ++i) FUZZ_MUST(before->slot(i) == after->slot(i));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const fuzz::ExactCopy copy(fuzz::input(data, size));
  const Bytes bytes = copy.span();
  check_reading(bytes, walk_naively(bytes));
  check_age(bytes);
  check_filling(bytes);
  return 0;
}
