#include "proto/bitestream/reader.hpp"

#include <cstring>

#include "proto/bitestream/utf8.hpp"

// The implementation behind gimnet/bitestream.h. It links without the C++ library: no exceptions,
// no operator new.

namespace gimnet::proto::bitestream {
namespace {

/// Bytes from the reader's place on; every step forward is checked against what is left.
class Cursor {
 public:
  explicit Cursor(const bitestream_reader& reader)
      : at_(reader.bytes + reader.offset), left_(reader.size - reader.offset) {}

  [[nodiscard]] const unsigned char* at() const { return at_; }
  [[nodiscard]] std::size_t left() const { return left_; }
  /// False: there are fewer bytes left.
  [[nodiscard]] bool skip(std::size_t size) {
    if (size > left_) return false;
    at_ += size;
    left_ -= size;
    return true;
  }
  /// A little-endian number of 1 to 4 bytes. False: there are fewer bytes left.
  [[nodiscard]] bool take(std::size_t size, std::uint32_t* number) {
    if (size > left_) return false;
    *number = 0;
    std::memcpy(number, at_, size);
    return skip(size);
  }

 private:
  const unsigned char* at_;
  std::size_t left_;
};

bool take_key(Cursor& cursor, bool is_text, bitestream_key* key) {
  *key = {nullptr, 0, 0};
  if (!is_text) return cursor.take(kNumberKeySize, &key->number);
  if (!cursor.take(1, &key->text_size) || key->text_size == 0) return false;
  const unsigned char* text = cursor.at();
  if (!cursor.skip(key->text_size)) return false;
  key->text = reinterpret_cast<const char*>(text);
  return valid_utf8(text, key->text_size);
}

bool take_value(Cursor& cursor, bitestream_value* value) {
  std::uint32_t head = 0;
  if (!cursor.take(1, &head)) return false;
  const std::uint32_t length_code = head & kLengthSizeMask;
  if (length_code == kLengthSizeInvalid || !is_known_type(head >> kTypeShift)) return false;
  value->type = static_cast<Type>(head >> kTypeShift);
  if (!take_key(cursor, (head & kTextKeyBit) != 0, &value->key)) return false;
  if (!cursor.take(std::size_t{1} << length_code, &value->size)) return false;
  if (!size_fits(value->type, value->size)) return false;
  value->bytes = cursor.at();
  return cursor.skip(value->size);
}

/// Checks what one look can decide, so that a step stays O(1).
bool legal_at_depth(const bitestream_value& value, std::uint32_t depth) {
  if (value.type == BITESTREAM_BOOL) return value.bytes[0] <= 1;
  return value.type != BITESTREAM_NESTED || depth < BITESTREAM_DEPTH_MAX;
}

bool valid_content(const bitestream_value& value) {
  if (value.type == BITESTREAM_TEXT) return valid_utf8(value.bytes, value.size);
  if (value.type != BITESTREAM_BOOL_ARRAY) return true;
  for (std::size_t i = 0; i < value.size; ++i) {
    if (value.bytes[i] > 1) return false;
  }
  return true;
}

template <Number T>
bool get_number(const bitestream_value* value, T* out) {
  const auto number = load_number<T>(value->type, value->bytes);
  if (number) *out = *number;
  return number.has_value();
}

}  // namespace
}  // namespace gimnet::proto::bitestream

using namespace gimnet::proto::bitestream;

extern "C" {

bitestream_reader bitestream_reader_over(const void* bytes, size_t size) {
  return {static_cast<const unsigned char*>(bytes), size, 0, 0};
}

bitestream_status bitestream_next(bitestream_reader* reader, bitestream_value* value) {
  if (reader->offset == reader->size) return BITESTREAM_END;
  if (reader->bytes == nullptr) return BITESTREAM_MALFORMED;
  Cursor cursor(*reader);
  if (!take_value(cursor, value) || !legal_at_depth(*value, reader->depth))
    return BITESTREAM_MALFORMED;
  value->depth = reader->depth;
  reader->offset = reader->size - cursor.left();
  return BITESTREAM_OK;
}

bitestream_status bitestream_find(const bitestream_reader* reader, bitestream_key key,
                                  bitestream_value* value) {
  bitestream_reader scan = *reader;
  scan.offset = 0;
  for (;;) {
    bitestream_value found;
    const bitestream_status status = bitestream_next(&scan, &found);
    if (status != BITESTREAM_OK) return status;
    if (!bitestream_keys_equal(found.key, key)) continue;
    *value = found;
    return BITESTREAM_OK;
  }
}

bitestream_status bitestream_check(const void* bytes, size_t size) {
  bitestream_reader open[BITESTREAM_DEPTH_MAX + 1];
  std::size_t depth = 0;
  open[0] = bitestream_reader_over(bytes, size);
  for (;;) {
    bitestream_value value;
    const bitestream_status status = bitestream_next(&open[depth], &value);
    if (status == BITESTREAM_MALFORMED) return status;
    if (status == BITESTREAM_END) {
      if (depth == 0) return BITESTREAM_OK;
      --depth;
    } else if (value.type == BITESTREAM_NESTED) {
      // Fits: a reader at the largest depth gives no nested value.
      bitestream_get_nested(&value, &open[++depth]);
    } else if (!valid_content(value)) {
      return BITESTREAM_MALFORMED;
    }
  }
}

bool bitestream_get_u8(const bitestream_value* value, uint8_t* out) {
  return get_number(value, out);
}
bool bitestream_get_u16(const bitestream_value* value, uint16_t* out) {
  return get_number(value, out);
}
bool bitestream_get_u32(const bitestream_value* value, uint32_t* out) {
  return get_number(value, out);
}
bool bitestream_get_u64(const bitestream_value* value, uint64_t* out) {
  return get_number(value, out);
}
bool bitestream_get_i8(const bitestream_value* value, int8_t* out) {
  return get_number(value, out);
}
bool bitestream_get_i16(const bitestream_value* value, int16_t* out) {
  return get_number(value, out);
}
bool bitestream_get_i32(const bitestream_value* value, int32_t* out) {
  return get_number(value, out);
}
bool bitestream_get_i64(const bitestream_value* value, int64_t* out) {
  return get_number(value, out);
}
bool bitestream_get_f32(const bitestream_value* value, float* out) {
  return get_number(value, out);
}
bool bitestream_get_f64(const bitestream_value* value, double* out) {
  return get_number(value, out);
}

bool bitestream_get_bool(const bitestream_value* value, bool* out) {
  if (value->type != BITESTREAM_BOOL || value->bytes[0] > 1) return false;
  *out = value->bytes[0] == 1;
  return true;
}

bool bitestream_get_time(const bitestream_value* value, int64_t* ns) {
  if (value->type != BITESTREAM_TIME) return false;
  std::memcpy(ns, value->bytes, sizeof *ns);
  return true;
}

bool bitestream_get_text(const bitestream_value* value, const char** text, size_t* size) {
  if (value->type != BITESTREAM_TEXT || !valid_utf8(value->bytes, value->size)) return false;
  *text = reinterpret_cast<const char*>(value->bytes);
  *size = value->size;
  return true;
}

bool bitestream_get_opaque(const bitestream_value* value, const void** bytes, size_t* size) {
  if (value->type != BITESTREAM_OPAQUE) return false;
  *bytes = value->bytes;
  *size = value->size;
  return true;
}

bool bitestream_get_nested(const bitestream_value* value, bitestream_reader* nested) {
  if (value->type != BITESTREAM_NESTED) return false;
  *nested = {value->bytes, value->size, 0, value->depth + 1};
  return true;
}

size_t bitestream_count(const bitestream_value* value) {
  return is_array(value->type) ? value->size / unit_size(value->type) : 0;
}

bool bitestream_element(const bitestream_value* value, size_t index, bitestream_value* element) {
  if (index >= bitestream_count(value)) return false;
  const std::size_t unit = unit_size(value->type);
  *element = {value->key, element_type(value->type), static_cast<uint32_t>(unit),
              value->bytes + index * unit, value->depth};
  return true;
}

}  // extern "C"
