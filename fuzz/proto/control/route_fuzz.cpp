// Any bytes as the payload of a ROUTE frame (RECORD, RECORDS_END, KEEP_ALIVE). Input: a payload.

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "fuzz/support/control_round_trip.hpp"
#include "proto/control/route.hpp"

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

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const fuzz::ExactCopy payload(fuzz::input(data, size));
  fuzz::check_message<route::RecordPart>(payload.span());
  fuzz::check_message<route::RecordsEnd>(payload.span());
  fuzz::check_message<route::KeepAlive>(payload.span());
  check_bounds(payload.span());
  return 0;
}
