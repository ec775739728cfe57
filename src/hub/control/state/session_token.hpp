#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "base/ids.hpp"
#include "hub/control/state/identity.hpp"
#include "hub/crypto/hmac.hpp"

// What a node shows to get its session back: docs/protocol.md, section 3. The layout is the hub's
// own matter; to nodes a token is opaque. Thread safety: value types and pure functions.

namespace gimnet::hub {

/// Numbers the sessions of a hub over all its starts, ascending: the boot number in the top 24
/// bits, then a count.
using SessionNumber = std::uint64_t;
inline constexpr std::uint64_t kBootMax = (1u << 24) - 1;
/// The number before the first session of that start. REQUIRES: boot <= kBootMax.
[[nodiscard]] SessionNumber first_number(std::uint64_t boot);

/// What a token says in clear.
struct SessionToken {
  NodeIndex index;                     ///< of the node id
  SessionNumber number = 0;            ///< of the session
  std::chrono::milliseconds expiry{};  ///< since 1970: not honoured from then on
  friend bool operator==(const SessionToken&, const SessionToken&) = default;
};

/// For whom a token is good. Its MAC covers this beside what it says; it is not in the token.
struct TokenHolder {
  HubId hub;
  std::string_view name;  ///< "": a node without one
  Identity identity;      ///< who the peer is, as its connection proves it
};

inline constexpr std::size_t kSessionTokenBytes = 56;

/// The bytes of a token: what it says, and an HMAC-SHA256 by the hub's secret over that and its
/// holder.
[[nodiscard]] std::vector<std::byte> write_token(const SessionToken& token,
                                                 const TokenHolder& holder, const Secret& secret);
/// What the bytes say, whoever wrote them; nothing if they are no token.
[[nodiscard]] std::optional<SessionToken> read_token(std::span<const std::byte> bytes);
/// Did a hub with this secret write these bytes for that holder? Takes as long for a wrong MAC as
/// for the right one.
[[nodiscard]] bool is_genuine(std::span<const std::byte> bytes, const TokenHolder& holder,
                              const Secret& secret);

}  // namespace gimnet::hub
