/* Puts values into a message and takes them out again. The bytes may travel by NIF, by GIMI, or in
 * a file. */

#include <stdio.h>

#include "gimnet/bitestream.h"

/* Labels: short numbers, or words. A reader skips those that it does not know, so messages can
 * grow. */
static bitestream_key robot_key(void) { return bitestream_number_key(1); }
static bitestream_key x_key(void) { return bitestream_text_key("x", 1); }
static bitestream_key scan_key(void) { return bitestream_text_key("scan", 4); }

static size_t write_pose(unsigned char* memory, size_t size) {
  const float scan[] = {1.0f, 0.5f, 0.25f};
  bitestream_writer writer = bitestream_writer_over(memory, size);
  bitestream_put_text(&writer, robot_key(), "robot", 5);
  bitestream_put_f64(&writer, x_key(), 0.5);
  bitestream_put_array(&writer, scan_key(), BITESTREAM_F32_ARRAY, scan,
                       sizeof scan / sizeof scan[0]);
  return bitestream_finish(&writer) == BITESTREAM_OK ? writer.size
                                                     : 0; /* one check for all that was put */
}

/* `bytes` may come from anybody: whatever they are, nothing beyond them is read. */
static int read_pose(const unsigned char* bytes, size_t size) {
  const bitestream_reader reader = bitestream_reader_over(bytes, size);
  bitestream_value value;
  const char* name = NULL;
  size_t name_size = 0;
  double x = 0.0;
  if (bitestream_find(&reader, robot_key(), &value) != BITESTREAM_OK) return 1;
  if (!bitestream_get_text(&value, &name, &name_size)) return 1;
  if (bitestream_find(&reader, x_key(), &value) != BITESTREAM_OK || !bitestream_get_f64(&value, &x))
    return 1;
  printf("%.*s is at x %g\n", (int)name_size, name, x);
  if (bitestream_find(&reader, scan_key(), &value) != BITESTREAM_OK) return 1;
  for (size_t i = 0; i < bitestream_count(&value); ++i) {
    bitestream_value element;
    float range = 0.0f;
    if (bitestream_element(&value, i, &element) && bitestream_get_f32(&element, &range))
      printf("range %g\n", (double)range);
  }
  return 0;
}

int main(void) {
  unsigned char memory[64];
  const size_t size = write_pose(memory, sizeof memory);
  if (size == 0 || read_pose(memory, size) != 0) {
    fprintf(stderr, "pose: this is not a pose\n");
    return 1;
  }
  return 0;
}
