#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "base/ids.hpp"
#include "hub/crypto/hmac.hpp"

// What a service shows to get its group back: docs/protocol.md, section 8. To nodes a proof is
// opaque. Thread safety: value types and pure functions.

namespace gimnet::hub {

/// That a service had a group.
struct GroupGrant {
  HubId hub;
  GroupIndex group;
  std::string_view full_name;
  /// How often the hub had forgotten groups until then: between two times no two services get the
  /// same group.
  std::uint64_t forgettings = 0;
};

/// The first half of an HMAC-SHA256: as hard to guess as a key of 128 bits.
using GroupProof = std::array<std::byte, 16>;

[[nodiscard]] GroupProof write_group_proof(const GroupGrant& grant, const Secret& secret);
/// Did a hub with this secret write these bytes for that? Takes as long for wrong bytes as for the
/// right ones.
[[nodiscard]] bool proves(std::span<const std::byte> proof, const GroupGrant& grant,
                          const Secret& secret);

}  // namespace gimnet::hub
