// Any bytes as the payload of a ROUTE frame (RECORD, RECORDS_END, KEEP_ALIVE, NAMES and
// its like). Input: a payload.

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "fuzz/support/control_round_trip.hpp"
#include "proto/control/names.hpp"
#include "proto/control/route.hpp"
#include "proto/control/route_groups.hpp"
#include "proto/control/route_names.hpp"

namespace {

using namespace gimnet;
using namespace gimnet::proto;

/// The bounds that the record store relies on.
void check_bounds(std::span<const std::byte> payload) {
  const auto record = decode<route::RecordPart>(payload);
  if (!record) return;
  FUZZ_MUST(record->part < route::kPartsMax);
  FUZZ_MUST(record->hub.hub.value() >= 1 && record->hub.hub.value() <= kHubIdMax);
  FUZZ_MUST(record->neighbours.size() <= route::kNeighboursMax);
  const auto descends = [](const route::Neighbour& a, const route::Neighbour& b) {
    return !(a.hub < b.hub);
  };
  FUZZ_MUST(std::ranges::adjacent_find(record->neighbours, descends) == record->neighbours.end());
  for (const route::Neighbour& each : record->neighbours) {
    FUZZ_MUST(each.cost != 0);
    FUZZ_MUST(each.hub.hub.value() >= 1 && each.hub.hub.value() <= kHubIdMax);
  }
}

/// Those that the copies of names rely on.
void check_names(std::span<const std::byte> payload) {
  const auto names = decode<route::Names>(payload);
  if (!names) return;
  std::uint64_t last = names->after;
  for (const route::NameRecord& each : names->records) {
    FUZZ_MUST(each.claim.version > last);
    last = each.claim.version;
    FUZZ_MUST(valid_name(each.name));
    if (each.claim.state == route::NameState::deleted) continue;
    FUZZ_MUST(hub_of(each.claim.node) == names->hub);
    FUZZ_MUST(!each.claim.service || hub_of(each.claim.service->group) == names->hub);
  }
  FUZZ_MUST(last <= names->version || names->records.empty());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const fuzz::ExactCopy payload(fuzz::input(data, size));
  fuzz::check_message<route::RecordPart>(payload.span());
  fuzz::check_message<route::RecordsEnd>(payload.span());
  fuzz::check_message<route::KeepAlive>(payload.span());
  fuzz::check_message<route::NamesKnown>(payload.span());
  fuzz::check_message<route::Names>(payload.span());
  fuzz::check_message<route::NamesTaken>(payload.span());
  fuzz::check_message<route::Join>(payload.span());
  fuzz::check_message<route::Leave>(payload.span());
  fuzz::check_message<route::JoinsEnd>(payload.span());
  fuzz::check_message<route::Joined>(payload.span());
  check_bounds(payload.span());
  check_names(payload.span());
  return 0;
}
