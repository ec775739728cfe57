#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/result.hpp"
#include "client/nif/error.hpp"
#include "proto/control/link.hpp"

namespace gimnet::nif {

/// The terms of one connection, as WELCOME settled them. A value type.
struct SessionTerms {
  std::uint32_t id = 0;
  std::uint32_t hub_id = 0;
  std::string hub_name;
  std::string name;
  std::vector<std::byte> token;
  std::uint64_t hub_epoch = 0;
  std::uint32_t frame_bytes_max = 0;
  std::int64_t keep_alive_ns = 0;
  std::int64_t silent_after_ns = 0;
  std::int64_t grace_ns = 0;     ///< so long after a break the session can be resumed
  std::int64_t hub_time_ns = 0;  ///< when it said WELCOME; 0: it does not tell
  bool resume = false;           ///< both ends keep what is unconfirmed
  bool resumed = false;          ///< the counts of the earlier connection go on
  std::uint64_t hub_taken = 0;   ///< data frames of this epoch that the hub took
  std::uint32_t hub_resume_bytes = 0;
  bool takes_missed = false;  ///< the hub wants to know what subscriptions miss
  std::optional<std::uint32_t> retained_bytes_max;  ///< as Welcome::retained_bytes_max
  std::string earlier_goodbye;  ///< why the hub closed the session's last connection
};

/// Checks a hub's WELCOME, which is not trusted. `resume`: the HELLO asked for it;
/// `former_hub_epoch`: the hub's earlier epoch as HELLO named it, 0: none. Only with both may
/// WELCOME say `resumed`. Errors: NIF_PROTOCOL.
[[nodiscard]] Result<SessionTerms, Failure> session_terms_of(const proto::Welcome& welcome,
                                                             bool resume,
                                                             std::uint64_t former_hub_epoch);

}  // namespace gimnet::nif
