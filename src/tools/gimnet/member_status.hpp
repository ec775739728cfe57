#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "gimnet/gimi/records.hpp"
#include "tools/gimnet/exit_code.hpp"
#include "tools/gimnet/hub_status.hpp"
#include "tools/gimnet/table.hpp"

namespace gimnet::tool {

class ToolSession;

/// One hub of the network, as it tells of itself.
struct MemberStatus {
  std::uint32_t hub_id = 0;
  std::string name;
  Ledger ledger;
  std::vector<LinkRecord> links;
  std::string error;  ///< why it told nothing, such as "unreachable"; "": it told
};
/// Is delivered(A) <= accepted(B) <= delivered(A) + unsure(A) true for each link, in both ways? A
/// link is found at both ends by its name. One that stands at no end is not compared.
[[nodiscard]] bool links_agree(const std::vector<MemberStatus>& members);
[[nodiscard]] std::string json_of(const std::vector<MemberStatus>& members, bool exact);
[[nodiscard]] std::string text_of(const std::vector<MemberStatus>& members, bool exact,
                                  Paint paint = Paint{});

/// `status --all`. REQUIRES: the session joined.
[[nodiscard]] ExitCode run_status_of_all(ToolSession& session);

}  // namespace gimnet::tool
