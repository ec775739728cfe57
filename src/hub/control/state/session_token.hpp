#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "base/endian.hpp"
#include "base/ids.hpp"
#include "hub/control/state/identity.hpp"
#include "hub/crypto/hmac.hpp"

// The token that a node shows to get its session back (docs/protocol.md, section 3). The layout is
// the hub's own matter; to nodes a token is opaque. Thread safety: value types and pure functions.

namespace gimnet::hub {

/// The fields that a MAC of the hub covers, written so that no two lists of fields give the same
/// bytes. Thread safety: none.
class MacText {
 public:
  /// `purpose` keeps this use of the hub's secret apart from any other.
  explicit MacText(std::string_view purpose) {
    bytes_.reserve(512);
    add(purpose);
  }

  MacText& add(std::string_view text) {
    add_number(static_cast<std::uint32_t>(text.size()));
    return add_bytes(std::as_bytes(std::span{text}));
  }
  template <class Number>
  MacText& add_number(Number number) {
    std::byte bytes[sizeof(Number)];
    store_le(bytes, number);
    return add_bytes(bytes);
  }
  /// Of one length always.
  MacText& add_bytes(std::span<const std::byte> bytes) {
    bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
    return *this;
  }
  /// Valid until: the next call.
  [[nodiscard]] std::span<const std::byte> bytes() const { return bytes_; }

 private:
  std::vector<std::byte> bytes_;
};

/// Numbers the sessions of a hub over all its starts, ascending: the boot number in the top 24
/// bits, then a count.
using SessionNumber = std::uint64_t;
inline constexpr std::uint64_t kBootMax = (1u << 24) - 1;
/// The number before the first session of that start. REQUIRES: boot <= kBootMax.
[[nodiscard]] SessionNumber first_number(std::uint64_t boot);

/// The content of a token, which is not encrypted.
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
/// Reads a token without a check of its MAC; nothing if the bytes are none.
[[nodiscard]] std::optional<SessionToken> read_token(std::span<const std::byte> bytes);
/// Did a hub with this secret write these bytes for that holder? Takes as long for a wrong MAC as
/// for the right one.
[[nodiscard]] bool is_genuine(std::span<const std::byte> bytes, const TokenHolder& holder,
                              const Secret& secret);

}  // namespace gimnet::hub
