#include "hub/control/state/group_proof.hpp"

#include <algorithm>

#include "hub/control/state/mac_text.hpp"

namespace gimnet::hub {

GroupProof write_group_proof(const GroupGrant& grant, const Secret& secret) {
  MacText text("GIMnet group proof");
  text.add_number(grant.hub.value())
      .add_number(grant.group.value())
      .add_number(grant.forgettings)
      .add(grant.full_name);
  const Digest mac = hmac_sha256(secret, text.bytes());
  GroupProof proof{};
  std::copy_n(mac.begin(), proof.size(), proof.begin());
  return proof;
}

bool proves(std::span<const std::byte> proof, const GroupGrant& grant, const Secret& secret) {
  return same_bytes(proof, write_group_proof(grant, secret));
}

}  // namespace gimnet::hub
