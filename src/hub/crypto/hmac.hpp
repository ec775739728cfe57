#pragma once

#include <array>
#include <cstddef>
#include <span>

// The cryptography of the hub, all of it OpenSSL's (libcrypto): nothing of the kind is written
// here. Thread safety: pure functions.

namespace gimnet::hub {

/// The key of a hub: 32 bytes that nobody can guess.
using Secret = std::array<std::byte, 32>;
/// An HMAC-SHA256, or a SHA-256.
using Digest = std::array<std::byte, 32>;

/// HMAC-SHA256 (RFC 2104, FIPS 180-4) of `text`.
[[nodiscard]] Digest hmac_sha256(const Secret& key, std::span<const std::byte> text);
/// SHA-256 (FIPS 180-4) of `text`.
[[nodiscard]] Digest sha256(std::span<const std::byte> text);
/// Takes as long for equal bytes as for others. False where the sizes differ, which is no secret.
[[nodiscard]] bool same_bytes(std::span<const std::byte> a, std::span<const std::byte> b);

}  // namespace gimnet::hub
