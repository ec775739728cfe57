/* gimnet/nif.h in C11: compiles, connects, talks. Run by nif_c_test.cpp, which plays the hub. */

#include "tests/client/nif/nif_c_test.h"

#include <stdio.h>
#include <string.h>

#include "gimnet/nif.h"

/* gimnet/nif.h, "Versions": programs keep arrays of these, so they never change while
 * NIF_VERSION_MAJOR is the same. */
#if UINTPTR_MAX == UINT64_MAX
_Static_assert(sizeof(nif_bytes) == 16, "nif_bytes");
_Static_assert(sizeof(nif_incoming) == 128, "nif_incoming");
_Static_assert(sizeof(nif_subscription) == 40, "nif_subscription");
_Static_assert(sizeof(nif_node_record) == 56, "nif_node_record");
_Static_assert(sizeof(nif_service_record) == 72, "nif_service_record");
#endif

static int failed(const char* step) {
  fprintf(stderr, "%s: %s\n", step, nif_error_text());
  return 1;
}

static int send_parts(nif_node* node, uint32_t peer) {
  const nif_bytes parts[2] = {{"hello ", 6}, {"hub", 3}};
  nif_outgoing message = NIF_OUTGOING_INIT;
  message.to = peer;
  message.lane = NIF_REAL_TIME;
  message.flags = NIF_FLAG_KEYED;
  message.key = 42;
  message.parts = parts;
  message.part_count = 2;
  return nif_send(node, &message, NIF_FOREVER) == NIF_OK ? 0 : failed("send");
}

int nif_c_talk(const char* url, uint32_t peer) {
  nif_options options = {.struct_size = sizeof options, .url = url, .name = "c"};
  nif_info info = {.struct_size = sizeof info};
  nif_node* node = NULL;
  nif_incoming in;
  int result;
  if (nif_connect(&options, &node) != NIF_OK) return failed("connect");
  if (nif_get_info(node, &info) != NIF_OK || strcmp(info.name, "robot") != 0) return failed("info");
  if (send_parts(node, peer) != 0) return 1;
  if (nif_receive(node, &in, NIF_FOREVER) != NIF_OK) return failed("receive");
  result =
      in.type == NIF_MESSAGE && in.from == peer && in.size == 2 && memcmp(in.payload, "hi", 2) == 0
          ? 0
          : 2;
  nif_release(&in);
  if (nif_receive(node, &in, 0) != NIF_TIMEOUT) return 3;
  if (nif_close(node) != NIF_OK) return failed("close");
  if (nif_close(node) != NIF_CLOSED) return 4;
  return result;
}
