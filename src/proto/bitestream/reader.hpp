#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "gimnet/bitestream.h"
#include "proto/bitestream/format.hpp"
#include "proto/bitestream/number.hpp"
#include "proto/bitestream/writer.hpp"

namespace gimnet::proto::bitestream {

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
