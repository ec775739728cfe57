/* Sends a word to mirror.c, and prints what comes back. */

#include <stdio.h>
#include <string.h>

#include "gimnet/nif.h"

enum { PATIENCE_MS = 5000 };

static int failed(const char* what) {
  fprintf(stderr, "hello: cannot %s: %s\n", what, nif_error_text());
  return 1;
}

static int talk(nif_node* node, const char* word) {
  uint32_t mirror = 0;
  nif_incoming in;
  nif_status status;
  if (nif_resolve(node, "mirror", &mirror, PATIENCE_MS) != NIF_OK)
    return failed("find the node mirror");
  if (nif_send_to(node, mirror, word, strlen(word)) != NIF_OK) return failed("send");
  while ((status = nif_receive(node, &in, PATIENCE_MS)) == NIF_OK) {
    const int is_answer = in.type == NIF_MESSAGE && in.from == mirror;
    if (is_answer) printf("%.*s\n", (int)in.size, (const char*)in.payload);
    nif_release(&in); /* the payload is valid until here */
    if (is_answer) return 0;
  }
  if (status != NIF_TIMEOUT) return failed("receive");
  fprintf(stderr, "hello: the mirror did not answer within %d ms\n", PATIENCE_MS);
  return 1;
}

int main(int argc, char** argv) {
  const nif_options options = {.struct_size = sizeof options}; /* a node without a name */
  nif_node* node = NULL;
  int result;
  if (nif_connect(&options, &node) != NIF_OK) return failed("connect");
  result = talk(node, argc > 1 ? argv[1] : "hello");
  nif_close(node);
  return result;
}
