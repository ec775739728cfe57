#ifndef GIMNET_GIMI_REQUESTS_H
#define GIMNET_GIMI_REQUESTS_H

/*
 * Requests and their answers. Included by gimnet/gimi.h.
 *
 *     gimi_reply reply;
 *     const gimi_bytes numbers = {"1 2", 3};
 *     if (gimi_ask(node, "calc/add", &numbers, NULL, &reply) == GIMI_OK)
 *       show(reply.data, reply.size);
 *     gimi_reply_release(&reply);
 *
 *     gimi_request request;
 *     gimi_answer(node, "add", NULL, &add);  // calc/add
 *     while (gimi_next_request(add, GIMI_FOREVER, &request) == GIMI_OK) {
 *       gimi_reply_to(&request, "3", 1, GIMI_FOREVER);
 *       gimi_request_release(&request);
 *     }
 */

#include "gimnet/gimi_types.h"

#ifdef __cplusplus
extern "C" {
#endif

/** Whether the other program may have done the work of a request. */
typedef int32_t gimi_ran;
enum {
  GIMI_RAN_NO = 0,    /**< It did not, and will not. */
  GIMI_RAN_MAYBE = 1, /**< Nobody can tell. */
  GIMI_RAN_YES = 2    /**< It answered; its error says what it did. */
};

typedef struct gimi_request_options {
  size_t struct_size;
  int32_t timeout_ms; /**< Until the request ends; 0: 5,000. */
  gimi_lane lane;     /**< Of the request and its answer. */
  /** Not 0: the work may be done twice. A request whose fate nobody knows after a break of the
   * connection is asked again; and if the program that was asked has gone, the next one that has
   * the service within 2 s is asked. */
  uint8_t repeat;
  uint8_t reserved[7];
} gimi_request_options;

/** The end of a request. It owns its memory until gimi_reply_release(). */
typedef struct gimi_reply {
  const void* data; /**< Of GIMI_OK; NULL if size is 0. */
  size_t size;
  gimi_peer from;
  gimi_ran ran;
  int32_t code;   /**< Of GIMI_FAILED: as the other program chose it. */
  uint32_t ended; /**< 0: the request goes on (gimi_wait_for_reply() answered GIMI_TIMEOUT). */
  void* storage;  /**< The library's. */
  uint64_t reserved[3];
} gimi_reply;

/** Asks whoever answers the service of that full name, and waits for the end of the request, of
 * which there is exactly one. In brackets: reply->ran. GIMI_OK [yes]. GIMI_FAILED: the other
 * program says so [yes]. GIMI_NOT_FOUND: nobody answers there [no]. GIMI_BUSY: 64 requests, or
 * receive_bytes of them, wait there [no]. GIMI_NOT_DELIVERED: dropped on the way [no; maybe if a
 * connection on the way broke]. GIMI_DENIED: a link between hubs may not carry it [no]. GIMI_GONE:
 * the program ended, or let the request go [maybe]. GIMI_TIMEOUT [no if it was not sent or came too
 * late, else maybe]. GIMI_TOO_LARGE: the request [no], the reply [maybe]. GIMI_LIMIT: 1,024
 * requests of this node are open [no]. GIMI_NOT_CONNECTED, GIMI_CLOSED and others [no if it was not
 * sent, else maybe]. `data` may be NULL: nothing. */
GIMNET_API gimi_status gimi_ask(gimi_handle node, const char* service, const gimi_bytes* data,
                                const gimi_request_options* options, gimi_reply* reply);
/** Asks and does not wait for the end, only for the hub to say where the service is. A request that
 * could not be sent is an error here. gimi_close() of the handle cancels: no reply will come. Calls
 * that wait end with GIMI_CLOSED [no if it was not sent, else maybe]. */
GIMNET_API gimi_status gimi_ask_later(gimi_handle node, const char* service, const gimi_bytes* data,
                                      const gimi_request_options* options, gimi_handle* pending);
/** Waits for the end of a request, which it gives once, as gimi_ask(). GIMI_TIMEOUT with
 * reply->ended 0: it has not ended within timeout_ms. */
GIMNET_API gimi_status gimi_wait_for_reply(gimi_handle pending, int32_t timeout_ms,
                                           gimi_reply* reply);
/** Gives the memory back and empties the struct; does nothing with an empty one. NULL is ignored.
 */
GIMNET_API void gimi_reply_release(gimi_reply* reply);

typedef struct gimi_answer_options {
  size_t struct_size;
  const char* metadata; /**< For people and tools, at most 4,096 bytes of UTF-8. */
  int32_t timeout_ms;   /**< For the hub's answer; 0: 5,000. */
  uint32_t reserved;
} gimi_answer_options;

/** Lists the service `own name/name`, which answers requests, until the handle is closed. Errors as
 * gimi_advertise(). */
GIMNET_API gimi_status gimi_answer(gimi_handle node, const char* name,
                                   const gimi_answer_options* options, gimi_handle* answers);

/** A request that was taken. It owns its memory until gimi_request_release(); it is answered once,
 * by the program or by that. */
typedef struct gimi_request {
  const void* data; /**< NULL if size is 0. Valid until: release. */
  size_t size;
  int64_t left_ms; /**< When it was taken: so long somebody waits for the answer; -1: no limit. */
  int64_t arrival_ns;
  gimi_peer from;
  uint32_t content; /**< GIMI_CONTENT_*. */
  void* storage;    /**< The library's. */
  uint64_t reserved[3];
} gimi_request;

/** Takes the oldest request to a service; one whose time is over is not given out. GIMI_TIMEOUT,
 * GIMI_CLOSED. */
GIMNET_API gimi_status gimi_next_request(gimi_handle answers, int32_t timeout_ms,
                                         gimi_request* request);
/** Answers a request with 0 bytes to 1 GiB. GIMI_CLOSED: it was answered already, or the service
 * has ended; and the errors of sending, after which the request is still open: it can be answered
 * again, also by gimi_fail_request(). */
GIMNET_API gimi_status gimi_reply_to(gimi_request* request, const void* data, size_t size,
                                     int32_t timeout_ms);
/** Answers a request with an error, for which `code` and `sentence` (at most 1,024 bytes; NULL:
 * none) are the program's own. As gimi_reply_to(). */
GIMNET_API gimi_status gimi_fail_request(gimi_request* request, int32_t code, const char* sentence);
/** As gimi_reply_release(). A request that was not answered is answered with an error. */
GIMNET_API void gimi_request_release(gimi_request* request);

#ifdef __cplusplus
}
#endif

#endif /* GIMNET_GIMI_REQUESTS_H */
