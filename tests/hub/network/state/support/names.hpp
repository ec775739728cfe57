#pragma once

#include "proto/control/route_names.hpp"

// Claims to names in few words.

namespace gimnet::hub::test {

[[nodiscard]] inline proto::route::NameClaim node_claim(std::uint16_t hub, std::uint32_t node,
                                                        std::uint64_t version = 0) {
  proto::route::NameClaim claim;
  claim.version = version;
  claim.node = make_id<NodeId>(HubId{hub}, node);
  return claim;
}

[[nodiscard]] inline proto::route::NameClaim service_claim(std::uint16_t hub, std::uint32_t node,
                                                           std::uint32_t group,
                                                           std::uint64_t version = 0) {
  auto claim = node_claim(hub, node, version);
  claim.service.emplace();
  claim.service->group = make_id<GroupId>(HubId{hub}, group);
  return claim;
}

[[nodiscard]] inline proto::route::NameClaim mark(std::uint64_t version) {
  proto::route::NameClaim claim;
  claim.version = version;
  claim.state = proto::route::NameState::deleted;
  return claim;
}

}  // namespace gimnet::hub::test
