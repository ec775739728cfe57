/* Stands in for a later library. It gives a meaning to the members that this one leaves zero, and
 * its records are longer. It is loaded before the library, by LD_PRELOAD. */

#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdlib.h>
#include <string.h>

#include "gimnet/gimi.h"

#define LIBRARY(function) ((__typeof__(&(function)))dlsym(RTLD_NEXT, #function))
#define FILL(room) memset(&(room), 0xA5, sizeof(room))

enum { MORE_BYTES = 64, PROOF = 77 };

gimi_status gimi_receive(gimi_handle source, int32_t timeout_ms, gimi_message* message) {
  const gimi_status status = LIBRARY(gimi_receive)(source, timeout_ms, message);
  if (getenv("GIMNET_TEST_PROOF") != NULL) _Exit(PROOF);
  if (status == GIMI_OK) FILL(message->reserved);
  return status;
}

gimi_status gimi_ask(gimi_handle node, const char* service, const gimi_bytes* data,
                     const gimi_request_options* options, gimi_reply* reply) {
  const gimi_status status = LIBRARY(gimi_ask)(node, service, data, options, reply);
  FILL(reply->reserved);
  return status;
}

gimi_status gimi_wait_for_reply(gimi_handle pending, int32_t timeout_ms, gimi_reply* reply) {
  const gimi_status status = LIBRARY(gimi_wait_for_reply)(pending, timeout_ms, reply);
  FILL(reply->reserved);
  return status;
}

gimi_status gimi_next_request(gimi_handle answers, int32_t timeout_ms, gimi_request* request) {
  const gimi_status status = LIBRARY(gimi_next_request)(answers, timeout_ms, request);
  if (status == GIMI_OK) FILL(request->reserved);
  return status;
}

gimi_status gimi_watch_receive(gimi_handle watch, int32_t timeout_ms, gimi_watch_event* event) {
  const gimi_status status = LIBRARY(gimi_watch_receive)(watch, timeout_ms, event);
  if (status == GIMI_OK) FILL(event->reserved);
  return status;
}

gimi_status gimi_nodes(gimi_handle node, const char* pattern, int32_t timeout_ms, gimi_list* list) {
  const gimi_status status = LIBRARY(gimi_nodes)(node, pattern, timeout_ms, list);
  if (status != GIMI_OK) return status;
  const size_t size = list->record_size + MORE_BYTES;
  char* records = malloc(list->count * size + 1);
  memset(records, 0xA5, list->count * size);
  for (size_t i = 0; i < list->count; ++i) {
    memcpy(records + i * size, (const char*)list->records + i * list->record_size,
           list->record_size);
  }
  list->records = records;
  list->record_size = size;
  return status;
}
