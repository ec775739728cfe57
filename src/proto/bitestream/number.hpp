#pragma once

#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <optional>
#include <type_traits>
#include <utility>

#include "proto/bitestream/format.hpp"

// Conversion between number types where no value is lost.
// Thread safety: pure functions.

namespace gimnet::proto::bitestream {

template <class T>
concept Number = (std::integral<T> && !std::same_as<T, bool>) || std::same_as<T, float> ||
                 std::same_as<T, double>;

/// True if a floating number holds the integer exactly: its bits from the first to the last one set
/// fit in.
template <std::floating_point To, std::integral From>
[[nodiscard]] constexpr bool holds_exactly(From value) {
  using Unsigned = std::make_unsigned_t<From>;
  const auto magnitude = static_cast<std::uint64_t>(
      value < From{0} ? static_cast<Unsigned>(Unsigned{0} - static_cast<Unsigned>(value))
                      : static_cast<Unsigned>(value));
  if (magnitude == 0) return true;
  return 64 - std::countl_zero(magnitude) - std::countr_zero(magnitude) <=
         std::numeric_limits<To>::digits;
}

/// The same number as another type; nothing where it is not the same. NaN stays NaN, -0.0 becomes
/// 0.
template <Number To, Number From>
[[nodiscard]] constexpr std::optional<To> convert_number(From value) {
  if constexpr (std::integral<To> && std::integral<From>) {
    if (!std::in_range<To>(value)) return std::nullopt;
    return static_cast<To>(value);
  } else if constexpr (std::integral<From>) {
    if (!holds_exactly<To>(value)) return std::nullopt;
    return static_cast<To>(value);
  } else if constexpr (std::integral<To>) {
    // Both bounds are powers of two (or 0), so exact; the upper one is the first value that does
    // not fit.
    constexpr auto kMin = static_cast<From>(std::numeric_limits<To>::min());
    constexpr auto kEnd =
        static_cast<From>(static_cast<To>(To{1} << (std::numeric_limits<To>::digits - 1))) *
        From{2};
    if (!(value >= kMin && value < kEnd)) return std::nullopt;
    const auto converted = static_cast<To>(value);
    if (static_cast<From>(converted) != value) return std::nullopt;
    return converted;
  } else {
    constexpr auto kLargest = static_cast<double>(std::numeric_limits<To>::max());
    const bool finite =
        static_cast<double>(value) >= -kLargest && static_cast<double>(value) <= kLargest;
    if (finite && static_cast<From>(static_cast<To>(value)) != value) return std::nullopt;
    const bool special = value != value || value == std::numeric_limits<From>::infinity() ||
                         value == -std::numeric_limits<From>::infinity();
    if (!finite && !special) return std::nullopt;
    return static_cast<To>(value);
  }
}

template <Number Stored, Number To>
[[nodiscard]] std::optional<To> load_number_as(const unsigned char* bytes) {
  Stored stored;
  std::memcpy(&stored, bytes, sizeof stored);
  return convert_number<To>(stored);
}

/// The number at `bytes`, which is stored as `type`. REQUIRES: unit_size(type) readable bytes.
template <Number To>
[[nodiscard]] std::optional<To> load_number(Type type, const unsigned char* bytes) {
  switch (type) {
    case BITESTREAM_U8:
      return load_number_as<std::uint8_t, To>(bytes);
    case BITESTREAM_U16:
      return load_number_as<std::uint16_t, To>(bytes);
    case BITESTREAM_U32:
      return load_number_as<std::uint32_t, To>(bytes);
    case BITESTREAM_U64:
      return load_number_as<std::uint64_t, To>(bytes);
    case BITESTREAM_I8:
      return load_number_as<std::int8_t, To>(bytes);
    case BITESTREAM_I16:
      return load_number_as<std::int16_t, To>(bytes);
    case BITESTREAM_I32:
      return load_number_as<std::int32_t, To>(bytes);
    case BITESTREAM_I64:
      return load_number_as<std::int64_t, To>(bytes);
    case BITESTREAM_F32:
      return load_number_as<float, To>(bytes);
    case BITESTREAM_F64:
      return load_number_as<double, To>(bytes);
    default:
      return std::nullopt;
  }
}

}  // namespace gimnet::proto::bitestream
