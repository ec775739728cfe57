#pragma once

#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <optional>
#include <span>
#include <string_view>
#include <type_traits>
#include <utility>

#include "gimnet/bitestream.h"
#include "proto/bitestream/format.hpp"
#include "proto/bitestream/writer.hpp"

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

class Reader;

/// One value, in place. Valid until: the bytes that were read change.
/// Errors: each as_...() gives nothing where the type does not fit; numbers convert where no value
/// is lost.
class Value {
 public:
  Value() = default;
  explicit Value(const bitestream_value& value) : value_(value) {}

  [[nodiscard]] Key key() const { return Key(value_.key); }
  [[nodiscard]] Type type() const { return value_.type; }
  [[nodiscard]] std::span<const std::byte> bytes() const {
    return {reinterpret_cast<const std::byte*>(value_.bytes), value_.size};
  }

  template <Number T>
  [[nodiscard]] std::optional<T> as() const {
    return load_number<T>(value_.type, value_.bytes);
  }
  [[nodiscard]] std::optional<bool> as_bool() const {
    bool out = false;
    return bitestream_get_bool(&value_, &out) ? std::optional(out) : std::nullopt;
  }
  /// Nanoseconds since 1970.
  [[nodiscard]] std::optional<std::int64_t> as_time() const {
    std::int64_t ns = 0;
    return bitestream_get_time(&value_, &ns) ? std::optional(ns) : std::nullopt;
  }
  /// Valid UTF-8. Costs a pass over the text.
  [[nodiscard]] std::optional<std::string_view> as_text() const {
    if (value_.type != BITESTREAM_TEXT) return std::nullopt;
    const char* text = nullptr;
    std::size_t size = 0;
    return bitestream_get_text(&value_, &text, &size) ? std::optional(std::string_view(text, size))
                                                      : std::nullopt;
  }
  [[nodiscard]] std::optional<std::span<const std::byte>> as_opaque() const {
    return value_.type == BITESTREAM_OPAQUE ? std::optional(bytes()) : std::nullopt;
  }
  [[nodiscard]] std::optional<Reader> as_nested() const;

  /// Elements of an array; 0 for everything else.
  [[nodiscard]] std::size_t count() const { return bitestream_count(&value_); }
  /// One element as a value of its own.
  [[nodiscard]] std::optional<Value> element(std::size_t index) const {
    bitestream_value out;
    return bitestream_element(&value_, index, &out) ? std::optional(Value(out)) : std::nullopt;
  }

 private:
  bitestream_value value_ = {};
};

/// Reads a Bitestream in place, without allocating or copying; each step costs the same, however
/// large the value. Thread safety: one thread. Errors: hostile bytes end the reading and failed()
/// is true from then on.
class Reader {
 public:
  Reader() : Reader(std::span<const std::byte>()) {}
  explicit Reader(std::span<const std::byte> bytes)
      : state_(bitestream_reader_over(bytes.data(), bytes.size())) {}
  explicit Reader(const bitestream_reader& state) : state_(state) {}

  /// The next value; nothing at the end and where the bytes are malformed.
  [[nodiscard]] std::optional<Value> next() {
    bitestream_value value;
    status_ = bitestream_next(&state_, &value);
    return status_ == BITESTREAM_OK ? std::optional(Value(value)) : std::nullopt;
  }
  /// next() found bytes that are not a Bitestream.
  [[nodiscard]] bool failed() const { return status_ == BITESTREAM_MALFORMED; }

  /// The first value with that key, wherever this reader stands. Costs a step for each value before
  /// it.
  [[nodiscard]] std::optional<Value> find(Key key) const {
    bitestream_value value;
    return bitestream_find(&state_, key.raw(), &value) == BITESTREAM_OK
               ? std::optional(Value(value))
               : std::nullopt;
  }

 private:
  bitestream_reader state_;
  Status status_ = BITESTREAM_OK;
};

inline std::optional<Reader> Value::as_nested() const {
  bitestream_reader nested;
  return bitestream_get_nested(&value_, &nested) ? std::optional(Reader(nested)) : std::nullopt;
}

/// Everything in it is legal, nested streams, texts and bools included. Costs one pass.
[[nodiscard]] inline bool is_valid(std::span<const std::byte> bytes) {
  return bitestream_check(bytes.data(), bytes.size()) == BITESTREAM_OK;
}

}  // namespace gimnet::proto::bitestream
