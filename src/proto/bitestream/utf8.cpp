#include "proto/bitestream/utf8.hpp"

namespace gimnet::proto::bitestream {
namespace {

/// The followers that a leading byte asks for: their number, and the range of the first one. By
/// that range RFC 3629 excludes overlong forms, surrogates and codes over U+10FFFF.
struct Sequence {
  std::size_t followers;
  unsigned char first_min;
  unsigned char first_max;
};

constexpr Sequence sequence_of(unsigned char lead) {
  if (lead < 0x80) return {0, 0, 0};
  if (lead >= 0xC2 && lead <= 0xDF) return {1, 0x80, 0xBF};
  if (lead == 0xE0) return {2, 0xA0, 0xBF};
  if (lead == 0xED) return {2, 0x80, 0x9F};
  if (lead >= 0xE1 && lead <= 0xEF) return {2, 0x80, 0xBF};
  if (lead == 0xF0) return {3, 0x90, 0xBF};
  if (lead >= 0xF1 && lead <= 0xF3) return {3, 0x80, 0xBF};
  if (lead == 0xF4) return {3, 0x80, 0x8F};
  return {1, 1, 0};  // not a leading byte: no follower fits
}

}  // namespace

bool valid_utf8(const unsigned char* bytes, std::size_t size) {
  std::size_t at = 0;
  while (at < size) {
    const Sequence sequence = sequence_of(bytes[at++]);
    if (sequence.followers == 0) continue;
    if (size - at < sequence.followers) return false;
    if (bytes[at] < sequence.first_min || bytes[at] > sequence.first_max) return false;
    for (std::size_t i = 1; i < sequence.followers; ++i) {
      if ((bytes[at + i] & 0xC0) != 0x80) return false;
    }
    at += sequence.followers;
  }
  return true;
}

}  // namespace gimnet::proto::bitestream
