#pragma once

/* Bitestream: a FIFO of labelled values, written and read in order. The bytes are described in
 * docs/bitestream.md.
 *
 * C11 and C++; needs nothing but the C library. Nothing here keeps global state: different writers
 * and readers can be used by different threads, one of them by one thread at a time. Nothing is
 * ever read or written beyond the sizes given.
 *
 * REQUIRES: writers, readers, values and the places of results are not NULL. Memory, bytes and
 * texts may be: those of size 0 are empty, those of another size are refused (BITESTREAM_NO_ROOM,
 * BITESTREAM_BAD_VALUE, BITESTREAM_MALFORMED).
 *
 *     unsigned char memory[64];
 *     bitestream_writer writer = bitestream_writer_over(memory, sizeof memory);
 *     bitestream_put_text(&writer, bitestream_number_key(3), "robot", 5);
 *     bitestream_put_f64(&writer, bitestream_text_key("v", 1), 0.5);
 *     if (bitestream_finish(&writer) == BITESTREAM_OK) send(memory, writer.size);
 */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "gimnet/export.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Type of a value; the type of an array is the type of its elements plus 16. */
typedef enum bitestream_type {
  BITESTREAM_OPAQUE = 0,
  BITESTREAM_BOOL = 1,
  BITESTREAM_U8 = 2,
  BITESTREAM_U16 = 3,
  BITESTREAM_U32 = 4,
  BITESTREAM_U64 = 5,
  BITESTREAM_I8 = 6,
  BITESTREAM_I16 = 7,
  BITESTREAM_I32 = 8,
  BITESTREAM_I64 = 9,
  BITESTREAM_F32 = 10,
  BITESTREAM_F64 = 11,
  BITESTREAM_TEXT = 12,
  BITESTREAM_TIME = 13,
  BITESTREAM_NESTED = 14,
  BITESTREAM_BOOL_ARRAY = 17,
  BITESTREAM_U8_ARRAY = 18,
  BITESTREAM_U16_ARRAY = 19,
  BITESTREAM_U32_ARRAY = 20,
  BITESTREAM_U64_ARRAY = 21,
  BITESTREAM_I8_ARRAY = 22,
  BITESTREAM_I16_ARRAY = 23,
  BITESTREAM_I32_ARRAY = 24,
  BITESTREAM_I64_ARRAY = 25,
  BITESTREAM_F32_ARRAY = 26,
  BITESTREAM_F64_ARRAY = 27,
  BITESTREAM_TIME_ARRAY = 29
} bitestream_type;

typedef enum bitestream_status {
  BITESTREAM_OK = 0,
  BITESTREAM_END = 1,       /* reader: no more values */
  BITESTREAM_MALFORMED = 2, /* reader: the bytes are not a Bitestream from here on */
  BITESTREAM_NO_ROOM = 3,   /* writer: the caller's memory is full, or the system has none */
  BITESTREAM_BAD_KEY =
      4, /* writer: a number over 24 bits, or a text that is empty, over 255 bytes or not UTF-8 */
  BITESTREAM_BAD_VALUE =
      5, /* writer: over 2^30 bytes, a text that is not UTF-8, a size that is not the type's */
  BITESTREAM_TOO_DEEP = 6,    /* writer: more than 16 nested streams */
  BITESTREAM_NOT_BALANCED = 7 /* writer: nested streams ended more or less often than begun */
} bitestream_status;

#define BITESTREAM_KEY_NUMBER_MAX 0xFFFFFFu
#define BITESTREAM_KEY_TEXT_MAX 255u
#define BITESTREAM_VALUE_BYTES_MAX (1u << 30)
#define BITESTREAM_DEPTH_MAX 16u

/* A label: a number of 24 bits where text is NULL, else 1..255 bytes of UTF-8 (not ended by a
 * zero). */
typedef struct bitestream_key {
  const char* text;
  uint32_t number; /* 0 where text is given */
  uint32_t text_size;
} bitestream_key;

static inline bitestream_key bitestream_number_key(uint32_t number) {
  bitestream_key key = {NULL, number, 0};
  return key;
}
/* The text is not copied. Sizes over 255 bytes are refused when the key is used. */
static inline bitestream_key bitestream_text_key(const char* text, size_t size) {
  bitestream_key key = {
      text, 0, size <= BITESTREAM_KEY_TEXT_MAX ? (uint32_t)size : BITESTREAM_KEY_TEXT_MAX + 1};
  return key;
}
GIMNET_API bool bitestream_keys_equal(bitestream_key a, bitestream_key b);

/* Writing
 * -------------------------------------------------------------------------------------------------
 * The first error stays in `status` and turns every later call into nothing, so that one check at
 * the end, by bitestream_finish(), is enough. A value of no bytes (empty text, array, opaque or
 * nested stream) is left out. */
typedef struct bitestream_writer {
  unsigned char* bytes;
  size_t size; /* written so far */
  size_t capacity;
  bool growable; /* bytes belong to the writer: see bitestream_writer_free() */
  bitestream_status status;
  uint32_t depth;                    /* nested streams begun and not ended */
  size_t open[BITESTREAM_DEPTH_MAX]; /* where each of them starts */
} bitestream_writer;

/* Writes into the caller's memory, which must outlive the writer. */
GIMNET_API bitestream_writer bitestream_writer_over(void* memory, size_t size);
/* Allocates as it grows; free it with bitestream_writer_free(). */
GIMNET_API bitestream_writer bitestream_writer_growable(void);
GIMNET_API void bitestream_writer_free(bitestream_writer* writer);
/* BITESTREAM_OK: bytes[0..size) is a whole stream. */
GIMNET_API bitestream_status bitestream_finish(const bitestream_writer* writer);

GIMNET_API void bitestream_put_opaque(bitestream_writer* writer, bitestream_key key,
                                      const void* bytes, size_t size);
GIMNET_API void bitestream_put_bool(bitestream_writer* writer, bitestream_key key, bool value);
GIMNET_API void bitestream_put_u8(bitestream_writer* writer, bitestream_key key, uint8_t value);
GIMNET_API void bitestream_put_u16(bitestream_writer* writer, bitestream_key key, uint16_t value);
GIMNET_API void bitestream_put_u32(bitestream_writer* writer, bitestream_key key, uint32_t value);
GIMNET_API void bitestream_put_u64(bitestream_writer* writer, bitestream_key key, uint64_t value);
GIMNET_API void bitestream_put_i8(bitestream_writer* writer, bitestream_key key, int8_t value);
GIMNET_API void bitestream_put_i16(bitestream_writer* writer, bitestream_key key, int16_t value);
GIMNET_API void bitestream_put_i32(bitestream_writer* writer, bitestream_key key, int32_t value);
GIMNET_API void bitestream_put_i64(bitestream_writer* writer, bitestream_key key, int64_t value);
GIMNET_API void bitestream_put_f32(bitestream_writer* writer, bitestream_key key, float value);
GIMNET_API void bitestream_put_f64(bitestream_writer* writer, bitestream_key key, double value);
/* UTF-8, `size` bytes without a closing zero. */
GIMNET_API void bitestream_put_text(bitestream_writer* writer, bitestream_key key, const char* text,
                                    size_t size);
/* Nanoseconds since 1970. */
GIMNET_API void bitestream_put_time(bitestream_writer* writer, bitestream_key key, int64_t ns);
/* `count` elements in memory order, for an array type; a bool is a byte of 0 or 1. */
GIMNET_API void bitestream_put_array(bitestream_writer* writer, bitestream_key key,
                                     bitestream_type type, const void* elements, size_t count);
/* Everything put between the two calls belongs to the nested stream. One that is left out in the
 * end needs room for its key until then. */
GIMNET_API void bitestream_begin_nested(bitestream_writer* writer, bitestream_key key);
GIMNET_API void bitestream_end_nested(bitestream_writer* writer);
/* A value as it stands on the wire, of any type but a nested one; its size is checked against the
 * type. */
GIMNET_API void bitestream_put_value(bitestream_writer* writer, bitestream_key key,
                                     bitestream_type type, const void* bytes, size_t size);

/* Reading
 * -------------------------------------------------------------------------------------------------
 * In place: values point into the bytes that are read, which must outlive them. Each step costs the
 * same, however large the value. Hostile bytes end the reading with BITESTREAM_MALFORMED. */
typedef struct bitestream_reader {
  const unsigned char* bytes;
  size_t size;
  size_t offset;  /* of the next value */
  uint32_t depth; /* 0: not nested */
} bitestream_reader;

typedef struct bitestream_value {
  bitestream_key key;
  bitestream_type type;
  uint32_t size; /* in bytes */
  const unsigned char* bytes;
  uint32_t depth; /* of the stream that it stands in */
} bitestream_value;

GIMNET_API bitestream_reader bitestream_reader_over(const void* bytes, size_t size);
/* BITESTREAM_OK: `value` is the next one. BITESTREAM_END, BITESTREAM_MALFORMED: as every further
 * call. */
GIMNET_API bitestream_status bitestream_next(bitestream_reader* reader, bitestream_value* value);
/* The first value with that key, wherever the reader stands; does not move it. BITESTREAM_END:
 * there is none. */
GIMNET_API bitestream_status bitestream_find(const bitestream_reader* reader, bitestream_key key,
                                             bitestream_value* value);
/* Checks everything, nested streams, texts and bools included, before any of it is used. Costs one
 * pass. */
GIMNET_API bitestream_status bitestream_check(const void* bytes, size_t size);

/* Numbers of any type are given where no value is lost. False: not a number, or it does not fit;
 * `out` is unchanged. */
GIMNET_API bool bitestream_get_u8(const bitestream_value* value, uint8_t* out);
GIMNET_API bool bitestream_get_u16(const bitestream_value* value, uint16_t* out);
GIMNET_API bool bitestream_get_u32(const bitestream_value* value, uint32_t* out);
GIMNET_API bool bitestream_get_u64(const bitestream_value* value, uint64_t* out);
GIMNET_API bool bitestream_get_i8(const bitestream_value* value, int8_t* out);
GIMNET_API bool bitestream_get_i16(const bitestream_value* value, int16_t* out);
GIMNET_API bool bitestream_get_i32(const bitestream_value* value, int32_t* out);
GIMNET_API bool bitestream_get_i64(const bitestream_value* value, int64_t* out);
GIMNET_API bool bitestream_get_f32(const bitestream_value* value, float* out);
GIMNET_API bool bitestream_get_f64(const bitestream_value* value, double* out);
/* False: another type, or (text) not UTF-8. */
GIMNET_API bool bitestream_get_bool(const bitestream_value* value, bool* out);
GIMNET_API bool bitestream_get_time(const bitestream_value* value, int64_t* ns);
GIMNET_API bool bitestream_get_text(const bitestream_value* value, const char** text, size_t* size);
GIMNET_API bool bitestream_get_opaque(const bitestream_value* value, const void** bytes,
                                      size_t* size);
GIMNET_API bool bitestream_get_nested(const bitestream_value* value, bitestream_reader* nested);
/* Elements of an array; 0 for everything else. */
GIMNET_API size_t bitestream_count(const bitestream_value* value);
/* One element as a value of its own. False: not an array, or no such element. */
GIMNET_API bool bitestream_element(const bitestream_value* value, size_t index,
                                   bitestream_value* element);

#ifdef __cplusplus
}
#endif
