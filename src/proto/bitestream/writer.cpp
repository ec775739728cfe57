#include "proto/bitestream/writer.hpp"

#include <cstdlib>
#include <cstring>

#include "proto/bitestream/utf8.hpp"

// The implementation behind gimnet/bitestream.h. It links without the C++ library: no exceptions,
// no operator new.

namespace gimnet::proto::bitestream {
namespace {

constexpr std::size_t kFirstCapacity = 64;

bool set_status(bitestream_writer* writer, Status status) {
  if (writer->status == BITESTREAM_OK) writer->status = status;
  return false;
}

/// Room for `more` bytes behind what is written.
bool make_room(bitestream_writer* writer, std::size_t more) {
  if (writer->capacity - writer->size >= more) return true;
  if (!writer->growable || more > SIZE_MAX / 4) return set_status(writer, BITESTREAM_NO_ROOM);
  std::size_t capacity = writer->capacity == 0 ? kFirstCapacity : writer->capacity * 2;
  if (capacity - writer->size < more) capacity = writer->size + more;
  void* grown = std::realloc(writer->bytes, capacity);
  if (grown == nullptr) return set_status(writer, BITESTREAM_NO_ROOM);
  writer->bytes = static_cast<unsigned char*>(grown);
  writer->capacity = capacity;
  return true;
}

bool valid_key(const bitestream_key& key) {
  if (key.text == nullptr) return key.number <= BITESTREAM_KEY_NUMBER_MAX;
  return key.text_size >= 1 && key.text_size <= BITESTREAM_KEY_TEXT_MAX &&
         valid_utf8(reinterpret_cast<const unsigned char*>(key.text), key.text_size);
}

std::size_t key_size(const bitestream_key& key) {
  return key.text == nullptr ? kNumberKeySize : 1 + std::size_t{key.text_size};
}

struct LengthField {
  unsigned code;  ///< bits 0-1 of the head
  std::size_t size;
};

/// The smallest one that holds the length.
constexpr LengthField length_field(std::size_t length) {
  if (length <= 0xFF) return {0, 1};
  if (length <= 0xFFFF) return {1, 2};
  return {2, 4};
}

/// Integers are little-endian, as every machine is that this builds for.
unsigned char* store(unsigned char* at, std::uint32_t value, std::size_t size) {
  std::memcpy(at, &value, size);
  return at + size;
}

/// Head and key; returns where the length goes. REQUIRES: a valid key and room.
unsigned char* store_label(unsigned char* at, const bitestream_key& key, Type type,
                           unsigned length_code) {
  const unsigned text_bit = key.text == nullptr ? 0 : kTextKeyBit;
  *at++ = static_cast<unsigned char>((static_cast<unsigned>(type) << kTypeShift) | text_bit |
                                     length_code);
  if (key.text == nullptr) return store(at, key.number, kNumberKeySize);
  *at++ = static_cast<unsigned char>(key.text_size);
  std::memcpy(at, key.text, key.text_size);
  return at + key.text_size;
}

/// False: a bool in it is neither 0 nor 1, or a text is not UTF-8.
bool valid_content(Type type, const unsigned char* bytes, std::size_t size) {
  if (type == BITESTREAM_TEXT) return valid_utf8(bytes, size);
  if (element_type(type) != BITESTREAM_BOOL) return true;
  for (std::size_t i = 0; i < size; ++i) {
    if (bytes[i] > 1) return false;
  }
  return true;
}

void put(bitestream_writer* writer, const bitestream_key& key, Type type, const void* bytes,
         std::size_t size) {
  if (writer->status != BITESTREAM_OK) return;
  if (!valid_key(key)) {
    set_status(writer, BITESTREAM_BAD_KEY);
    return;
  }
  if (size == 0 && unit_size(type) == 0) return;
  if (size == 0 && is_array(type)) return;
  if (bytes == nullptr || !size_fits(type, size) ||
      !valid_content(type, static_cast<const unsigned char*>(bytes), size)) {
    set_status(writer, BITESTREAM_BAD_VALUE);
    return;
  }
  const LengthField length = length_field(size);
  const std::size_t whole = 1 + key_size(key) + length.size + size;
  if (!make_room(writer, whole)) return;
  unsigned char* at = store_label(writer->bytes + writer->size, key, type, length.code);
  at = store(at, static_cast<std::uint32_t>(size), length.size);
  std::memcpy(at, bytes, size);
  writer->size += whole;
}

/// The offset of the content of the nested stream that starts at `start`. Its length field has 1
/// byte until it ends.
std::size_t content_offset(const bitestream_writer* writer, std::size_t start) {
  const bool text_key = (writer->bytes[start] & kTextKeyBit) != 0;
  return start + 1 + (text_key ? 1 + std::size_t{writer->bytes[start + 1]} : kNumberKeySize) + 1;
}

}  // namespace
}  // namespace gimnet::proto::bitestream

using namespace gimnet::proto::bitestream;

extern "C" {

bool bitestream_keys_equal(bitestream_key a, bitestream_key b) {
  if (a.text == nullptr || b.text == nullptr) return a.text == b.text && a.number == b.number;
  return a.text_size == b.text_size && std::memcmp(a.text, b.text, a.text_size) == 0;
}

bitestream_writer bitestream_writer_over(void* memory, size_t size) {
  const std::size_t capacity = memory == nullptr ? 0 : size;
  return {static_cast<unsigned char*>(memory), 0, capacity, false, BITESTREAM_OK, 0, {}};
}

bitestream_writer bitestream_writer_growable(void) {
  return {nullptr, 0, 0, true, BITESTREAM_OK, 0, {}};
}

void bitestream_writer_free(bitestream_writer* writer) {
  if (writer->growable) std::free(writer->bytes);
  *writer = bitestream_writer_growable();
}

bitestream_status bitestream_finish(const bitestream_writer* writer) {
  if (writer->status != BITESTREAM_OK) return writer->status;
  return writer->depth == 0 ? BITESTREAM_OK : BITESTREAM_NOT_BALANCED;
}

void bitestream_put_opaque(bitestream_writer* writer, bitestream_key key, const void* bytes,
                           size_t size) {
  put(writer, key, BITESTREAM_OPAQUE, bytes, size);
}
void bitestream_put_bool(bitestream_writer* writer, bitestream_key key, bool value) {
  const unsigned char byte = value ? 1 : 0;
  put(writer, key, BITESTREAM_BOOL, &byte, sizeof byte);
}
void bitestream_put_u8(bitestream_writer* writer, bitestream_key key, uint8_t value) {
  put(writer, key, BITESTREAM_U8, &value, sizeof value);
}
void bitestream_put_u16(bitestream_writer* writer, bitestream_key key, uint16_t value) {
  put(writer, key, BITESTREAM_U16, &value, sizeof value);
}
void bitestream_put_u32(bitestream_writer* writer, bitestream_key key, uint32_t value) {
  put(writer, key, BITESTREAM_U32, &value, sizeof value);
}
void bitestream_put_u64(bitestream_writer* writer, bitestream_key key, uint64_t value) {
  put(writer, key, BITESTREAM_U64, &value, sizeof value);
}
void bitestream_put_i8(bitestream_writer* writer, bitestream_key key, int8_t value) {
  put(writer, key, BITESTREAM_I8, &value, sizeof value);
}
void bitestream_put_i16(bitestream_writer* writer, bitestream_key key, int16_t value) {
  put(writer, key, BITESTREAM_I16, &value, sizeof value);
}
void bitestream_put_i32(bitestream_writer* writer, bitestream_key key, int32_t value) {
  put(writer, key, BITESTREAM_I32, &value, sizeof value);
}
void bitestream_put_i64(bitestream_writer* writer, bitestream_key key, int64_t value) {
  put(writer, key, BITESTREAM_I64, &value, sizeof value);
}
void bitestream_put_f32(bitestream_writer* writer, bitestream_key key, float value) {
  put(writer, key, BITESTREAM_F32, &value, sizeof value);
}
void bitestream_put_f64(bitestream_writer* writer, bitestream_key key, double value) {
  put(writer, key, BITESTREAM_F64, &value, sizeof value);
}
void bitestream_put_text(bitestream_writer* writer, bitestream_key key, const char* text,
                         size_t size) {
  put(writer, key, BITESTREAM_TEXT, text, size);
}
void bitestream_put_time(bitestream_writer* writer, bitestream_key key, int64_t ns) {
  put(writer, key, BITESTREAM_TIME, &ns, sizeof ns);
}

void bitestream_put_array(bitestream_writer* writer, bitestream_key key, bitestream_type type,
                          const void* elements, size_t count) {
  // By division: a product could begin anew at 0 where size_t has 32 bits.
  const bool legal = is_array(type) && is_known_type(type) &&
                     count <= BITESTREAM_VALUE_BYTES_MAX / unit_size(type);
  if (!legal) {
    set_status(writer, BITESTREAM_BAD_VALUE);
    return;
  }
  put(writer, key, type, elements, count * unit_size(type));
}

void bitestream_put_value(bitestream_writer* writer, bitestream_key key, bitestream_type type,
                          const void* bytes, size_t size) {
  if (!is_known_type(type) || type == BITESTREAM_NESTED) {
    set_status(writer, BITESTREAM_BAD_VALUE);
    return;
  }
  put(writer, key, type, bytes, size);
}

void bitestream_begin_nested(bitestream_writer* writer, bitestream_key key) {
  if (writer->status != BITESTREAM_OK) return;
  if (!valid_key(key)) {
    set_status(writer, BITESTREAM_BAD_KEY);
  } else if (writer->depth == BITESTREAM_DEPTH_MAX) {
    set_status(writer, BITESTREAM_TOO_DEEP);
  } else if (make_room(writer, 1 + key_size(key) + 1)) {
    writer->open[writer->depth++] = writer->size;
    unsigned char* at = store_label(writer->bytes + writer->size, key, BITESTREAM_NESTED, 0);
    *at = 0;  // the length, known and given its final size at the end
    writer->size += 1 + key_size(key) + 1;
  }
}

void bitestream_end_nested(bitestream_writer* writer) {
  if (writer->status != BITESTREAM_OK) return;
  if (writer->depth == 0) {
    set_status(writer, BITESTREAM_NOT_BALANCED);
    return;
  }
  const std::size_t start = writer->open[--writer->depth];
  const std::size_t content = content_offset(writer, start);
  const std::size_t size = writer->size - content;
  if (size == 0) {
    writer->size = start;
    return;
  }
  if (size > BITESTREAM_VALUE_BYTES_MAX) {
    set_status(writer, BITESTREAM_BAD_VALUE);
    return;
  }
  const LengthField length = length_field(size);
  const std::size_t wider = length.size - 1;
  if (!make_room(writer, wider)) return;
  unsigned char* field = writer->bytes + content - 1;
  if (wider != 0) std::memmove(field + 1 + wider, field + 1, size);
  store(field, static_cast<std::uint32_t>(size), length.size);
  writer->bytes[start] = static_cast<unsigned char>(writer->bytes[start] | length.code);
  writer->size += wider;
}

}  // extern "C"
