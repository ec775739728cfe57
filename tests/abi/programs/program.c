/* A program in C11 that uses each part of the library once: Bitestream, NIF, and of GIMI messages,
 * a loan, a command, a request, lists and events. It is kept as it was compiled for version 0.9.0,
 * and later libraries must run it.
 *
 *     program HUB */

#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "gimnet/bitestream.h"
#include "gimnet/gimi.h"
#include "gimnet/nif.h"

enum { WAIT_MS = 20000 };

#define EXPECT(condition)                                                            \
  do {                                                                               \
    if (!(condition)) {                                                              \
      fprintf(stderr, "line %d: %s: %s\n", __LINE__, #condition, gimi_error_text()); \
      return 1;                                                                      \
    }                                                                                \
  } while (0)

static int use_bitestream(void) {
  uint8_t bytes[64];
  bitestream_writer writer = bitestream_writer_over(bytes, sizeof bytes);
  bitestream_value value;
  double x = 0;
  bitestream_put_f64(&writer, bitestream_text_key("x", 1), 0.5);
  EXPECT(bitestream_finish(&writer) == BITESTREAM_OK);
  bitestream_reader reader = bitestream_reader_over(bytes, writer.size);
  EXPECT(bitestream_next(&reader, &value) == BITESTREAM_OK);
  EXPECT(bitestream_get_f64(&value, &x) && x == 0.5);
  return 0;
}

static int use_nif(const char* hub) {
  nif_options options = {.struct_size = sizeof options, .url = hub};
  nif_node* node = NULL;
  nif_incoming in;
  EXPECT(nif_connect(&options, &node) == NIF_OK);
  EXPECT(nif_send_to(node, nif_id(node), "x", 1) == NIF_OK);
  EXPECT(nif_receive(node, &in, WAIT_MS) == NIF_OK && in.type == NIF_MESSAGE && in.size == 1);
  nif_release(&in);
  EXPECT(nif_close(node) == NIF_OK);
  return 0;
}

static int use_messages(gimi_handle node) {
  gimi_handle publisher, subscription;
  gimi_message message;
  gimi_loaned loan;
  EXPECT(gimi_advertise(node, "odom", GIMI_OPTIONS(gimi_publish_options, .key = {3, 4}),
                        &publisher) == GIMI_OK);
  EXPECT(gimi_subscribe(node, "kept/odom", GIMI_OPTIONS(gimi_subscribe_options, .queue = 8),
                        &subscription) == GIMI_OK);
  EXPECT(gimi_wait_for_subscribers(publisher, 1, WAIT_MS) == GIMI_OK);
  EXPECT(gimi_publish(publisher, "x 1.0", 5, WAIT_MS, 0) == GIMI_OK);
  EXPECT(gimi_receive(subscription, WAIT_MS, &message) == GIMI_OK);
  EXPECT(message.size == 5 && memcmp(message.data, "x 1.0", 5) == 0);
  EXPECT(strcmp(message.service, "kept/odom") == 0 && message.key.instance == 4);
  EXPECT(message.sequence == 1 && message.from == gimi_id(node));
  gimi_message_release(&message);
  EXPECT(gimi_loan(publisher, 10000, &loan) == GIMI_OK);
  memset(loan.data, 'x', loan.size);
  EXPECT(gimi_publish_loan(publisher, &loan, WAIT_MS, 0) == GIMI_OK);
  EXPECT(gimi_receive(subscription, WAIT_MS, &message) == GIMI_OK && message.size == 10000);
  gimi_message_release(&message);
  EXPECT(gimi_close(subscription) == GIMI_OK && gimi_close(publisher) == GIMI_OK);
  return 0;
}

static int use_requests(gimi_handle node) {
  gimi_handle add, pending;
  gimi_request request;
  gimi_reply reply;
  const gimi_bytes numbers = {"1 2", 3};
  EXPECT(gimi_answer(node, "add", NULL, &add) == GIMI_OK);
  EXPECT(gimi_ask_later(node, "kept/add", &numbers,
                        GIMI_OPTIONS(gimi_request_options, .timeout_ms = WAIT_MS),
                        &pending) == GIMI_OK);
  EXPECT(gimi_next_request(add, WAIT_MS, &request) == GIMI_OK && request.size == 3);
  EXPECT(gimi_reply_to(&request, "3", 1, WAIT_MS) == GIMI_OK);
  gimi_request_release(&request);
  EXPECT(gimi_wait_for_reply(pending, WAIT_MS, &reply) == GIMI_OK && reply.size == 1);
  EXPECT(reply.ran == GIMI_RAN_YES);
  gimi_reply_release(&reply);
  EXPECT(gimi_close(pending) == GIMI_OK && gimi_close(add) == GIMI_OK);
  return 0;
}

static int use_lists(gimi_handle node) {
  gimi_handle watch;
  gimi_watch_event event;
  gimi_list list;
  gimi_node_record record;
  gimi_node_state state = {.struct_size = sizeof state};
  EXPECT(gimi_nodes(node, "kept", WAIT_MS, &list) == GIMI_OK && list.count == 1);
  EXPECT(gimi_list_get(&list, 0, &record, sizeof record) == GIMI_OK);
  EXPECT(strcmp(record.name, "kept") == 0 && record.id == gimi_id(node));
  gimi_list_release(&list);
  EXPECT(gimi_watch(node, "kept", GIMI_WATCH_NODES, WAIT_MS, &watch) == GIMI_OK);
  EXPECT(gimi_watch_receive(watch, WAIT_MS, &event) == GIMI_OK);
  gimi_watch_event_release(&event);
  EXPECT(gimi_close(watch) == GIMI_OK);
  EXPECT(gimi_state(node, &state) == GIMI_OK && state.connected == 1);
  return 0;
}

int main(int argc, char** argv) {
  gimi_handle node;
  if (argc != 2) return 2;
  EXPECT(use_bitestream() == 0 && use_nif(argv[1]) == 0);
  EXPECT(gimi_join(GIMI_OPTIONS(gimi_node_options, .name = "kept", .hub = argv[1]), &node) ==
         GIMI_OK);
  EXPECT(use_messages(node) == 0 && use_requests(node) == 0 && use_lists(node) == 0);
  EXPECT(gimi_close(node) == GIMI_OK);
  puts("all is as it was");
  return 0;
}
