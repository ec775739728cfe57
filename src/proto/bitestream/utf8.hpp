#pragma once

#include <cstddef>

namespace gimnet::proto::bitestream {

/// True for well-formed UTF-8 (RFC 3629): no overlong forms, no surrogates, nothing over U+10FFFF.
/// Thread safety: a pure function.
[[nodiscard]] bool valid_utf8(const unsigned char* bytes, std::size_t size);

}  // namespace gimnet::proto::bitestream
