#ifndef GIMNET_GIMI_H
#define GIMNET_GIMI_H

/*
 * GIMI: how programs use GIMnet, in C11. gimnet/gimi.hpp is a C++20 layer over it, and other
 * languages load these functions from libgimnet.so. docs/gimi.md explains GIMI with examples.
 *
 *     gimi_handle node, odometry;
 *     if (gimi_join(GIMI_OPTIONS(gimi_node_options, .name = "robot"), &node) != GIMI_OK ||
 *         gimi_advertise(node, "odom", NULL, &odometry) != GIMI_OK) {
 *       puts(gimi_error_text());
 *       return 1;
 *     }
 *     gimi_publish(odometry, "x 1.0 y 2.0", 11, 1000, 0);
 *
 *     gimi_message message;
 *     gimi_subscribe(node, "robot/odom", NULL, &odometry);  // need not exist yet
 *     while (gimi_receive(odometry, GIMI_FOREVER, &message) == GIMI_OK) {
 *       show(message.data, message.size);
 *       gimi_message_release(&message);
 *     }
 *
 * Threads. Every function may be called from any thread at any time, on one handle from many. No
 * function calls back: received things wait in queues until the program takes them.
 *
 * Signals. No function may be called in a signal handler, nor gimi_close(): the handler notes the
 * signal, and a thread of the program sees to it. The library never raises SIGPIPE and installs no
 * handler; interrupted waits go on until their time is up.
 *
 * Handles. The caller ends each with gimi_close(); a process has at most 2^20. A handle keeps what
 * it needs of its node: one that outlives its node answers GIMI_CLOSED.
 *
 * Errors. A call answers a status; gimi_error_text() says more. Calls give nothing that the caller
 * has to free(): messages, batches, lists and events own their memory until their release function,
 * which empties them, so that a second call does nothing. A failed call leaves its output empty.
 *
 * Times. timeout_ms is the longest wait: 0 does not wait, GIMI_FOREVER has no limit. In options 0
 * is the default, 5 s.
 *
 * fork. Every call on a handle of the parent answers GIMI_FORKED in the child, which joins anew.
 * gimi_close() of a node releases its descriptor there, without a word to the hub.
 *
 * Text given to the library is NUL-terminated UTF-8 and is copied. NULL, a handle of another kind
 * and a struct_size that is no size are answered, never followed.
 *
 * Versions. Numbers of enumerations and members of structs keep their meaning. Options grow at
 * their end (gimnet/gimi_options.h), records too (gimi_list_get()); gimi_message and
 * gimi_watch_event have reserved members.
 */

#include "gimnet/gimi_message.h"
#include "gimnet/gimi_options.h"
#include "gimnet/gimi_records.h"
#include "gimnet/gimi_requests.h"
#include "gimnet/gimi_types.h"
#include "gimnet/gimi_wait.h"

#ifdef __cplusplus
extern "C" {
#endif

/* ---------------------------------------------------------------- nodes */

/** Joins. GIMI_NO_HUB, GIMI_NO_HOST, GIMI_TIMEOUT, GIMI_BAD_VERSION, GIMI_NAME_TAKEN,
 * GIMI_BAD_NAME, GIMI_REFUSED, GIMI_DENIED, GIMI_BAD_ARGUMENT, GIMI_PROTOCOL, GIMI_LIMIT,
 * GIMI_SYSTEM. */
GIMNET_API gimi_status gimi_join(const gimi_node_options* options, gimi_handle* node);
/** Leaves for good: writes what still waits (at most a second), gives id and name back. Calls that
 * wait answer GIMI_CLOSED, what was received still comes. The handle stays, for gimi_state() and
 * gimi_lost(), until gimi_close(). */
GIMNET_API gimi_status gimi_leave(gimi_handle node);
/** Ends a handle of any kind; of a node, leaves first. The end of a publisher, subscription,
 * accepted service or watch asks the hub and waits for its answer, a second at most, and first for
 * calls of other threads that ask it with the same node. Calls that wait in it to receive answer
 * GIMI_CLOSED; others end as they would have. GIMI_CLOSED: no such handle, and nothing was done. */
GIMNET_API gimi_status gimi_close(gimi_handle handle);
/** The own id; 0: no such node, or it left. */
GIMNET_API gimi_peer gimi_id(gimi_handle node);
/** Fills the struct, as much as its struct_size says. After gimi_leave(): as it was then. */
GIMNET_API gimi_status gimi_state(gimi_handle node, gimi_node_state* state);
/** Tells the events of the connection of a node. The first one is that which was the last when this
 * was called: so it says what is. */
GIMNET_API gimi_status gimi_watch_connection(gimi_handle node, gimi_handle* events);
/** Takes the next event. GIMI_TIMEOUT. When all are taken and none will come: GIMI_CLOSED, or why
 * no connection will come. */
GIMNET_API gimi_status gimi_connection_receive(gimi_handle events, int32_t timeout_ms,
                                               gimi_connection_event* event);
GIMNET_API gimi_status gimi_lost(gimi_handle node, gimi_lost_counts* counts);
/** Takes another name in place of the one this node has. Id and subscriptions stay; services end
 * under their former full names and begin under the new ones. GIMI_TAKEN, GIMI_BAD_NAME. */
GIMNET_API gimi_status gimi_take_name(gimi_handle node, const char* name, int32_t timeout_ms);
/** Goes on without a name, and without services until it takes one. GIMI_NOT_FOUND. */
GIMNET_API gimi_status gimi_give_name_back(gimi_handle node, int32_t timeout_ms);

/* ---------------------------------------------------------------- services: data */

/** Provides the service `own name/name`; `name` has one part. GIMI_BAD_NAME, GIMI_TAKEN,
 * GIMI_DENIED (a node without a name), GIMI_LIMIT, GIMI_TIMEOUT, GIMI_NOT_CONNECTED. */
GIMNET_API gimi_status gimi_advertise(gimi_handle node, const char* name,
                                      const gimi_publish_options* options, gimi_handle* publisher);
/** Sends 0 bytes to 1 GiB to all subscribers; slow ones are not waited for. Without subscribers
 * nothing leaves the process, but of a retained service. `more`, not 0: others follow at once, and
 * are written together with the next one without it. Waits while the own send queue is full and
 * while another thread publishes. While the hub is away the message is dropped at once, also one to
 * be retained: GIMI_NOT_CONNECTED. GIMI_TIMEOUT (not sent), GIMI_NOT_RETAINED (sent, but too large
 * to be kept), GIMI_REFUSED (the hub did not take the service again), GIMI_TOO_LARGE. */
GIMNET_API gimi_status gimi_publish(gimi_handle publisher, const void* data, size_t size,
                                    int32_t timeout_ms, int32_t more);
/** gimi_publish() of `count` messages, written together. Stores in *published how many were sent;
 * the status is that of the next one. `published` may be NULL. */
GIMNET_API gimi_status gimi_publish_many(gimi_handle publisher, const gimi_bytes* messages,
                                         size_t count, int32_t timeout_ms, size_t* published);
/** Lends memory for a message of `size` bytes, to be published without another copy in the program.
 * GIMI_TOO_LARGE (over 1 GiB), GIMI_SYSTEM (no memory). Release or publish it. */
GIMNET_API gimi_status gimi_loan(gimi_handle publisher, size_t size, gimi_loaned* loan);
/** gimi_publish() of a loan. One that was sent is empty then; one that was not goes on as it is. */
GIMNET_API gimi_status gimi_publish_loan(gimi_handle publisher, gimi_loaned* loan,
                                         int32_t timeout_ms, int32_t more);
/** The number of subscribers, as the hub told last; 0 also if there is no such publisher. */
GIMNET_API size_t gimi_subscribers(gimi_handle publisher);
/** Waits until there are that many. */
GIMNET_API gimi_status gimi_wait_for_subscribers(gimi_handle publisher, size_t count,
                                                 int32_t timeout_ms);
/** Waits until the number of subscribers is another one than this call told last, and tells it; the
 * first call does not wait. A camera that nobody watches rests in it. GIMI_TIMEOUT, GIMI_CLOSED. */
GIMNET_API gimi_status gimi_subscribers_changed(gimi_handle publisher, int32_t timeout_ms,
                                                size_t* count);
/** The number of messages that gimi_publish() sent. */
GIMNET_API uint64_t gimi_published(gimi_handle publisher);
/** The number of messages that gimi_publish() dropped, since the hub was away. */
GIMNET_API uint64_t gimi_unsent(gimi_handle publisher);
/** GIMI_OK until the hub says that it does not keep the last message, a moment after
 * gimi_publish(); GIMI_NOT_RETAINED (why). */
GIMNET_API gimi_status gimi_retained(gimi_handle publisher);
/** GIMI_OK: the hub has this publisher, subscription or accepted service, or will be told with the
 * next connection. Otherwise why it did not take it again after a break or another name. */
GIMNET_API gimi_status gimi_standing(gimi_handle handle);
/** Copies the full name of the service of a publisher, subscription, accepted service or sender,
 * cut to size - 1 bytes; "" of a sender to a node. */
GIMNET_API gimi_status gimi_service_name(gimi_handle handle, char* name, size_t size);

/** Subscribes to a service by its full name; it need not exist yet. Each call makes a queue of its
 * own. Of several for one name the hub sends what the one wants that wants most, and a message
 * counts as taken when it is in all their queues. GIMI_BAD_NAME (also a name without a /, and a
 * pattern), GIMI_BAD_ARGUMENT, GIMI_LIMIT, GIMI_DENIED, GIMI_TIMEOUT, GIMI_NOT_CONNECTED,
 * GIMI_NOT_FOUND (it is there and accepts data: send to it). */
GIMNET_API gimi_status gimi_subscribe(gimi_handle node, const char* full_name,
                                      const gimi_subscribe_options* options,
                                      gimi_handle* subscription);
/** Tells what stands under the name of a subscription now: GIMI_PROVIDES, GIMI_ACCEPTS (nothing
 * will come), or GIMI_NOBODY. */
GIMNET_API gimi_status gimi_provider(gimi_handle subscription, gimi_direction* provider);
/** Waits until there is one that provides. */
GIMNET_API gimi_status gimi_wait_until_exists(gimi_handle subscription, int32_t timeout_ms);

/* ---------------------------------------------------------------- services: commands */

/** Lists the service `own name/name`, to which others send, and makes a queue of its own for what
 * they send, from which gimi_receive() takes. gimi_close() of the handle withdraws the service.
 * Errors: as gimi_advertise(). */
GIMNET_API gimi_status gimi_accept(gimi_handle node, const char* name,
                                   const gimi_accept_options* options, gimi_handle* accepted);
/** A stream to who accepts the service of that full name, with its key. It follows the service to
 * another node. GIMI_NOT_FOUND (no such service now, or one that gives data), GIMI_BAD_NAME,
 * GIMI_BAD_ARGUMENT (also other options than an earlier sender of this node to it), GIMI_LIMIT,
 * GIMI_TIMEOUT, GIMI_NOT_CONNECTED. */
GIMNET_API gimi_status gimi_sender_to_service(gimi_handle node, const char* full_name,
                                              const gimi_send_options* options, int32_t timeout_ms,
                                              gimi_handle* sender);
/** A stream to a node. Several of one (peer, key), or of one service, are one stream; the options
 * of the first hold as long as the node lives, and others are GIMI_BAD_ARGUMENT. GIMI_LIMIT. */
GIMNET_API gimi_status gimi_sender(gimi_handle node, gimi_peer to, const gimi_send_options* options,
                                   gimi_handle* sender);
/** Sends 0 bytes to 1 GiB. GIMI_OK: it is on its way; of a synchronized stream, gimi_settle() and
 * gimi_sent() tell what became of it. Waits while the window is full (GIMI_WAIT) or the hub has
 * paused the destination. `more` as in gimi_publish(). GIMI_TIMEOUT (nothing was sent),
 * GIMI_WINDOW_FULL, GIMI_NOT_FOUND (a service that nobody has, or that is away),
 * GIMI_NOT_CONNECTED, GIMI_REFUSED, GIMI_NOT_DELIVERED (also of end_at_loss: nothing was sent),
 * GIMI_TOO_LARGE. */
GIMNET_API gimi_status gimi_send(gimi_handle sender, const void* data, size_t size,
                                 int32_t timeout_ms, int32_t more);
/** gimi_send() by a caller that makes the call again after GIMI_TIMEOUT: this does not count among
 * the messages that were not sent while the hub was away (gimi_connection_event.why). gimi_send()
 * with a timeout of 0 does not either. */
GIMNET_API gimi_status gimi_try_send(gimi_handle sender, const void* data, size_t size,
                                     int32_t timeout_ms, int32_t more);
/** gimi_send(), and waits for the acknowledgement of this one message, which has its place among
 * all others of its stream; also without a window. GIMI_OK: it is in the queue of its receiver.
 * GIMI_NOT_DELIVERED (why it is not, or may not be). GIMI_TIMEOUT: the sentence says whether it was
 * sent; if so, it may still arrive. Waits at a full window, whatever gimi_send_options.at_full
 * says. Others as gimi_send(). */
GIMNET_API gimi_status gimi_send_confirmed(gimi_handle sender, const void* data, size_t size,
                                           int32_t timeout_ms);
/** Waits until nothing is unacknowledged. GIMI_OK: all that was sent so far was acknowledged.
 * GIMI_NOT_DELIVERED (how many were lost and why), GIMI_TIMEOUT. */
GIMNET_API gimi_status gimi_settle(gimi_handle sender, int32_t timeout_ms);
GIMNET_API gimi_status gimi_sent(gimi_handle sender, gimi_send_counts* counts);
/** The node that a sender sends to; 0 of one to a service. */
GIMNET_API gimi_peer gimi_sends_to(gimi_handle sender);
/** gimi_sender() and gimi_send() in one. */
GIMNET_API gimi_status gimi_send_to(gimi_handle node, gimi_peer to, const gimi_bytes* data,
                                    const gimi_send_options* options, int32_t timeout_ms);
/** Writes what `more` held back. Does not wait. */
GIMNET_API gimi_status gimi_flush(gimi_handle node);
/** Waits until everything sent so far was given to the kernel and, where resume is on, confirmed by
 * the hub. */
GIMNET_API gimi_status gimi_drain(gimi_handle node, int32_t timeout_ms);

/* ---------------------------------------------------------------- receiving */

/** The queue of a key, made or changed as told; without options as it is. Messages of keys for
 * which nobody asked wait too, in queues of gimi_node_options.queue_messages; of at most 1,024
 * keys. */
GIMNET_API gimi_status gimi_queue(gimi_handle node, gimi_key key, const gimi_queue_options* options,
                                  gimi_handle* queue);
/** Takes the oldest message of a subscription, queue or accepted service; of a node, the one that
 * waited longest in any. GIMI_TIMEOUT, GIMI_SILENCE, GIMI_CLOSED. Release it. */
GIMNET_API gimi_status gimi_receive(gimi_handle source, int32_t timeout_ms, gimi_message* message);
/** Takes the newest message of a subscription or queue and drops the others, which counts as taking
 * them. GIMI_TIMEOUT: there is none. */
GIMNET_API gimi_status gimi_receive_newest(gimi_handle source, gimi_message* message);
/** Waits for a message of a subscription or queue as gimi_receive(), and takes at most
 * messages_max, 1..GIMI_BATCH_MESSAGES_MAX, that are there. Behind one that counts in a window or
 * was published with GIMI_LATEST it takes no further one: a batch would hold them while they become
 * old. */
GIMNET_API gimi_status gimi_receive_packed(gimi_handle source, uint32_t messages_max,
                                           int32_t timeout_ms, gimi_batch* batch);
/** Changes the size of a queue while it runs; the oldest that no longer fit go and are counted. */
GIMNET_API gimi_status gimi_resize(gimi_handle source, size_t messages);
GIMNET_API gimi_status gimi_counts(gimi_handle source, gimi_queue_counts* counts);

/* ---------------------------------------------------------------- asking */

/** A node by its name, or by its id as text (`7.17`). GIMI_NOT_FOUND, GIMI_BAD_NAME, GIMI_TIMEOUT,
 * GIMI_NOT_CONNECTED. An answer for a name is remembered for a second. */
GIMNET_API gimi_status gimi_find(gimi_handle node, const char* name, int32_t timeout_ms,
                                 gimi_peer* peer);
/** Copies the name of a node, "" of one without a name, cut to size - 1 bytes. */
GIMNET_API gimi_status gimi_name_of(gimi_handle node, gimi_peer peer, int32_t timeout_ms,
                                    char* name, size_t size);
/** gimi_node_records of the nodes whose name matches (`*` one part, `**` any number; NULL or "":
 * all, those without a name too), ascending ids. GIMI_BAD_NAME (no pattern), GIMI_TIMEOUT,
 * GIMI_NOT_CONNECTED, GIMI_PROTOCOL. */
GIMNET_API gimi_status gimi_nodes(gimi_handle node, const char* pattern, int32_t timeout_ms,
                                  gimi_list* list);
/** The same of services: gimi_service_records, ascending group ids. */
GIMNET_API gimi_status gimi_services(gimi_handle node, const char* pattern, int32_t timeout_ms,
                                     gimi_list* list);
/** Watches the nodes and services (GIMI_WATCH_*) that match the pattern: first what is there, then
 * what changes. It goes on over reconnects. GIMI_BAD_NAME, GIMI_BAD_ARGUMENT, GIMI_LIMIT,
 * GIMI_TIMEOUT, GIMI_NOT_CONNECTED. */
GIMNET_API gimi_status gimi_watch(gimi_handle node, const char* pattern, uint32_t subjects,
                                  int32_t timeout_ms, gimi_handle* watch);
/** Takes the next event. What is not taken waits at the hub, which tells a watch that is too far
 * behind all from the start again. GIMI_TIMEOUT, GIMI_CLOSED. Release it. */
GIMNET_API gimi_status gimi_watch_receive(gimi_handle watch, int32_t timeout_ms,
                                          gimi_watch_event* event);

/** The questions of gimi_hub(); they are answered by one gimi_hub_record, gimi_counter_records,
 * gimi_connection_records (ascending ids), gimi_network_hub_records (ascending ids),
 * gimi_link_records, gimi_service_records (ascending group ids): the hub's own services, and those
 * of other hubs of which subscribers at this hub missed messages. */
typedef int32_t gimi_hub_question;
enum {
  GIMI_HUB = 0,
  GIMI_HUB_COUNTERS = 1,
  GIMI_HUB_CONNECTIONS = 2,
  GIMI_HUB_NETWORK = 3,
  GIMI_HUB_LINKS = 4,
  GIMI_HUB_MISSED = 5
};
/** Asks a hub of the network; hub_id 0 is the own one. Errors also: GIMI_NOT_FOUND (there is no way
 * to that hub). */
GIMNET_API gimi_status gimi_hub(gimi_handle node, gimi_hub_question question, uint32_t hub_id,
                                int32_t timeout_ms, gimi_list* list);

/** Sends a small message to the library of another node, which answers by itself with `echo` in it
 * (may be NULL). The round trip in ns, in that lane there and back. GIMI_TIMEOUT (lost, or late),
 * GIMI_NOT_DELIVERED (no such node, no way to it), GIMI_DENIED (a link between hubs may not carry
 * it). */
GIMNET_API gimi_status gimi_ping(gimi_handle node, gimi_peer to, gimi_lane lane,
                                 const gimi_bytes* echo, int32_t timeout_ms,
                                 int64_t* round_trip_ns);
/** As gimi_ping(), with gimi_trace_hop_records of the first 8 hubs that the answer passed. No
 * record: the other library answers without a trace. */
GIMNET_API gimi_status gimi_trace(gimi_handle node, gimi_peer to, gimi_lane lane,
                                  int32_t timeout_ms, int64_t* round_trip_ns, gimi_list* way_back);

/* ---------------------------------------------------------------- changing the hub: administrators
 */

/** Ends the session of a node, which is told `reason` (NULL, or at most 256 bytes) and does not
 * come back by itself. Copies what the hub cannot promise, as a rule "", to remark, cut to size - 1
 * bytes. GIMI_NOT_FOUND, GIMI_DENIED, GIMI_BAD_ARGUMENT. */
GIMNET_API gimi_status gimi_kick(gimi_handle node, gimi_peer peer, const char* reason,
                                 int32_t timeout_ms, char* remark, size_t size);
/** A node goes on under another id of its hub. */
typedef struct gimi_reassignment {
  gimi_peer from;
  gimi_peer to;
} gimi_reassignment;
/** GIMI_NOT_FOUND, GIMI_TAKEN, GIMI_DENIED, GIMI_BAD_ARGUMENT, GIMI_LIMIT (its disk is full). */
GIMNET_API gimi_status gimi_reassign(gimi_handle node, gimi_reassignment ids, int32_t timeout_ms);
/** The hub writes what waits, says goodbye to everybody, and ends. */
GIMNET_API gimi_status gimi_drain_hub(gimi_handle node, int32_t timeout_ms);
/** The hub reads its configuration again: gimi_hub_change_records. GIMI_BAD_ARGUMENT (it is wrong,
 * and nothing was changed), GIMI_DENIED. */
GIMNET_API gimi_status gimi_reload_hub(gimi_handle node, int32_t timeout_ms, gimi_list* changes);
/** A link for a hub to dial. */
typedef struct gimi_link_options {
  size_t struct_size;
  const char* url;
  const char* name; /**< NULL or "": the URL. */
  uint32_t cost;    /**< 0: measured; at most 65,535. */
  uint32_t reserved;
  const char* proxy; /**< As in gimi_node_options; NULL or "": none. */
} gimi_link_options;
/** The hub dials one link more, until it ends. GIMI_BAD_ARGUMENT. */
GIMNET_API gimi_status gimi_add_link(gimi_handle node, const gimi_link_options* link,
                                     int32_t timeout_ms);
/** Ends a link that the hub dials. GIMI_NOT_FOUND. */
GIMNET_API gimi_status gimi_remove_link(gimi_handle node, const char* name, int32_t timeout_ms);
/** Fixes the cost of a link that the hub dials; 0: measured. GIMI_NOT_FOUND. */
GIMNET_API gimi_status gimi_set_link_cost(gimi_handle node, const char* name, uint32_t cost,
                                          int32_t timeout_ms);
/** error, warning, info, debug or off. Copies the level before to `before`, cut to size - 1 bytes.
 */
GIMNET_API gimi_status gimi_set_hub_log_level(gimi_handle node, const char* level,
                                              int32_t timeout_ms, char* before, size_t size);

#ifdef __cplusplus
}
#endif

#endif /* GIMNET_GIMI_H */
