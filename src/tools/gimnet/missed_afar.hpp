#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "gimnet/gimi/records.hpp"

namespace gimnet::tool {

class ToolSession;

/// Services as another hub of the network tells of them. Thread safety: a value type.
struct MissedAnswer {
  std::vector<ServiceRecord> services;
  std::string error;  ///< why it told nothing; "": it told
};

/// Adds what another hub tells to records of the own one: the messages that its subscribers missed,
/// and of its own services how many subscribers they have in the network. `most` are the messages
/// that were missed at the hub of each record's missed_most, in the order of the records.
void add_answer(std::vector<ServiceRecord>& services, std::vector<std::uint64_t>& most,
                std::uint32_t hub_id, const std::vector<ServiceRecord>& told);

/// Asks each hub of the network that can be reached, and adds its answer. Says of the others that
/// they are left out. REQUIRES: the session joined, and the records are of its own hub.
void add_missed_afar(ToolSession& session, std::vector<ServiceRecord>& services);

}  // namespace gimnet::tool
