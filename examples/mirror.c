/* Sends each message back to who sent it: see hello.c. */

#include <stdio.h>

#include "gimnet/nif.h"

static int failed(const char* what) {
  fprintf(stderr, "mirror: cannot %s: %s\n", what, nif_error_text());
  return 1;
}

int main(void) {
  const nif_options options = {.struct_size = sizeof options,
                               .name = "mirror"}; /* the rest: defaults */
  nif_node* node = NULL;
  nif_incoming in;
  if (nif_connect(&options, &node) != NIF_OK) return failed("connect");
  while (nif_receive(node, &in, NIF_FOREVER) == NIF_OK) {
    if (in.type == NIF_MESSAGE) {
      if (nif_send_to(node, in.from, in.payload, in.size) != NIF_OK) failed("answer");
    } else {
      printf("event %u: %s\n", (unsigned)in.type, in.text); /* a break, a new connection, ... */
    }
    nif_release(&in);
  }
  failed("receive"); /* no connection will come any more */
  nif_close(node);
  return 1;
}
