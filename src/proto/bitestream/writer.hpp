#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <utility>

#include "gimnet/bitestream.h"
#include "proto/bitestream/format.hpp"

namespace gimnet::proto::bitestream {

/// A label: a number of 24 bits, or 1..255 bytes of UTF-8, which is not copied. Both convert by
/// themselves.
class Key {
 public:
  constexpr Key(std::uint32_t number) : key_{nullptr, number, 0} {}
  constexpr Key(std::string_view text) : key_{text.data(), 0, clamped(text.size())} {}
  constexpr Key(const char* text) : Key(std::string_view(text)) {}
  constexpr explicit Key(const bitestream_key& key) : key_(key) {}

  [[nodiscard]] constexpr bool is_text() const { return key_.text != nullptr; }
  [[nodiscard]] constexpr std::uint32_t number() const { return key_.number; }
  [[nodiscard]] constexpr std::string_view text() const {
    return is_text() ? std::string_view(key_.text, key_.text_size) : std::string_view();
  }
  [[nodiscard]] constexpr const bitestream_key& raw() const { return key_; }
  friend bool operator==(const Key& a, const Key& b) {
    return bitestream_keys_equal(a.key_, b.key_);
  }

 private:
  static constexpr std::uint32_t clamped(std::size_t size) {
    return size <= BITESTREAM_KEY_TEXT_MAX ? static_cast<std::uint32_t>(size)
                                           : BITESTREAM_KEY_TEXT_MAX + 1;
  }
  bitestream_key key_;
};

/// Writes a Bitestream: the C++ face of gimnet/bitestream.h, where errors and limits are described.
/// The first error stays, and finish() tells it. Values of no bytes are left out. Thread safety:
/// one thread. Ownership: of its memory, unless constructed over the caller's.
class Writer {
 public:
  /// Allocates as it grows.
  Writer() : state_(bitestream_writer_growable()) {}
  /// Writes into memory that outlives the writer, and allocates nothing.
  explicit Writer(std::span<std::byte> memory)
      : state_(bitestream_writer_over(memory.data(), memory.size())) {}
  Writer(Writer&& other) noexcept
      : state_(std::exchange(other.state_, bitestream_writer_growable())) {}
  Writer& operator=(Writer&& other) noexcept {
    std::swap(state_, other.state_);
    return *this;
  }
  Writer(const Writer&) = delete;
  Writer& operator=(const Writer&) = delete;
  ~Writer() { bitestream_writer_free(&state_); }

  void put_opaque(Key key, std::span<const std::byte> bytes) {
    bitestream_put_opaque(&state_, key.raw(), bytes.data(), bytes.size());
  }
  void put_bool(Key key, bool value) { bitestream_put_bool(&state_, key.raw(), value); }
  void put_u8(Key key, std::uint8_t value) { bitestream_put_u8(&state_, key.raw(), value); }
  void put_u16(Key key, std::uint16_t value) { bitestream_put_u16(&state_, key.raw(), value); }
  void put_u32(Key key, std::uint32_t value) { bitestream_put_u32(&state_, key.raw(), value); }
  void put_u64(Key key, std::uint64_t value) { bitestream_put_u64(&state_, key.raw(), value); }
  void put_i8(Key key, std::int8_t value) { bitestream_put_i8(&state_, key.raw(), value); }
  void put_i16(Key key, std::int16_t value) { bitestream_put_i16(&state_, key.raw(), value); }
  void put_i32(Key key, std::int32_t value) { bitestream_put_i32(&state_, key.raw(), value); }
  void put_i64(Key key, std::int64_t value) { bitestream_put_i64(&state_, key.raw(), value); }
  void put_f32(Key key, float value) { bitestream_put_f32(&state_, key.raw(), value); }
  void put_f64(Key key, double value) { bitestream_put_f64(&state_, key.raw(), value); }
  void put_text(Key key, std::string_view text) {
    bitestream_put_text(&state_, key.raw(), text.data(), text.size());
  }
  void put_time(Key key, std::int64_t ns) { bitestream_put_time(&state_, key.raw(), ns); }

  void put_array(Key key, std::span<const std::uint8_t> values) {
    put_elements(key, BITESTREAM_U8_ARRAY, values);
  }
  void put_array(Key key, std::span<const std::uint16_t> values) {
    put_elements(key, BITESTREAM_U16_ARRAY, values);
  }
  void put_array(Key key, std::span<const std::uint32_t> values) {
    put_elements(key, BITESTREAM_U32_ARRAY, values);
  }
  void put_array(Key key, std::span<const std::uint64_t> values) {
    put_elements(key, BITESTREAM_U64_ARRAY, values);
  }
  void put_array(Key key, std::span<const std::int8_t> values) {
    put_elements(key, BITESTREAM_I8_ARRAY, values);
  }
  void put_array(Key key, std::span<const std::int16_t> values) {
    put_elements(key, BITESTREAM_I16_ARRAY, values);
  }
  void put_array(Key key, std::span<const std::int32_t> values) {
    put_elements(key, BITESTREAM_I32_ARRAY, values);
  }
  void put_array(Key key, std::span<const std::int64_t> values) {
    put_elements(key, BITESTREAM_I64_ARRAY, values);
  }
  void put_array(Key key, std::span<const float> values) {
    put_elements(key, BITESTREAM_F32_ARRAY, values);
  }
  void put_array(Key key, std::span<const double> values) {
    put_elements(key, BITESTREAM_F64_ARRAY, values);
  }
  void put_array(Key key, std::span<const bool> values) {
    put_elements(key, BITESTREAM_BOOL_ARRAY, values);
  }
  void put_time_array(Key key, std::span<const std::int64_t> ns) {
    put_elements(key, BITESTREAM_TIME_ARRAY, ns);
  }

  /// A value as it stands on the wire, of any type but a nested one.
  void put_value(Key key, Type type, std::span<const std::byte> bytes) {
    bitestream_put_value(&state_, key.raw(), type, bytes.data(), bytes.size());
  }

  /// Values that are put between the two calls belong to the nested stream.
  void begin_nested(Key key) { bitestream_begin_nested(&state_, key.raw()); }
  void end_nested() { bitestream_end_nested(&state_); }

  /// BITESTREAM_OK: bytes() is a whole stream.
  [[nodiscard]] Status finish() const { return bitestream_finish(&state_); }
  /// Valid until: the next value is put.
  [[nodiscard]] std::span<const std::byte> bytes() const {
    return {reinterpret_cast<const std::byte*>(state_.bytes), state_.size};
  }
  [[nodiscard]] std::size_t size() const { return state_.size; }

 private:
  template <class Element>
  void put_elements(Key key, Type type, std::span<const Element> values) {
    bitestream_put_array(&state_, key.raw(), type, values.data(), values.size());
  }

  bitestream_writer state_;
};

}  // namespace gimnet::proto::bitestream
