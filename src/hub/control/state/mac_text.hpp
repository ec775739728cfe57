#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "base/endian.hpp"

namespace gimnet::hub {

/// What a MAC of the hub covers, field by field, so that no two lists of fields give the same
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

}  // namespace gimnet::hub
