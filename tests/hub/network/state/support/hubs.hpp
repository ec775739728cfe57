#pragma once

#include <chrono>
#include <cstdint>
#include <utility>
#include <vector>

#include "hub/network/state/own_record.hpp"
#include "hub/network/state/record_store.hpp"

// Hubs and records in few words. A hub is named by its hub id and one byte of unique id.

namespace gimnet::hub::test {

using std::chrono::milliseconds;

[[nodiscard]] inline proto::HubKey hub_key(std::uint16_t hub, std::uint8_t unique = 0) {
  proto::HubKey key;
  key.hub = HubId{hub};
  key.unique.bytes.front() = unique;
  key.unique.bytes.back() = static_cast<std::uint8_t>(unique == 0 ? hub : unique);
  return key;
}

[[nodiscard]] inline HubIdentity identity(std::uint16_t hub, std::uint64_t instance,
                                          bool configured = true) {
  return {hub_key(hub), proto::HubInstance{instance}, configured};
}

[[nodiscard]] inline proto::route::RecordPart said(
    const HubIdentity& hub, std::uint64_t sequence,
    const std::vector<std::pair<proto::HubKey, std::uint16_t>>& neighbours = {},
    std::uint16_t part = 0) {
  proto::route::RecordPart record;
  record.hub = hub.key;
  record.instance = hub.instance;
  record.configured = hub.configured;
  record.part = part;
  record.sequence = sequence;
  for (const auto& [key, cost] : neighbours) record.neighbours.push_back({key, cost});
  return record;
}

[[nodiscard]] inline PartRef part(
    const HubIdentity& hub, std::uint64_t sequence,
    const std::vector<std::pair<proto::HubKey, std::uint16_t>>& neighbours = {},
    std::uint16_t number = 0) {
  return make_part(said(hub, sequence, neighbours, number));
}

}  // namespace gimnet::hub::test
