/* The C interface as a C program uses it, linked with nothing but the C library. */

#include "gimnet/bitestream.h"

#include <stdio.h>
#include <string.h>

static int failures = 0;

#define EXPECT(condition)                                                       \
  do {                                                                          \
    if (!(condition)) {                                                         \
      fprintf(stderr, "%s:%d: not true: %s\n", __FILE__, __LINE__, #condition); \
      ++failures;                                                               \
    }                                                                           \
  } while (0)

static const unsigned char kExample[] = {0x60, 0x03, 0x00, 0x00, 0x05, 0x72, 0x6f, 0x62,
                                         0x6f, 0x74, 0x5c, 0x01, 0x76, 0x08, 0x00, 0x00,
                                         0x00, 0x00, 0x00, 0x00, 0xe0, 0x3f};

static void writes_the_example_of_the_document(void) {
  unsigned char memory[sizeof kExample];
  bitestream_writer writer = bitestream_writer_over(memory, sizeof memory);
  bitestream_put_text(&writer, bitestream_number_key(3), "robot", 5);
  bitestream_put_f64(&writer, bitestream_text_key("v", 1), 0.5);
  EXPECT(bitestream_finish(&writer) == BITESTREAM_OK);
  EXPECT(writer.size == sizeof kExample);
  EXPECT(memcmp(memory, kExample, sizeof kExample) == 0);
  bitestream_put_u8(&writer, bitestream_number_key(1), 1);
  EXPECT(bitestream_finish(&writer) == BITESTREAM_NO_ROOM);
}

static void reads_the_example_of_the_document(void) {
  bitestream_reader reader = bitestream_reader_over(kExample, sizeof kExample);
  bitestream_value value;
  const char* text = NULL;
  size_t size = 0;
  double number = 0;
  EXPECT(bitestream_next(&reader, &value) == BITESTREAM_OK);
  EXPECT(value.key.text == NULL && value.key.number == 3);
  EXPECT(bitestream_get_text(&value, &text, &size) && size == 5 && memcmp(text, "robot", 5) == 0);
  EXPECT(!bitestream_get_f64(&value, &number));
  EXPECT(bitestream_next(&reader, &value) == BITESTREAM_OK);
  EXPECT(bitestream_keys_equal(value.key, bitestream_text_key("v", 1)));
  EXPECT(bitestream_get_f64(&value, &number) && number == 0.5);
  EXPECT(bitestream_next(&reader, &value) == BITESTREAM_END);
  EXPECT(bitestream_find(&reader, bitestream_number_key(3), &value) == BITESTREAM_OK);
  EXPECT(bitestream_find(&reader, bitestream_number_key(4), &value) == BITESTREAM_END);
}

static void put_some_of_everything(bitestream_writer* writer) {
  static const unsigned char opaque[] = {0, 255};
  static const int16_t samples[] = {-1, 2, 300};
  bitestream_put_opaque(writer, bitestream_number_key(1), opaque, sizeof opaque);
  bitestream_put_bool(writer, bitestream_number_key(2), true);
  bitestream_put_u8(writer, bitestream_number_key(3), 3);
  bitestream_put_u16(writer, bitestream_number_key(4), 4);
  bitestream_put_u32(writer, bitestream_number_key(5), 5);
  bitestream_put_u64(writer, bitestream_number_key(6), 6);
  bitestream_put_i8(writer, bitestream_number_key(7), -7);
  bitestream_put_i16(writer, bitestream_number_key(8), -8);
  bitestream_put_i32(writer, bitestream_number_key(9), -9);
  bitestream_put_i64(writer, bitestream_number_key(10), -10);
  bitestream_put_f32(writer, bitestream_number_key(11), 0.5f);
  bitestream_put_time(writer, bitestream_number_key(12), 1767225600000000000);
  bitestream_put_array(writer, bitestream_number_key(13), BITESTREAM_I16_ARRAY, samples, 3);
  bitestream_begin_nested(writer, bitestream_number_key(14));
  bitestream_put_u8(writer, bitestream_number_key(1), 1);
  bitestream_end_nested(writer);
}

static bitestream_value find(const bitestream_reader* reader, uint32_t number) {
  bitestream_value value;
  memset(&value, 0, sizeof value);
  EXPECT(bitestream_find(reader, bitestream_number_key(number), &value) == BITESTREAM_OK);
  return value;
}

static void reads_numbers_of_every_type_as_another(const bitestream_reader* reader) {
  for (uint32_t key = 3; key <= 10; ++key) {
    const bitestream_value value = find(reader, key);
    const int expected = key <= 6 ? (int)key : -(int)key;
    int8_t i8 = 0;
    int16_t i16 = 0;
    int32_t i32 = 0;
    int64_t i64 = 0;
    float f32 = 0;
    EXPECT(bitestream_get_i8(&value, &i8) && i8 == expected);
    EXPECT(bitestream_get_i16(&value, &i16) && i16 == expected);
    EXPECT(bitestream_get_i32(&value, &i32) && i32 == expected);
    EXPECT(bitestream_get_i64(&value, &i64) && i64 == expected);
    EXPECT(bitestream_get_f32(&value, &f32) && f32 == (float)expected);
    uint8_t u8 = 0;
    uint16_t u16 = 0;
    uint32_t u32 = 0;
    uint64_t u64 = 0;
    EXPECT(bitestream_get_u8(&value, &u8) == (expected > 0));
    EXPECT(bitestream_get_u16(&value, &u16) == (expected > 0));
    EXPECT(bitestream_get_u32(&value, &u32) == (expected > 0));
    EXPECT(bitestream_get_u64(&value, &u64) == (expected > 0));
  }
}

static void reads_everything_else(const bitestream_reader* reader) {
  const void* bytes = NULL;
  size_t size = 0;
  bool flag = false;
  int64_t ns = 0;
  bitestream_value value = find(reader, 1);
  EXPECT(bitestream_get_opaque(&value, &bytes, &size) && size == 2);
  value = find(reader, 2);
  EXPECT(bitestream_get_bool(&value, &flag) && flag);
  value = find(reader, 12);
  EXPECT(bitestream_get_time(&value, &ns) && ns == 1767225600000000000);
  value = find(reader, 13);
  bitestream_value element;
  int32_t sample = 0;
  EXPECT(bitestream_count(&value) == 3);
  EXPECT(bitestream_element(&value, 2, &element) && bitestream_get_i32(&element, &sample) &&
         sample == 300);
  EXPECT(!bitestream_element(&value, 3, &element));
  value = find(reader, 14);
  bitestream_reader nested;
  EXPECT(bitestream_get_nested(&value, &nested));
  uint8_t one = 0;
  value = find(&nested, 1);
  EXPECT(bitestream_get_u8(&value, &one) && one == 1);
}

static void grows_and_reads_back(void) {
  bitestream_writer writer = bitestream_writer_growable();
  put_some_of_everything(&writer);
  EXPECT(bitestream_finish(&writer) == BITESTREAM_OK);
  EXPECT(bitestream_check(writer.bytes, writer.size) == BITESTREAM_OK);
  const bitestream_reader reader = bitestream_reader_over(writer.bytes, writer.size);
  reads_numbers_of_every_type_as_another(&reader);
  reads_everything_else(&reader);
  bitestream_writer_free(&writer);
  EXPECT(writer.bytes == NULL && writer.size == 0);
}

static void refuses_hostile_bytes(void) {
  static const unsigned char hostile[] = {0x12, 1, 0, 0, 0xff, 0xff, 0xff, 0xff, 0};
  bitestream_reader reader = bitestream_reader_over(hostile, sizeof hostile);
  bitestream_value value;
  EXPECT(bitestream_next(&reader, &value) == BITESTREAM_MALFORMED);
  EXPECT(bitestream_next(&reader, &value) == BITESTREAM_MALFORMED);
  EXPECT(bitestream_check(hostile, sizeof hostile) == BITESTREAM_MALFORMED);
}

static bitestream_status status_of_text_without_bytes(size_t size) {
  unsigned char memory[16];
  bitestream_writer writer = bitestream_writer_over(memory, sizeof memory);
  bitestream_put_text(&writer, bitestream_number_key(1), NULL, size);
  return bitestream_finish(&writer);
}

static void refuses_sizes_without_bytes(void) {
  EXPECT(status_of_text_without_bytes(0) == BITESTREAM_OK);
  EXPECT(status_of_text_without_bytes(5) == BITESTREAM_BAD_VALUE);
  bitestream_writer writer = bitestream_writer_over(NULL, 10);
  bitestream_put_u8(&writer, bitestream_number_key(1), 1);
  EXPECT(bitestream_finish(&writer) == BITESTREAM_NO_ROOM);
  EXPECT(bitestream_check(NULL, 0) == BITESTREAM_OK);
  EXPECT(bitestream_check(NULL, 5) == BITESTREAM_MALFORMED);
  bitestream_reader reader = bitestream_reader_over(NULL, 5);
  bitestream_value value;
  EXPECT(bitestream_next(&reader, &value) == BITESTREAM_MALFORMED);
  EXPECT(bitestream_find(&reader, bitestream_number_key(1), &value) == BITESTREAM_MALFORMED);
}

int main(void) {
  writes_the_example_of_the_document();
  reads_the_example_of_the_document();
  grows_and_reads_back();
  refuses_hostile_bytes();
  refuses_sizes_without_bytes();
  if (failures == 0) printf("ok\n");
  return failures == 0 ? 0 : 1;
}
