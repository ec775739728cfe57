#include "hub/control/state/session_token.hpp"

#include <algorithm>

#include "base/check.hpp"
#include "base/endian.hpp"

namespace gimnet::hub {
namespace {

constexpr unsigned kCountBits = 40;
constexpr std::uint32_t kTokenVersion = 1;

// Layout: u32 version, u32 index, u64 session number, i64 expiry in ms since 1970, MAC.
constexpr std::size_t kIndexAt = 4;
constexpr std::size_t kNumberAt = 8;
constexpr std::size_t kExpiryAt = 16;
constexpr std::size_t kMacAt = 24;
static_assert(kMacAt + std::tuple_size_v<Digest> == kSessionTokenBytes);

constexpr std::string_view kPurpose = "GIMnet session token";

Digest mac_of(std::span<const std::byte> clear, const TokenHolder& holder, const Secret& secret) {
  MacText text(kPurpose);
  text.add_number(holder.hub.value()).add(holder.name).add(holder.identity.text()).add_bytes(clear);
  return hmac_sha256(secret, text.bytes());
}

}  // namespace

SessionNumber first_number(std::uint64_t boot) {
  GIMNET_CHECK(boot <= kBootMax);
  return boot << kCountBits;
}

std::vector<std::byte> write_token(const SessionToken& token, const TokenHolder& holder,
                                   const Secret& secret) {
  std::vector<std::byte> bytes(kMacAt);
  store_le(bytes.data(), kTokenVersion);
  store_le(bytes.data() + kIndexAt, token.index.value());
  store_le(bytes.data() + kNumberAt, token.number);
  store_le(bytes.data() + kExpiryAt, static_cast<std::uint64_t>(token.expiry.count()));
  const Digest mac = mac_of(bytes, holder, secret);
  bytes.insert(bytes.end(), mac.begin(), mac.end());
  return bytes;
}

std::optional<SessionToken> read_token(std::span<const std::byte> bytes) {
  if (bytes.size() != kSessionTokenBytes || load_le<std::uint32_t>(bytes.data()) != kTokenVersion)
    return std::nullopt;
  SessionToken token;
  token.index = NodeIndex{load_le<std::uint32_t>(bytes.data() + kIndexAt)};
  token.number = load_le<std::uint64_t>(bytes.data() + kNumberAt);
  token.expiry = std::chrono::milliseconds{
      static_cast<std::int64_t>(load_le<std::uint64_t>(bytes.data() + kExpiryAt))};
  return token;
}

bool is_genuine(std::span<const std::byte> bytes, const TokenHolder& holder, const Secret& secret) {
  if (bytes.size() != kSessionTokenBytes) return false;
  const Digest mac = mac_of(bytes.first(kMacAt), holder, secret);
  return same_bytes(bytes.subspan(kMacAt), mac);
}

}  // namespace gimnet::hub
