#include "hub/crypto/hmac.hpp"

#include <openssl/crypto.h>
#include <openssl/evp.h>
#include <openssl/hmac.h>

#include "base/check.hpp"

namespace gimnet::hub {
namespace {

const unsigned char* as_chars(const std::byte* bytes) {
  return reinterpret_cast<const unsigned char*>(bytes);
}
unsigned char* as_chars(std::byte* bytes) { return reinterpret_cast<unsigned char*>(bytes); }

}  // namespace

Digest hmac_sha256(const Secret& key, std::span<const std::byte> text) {
  Digest digest{};
  unsigned int size = 0;
  const unsigned char* done =
      ::HMAC(::EVP_sha256(), key.data(), static_cast<int>(key.size()), as_chars(text.data()),
             text.size(), as_chars(digest.data()), &size);
  // Fails only without memory; a token without its proof must not leave.
  GIMNET_CHECK(done != nullptr && size == digest.size());
  return digest;
}

Digest sha256(std::span<const std::byte> text) {
  Digest digest{};
  unsigned int size = 0;
  const int done = ::EVP_Digest(text.data(), text.size(), as_chars(digest.data()), &size,
                                ::EVP_sha256(), nullptr);
  GIMNET_CHECK(done == 1 && size == digest.size());
  return digest;
}

bool same_bytes(std::span<const std::byte> a, std::span<const std::byte> b) {
  return a.size() == b.size() && ::CRYPTO_memcmp(a.data(), b.data(), a.size()) == 0;
}

}  // namespace gimnet::hub
