#ifndef GIMNET_GIMI_WAIT_H
#define GIMNET_GIMI_WAIT_H

/*
 * Waiting for many things with one thread. Included by gimnet/gimi.h.
 *
 *     gimi_handle set;
 *     gimi_ready ready[8];
 *     size_t count;
 *     gimi_wait_set_create(&set);
 *     gimi_wait_set_add(set, pose, 1);    // a subscription, by a number of the program's own
 *     gimi_wait_set_add(set, orders, 2);  // an accepted service
 *     while (gimi_wait_set_wait(set, ready, 8, sizeof *ready, GIMI_FOREVER, &count) == GIMI_OK)
 *       for (size_t i = 0; i < count; ++i)
 *         if (gimi_receive(ready[i].member, 0, &message) == GIMI_OK) take(ready[i].user, &message);
 */

#include "gimnet/gimi_types.h"

#ifdef __cplusplus
extern "C" {
#endif

/** A member of a set that has something. */
typedef struct gimi_ready {
  gimi_handle member;
  uint64_t user; /**< As gimi_wait_set_add() was told. */
  uint64_t reserved;
} gimi_ready;

/** Makes a set; gimi_close() ends it: its members are in none then, and its descriptor is closed.
 * GIMI_LIMIT. */
GIMNET_API gimi_status gimi_wait_set_create(gimi_handle* set);
/** Makes a handle a member, of any node: a subscription, a queue, an accepted service, an answering
 * service, a watch, a request that was asked with gimi_ask_later(), a publisher, which has
 * something while gimi_subscribers_changed() would not wait, the events of a connection, or a node,
 * from which gimi_receive() takes too. Closing the handle removes it. GIMI_TAKEN: it, or another
 * handle of the same queue, is in a set. GIMI_BAD_ARGUMENT: nothing is received from such a handle.
 * GIMI_CLOSED: also of a request that has given its end. */
GIMNET_API gimi_status gimi_wait_set_add(gimi_handle set, gimi_handle member, uint64_t user);
/** When it returns, no call of gimi_wait_set_wait() will give the member any more. GIMI_NOT_FOUND:
 * it is not in this set. GIMI_CLOSED: the handle was closed, which had removed it. */
GIMNET_API gimi_status gimi_wait_set_remove(gimi_handle set, gimi_handle member);
/** Waits until a member has something, and stores at most ready_max of those that have, each of
 * ready_size bytes, which is sizeof(gimi_ready). What has something stays so, and is given again,
 * until the program took it: no wake-up is lost. Those that were given longest ago come first. A
 * member whose node was closed, or will not connect any more, has its end to tell, for ever: remove
 * it. Ask members without waiting: another thread may have been faster, and requests become too
 * late. GIMI_OK with *count 0: gimi_wait_set_wake(). GIMI_TIMEOUT, GIMI_CLOSED. */
GIMNET_API gimi_status gimi_wait_set_wait(gimi_handle set, gimi_ready* ready, uint32_t ready_max,
                                          size_t ready_size, int32_t timeout_ms, size_t* count);
/** One gimi_wait_set_wait() ends at once: one that waits, or else the next. */
GIMNET_API gimi_status gimi_wait_set_wake(gimi_handle set);
/** A descriptor for poll() and other loops: readable while gimi_wait_set_wait() would not wait. The
 * program reads nothing from it and does not close it. While nobody asked for it, members cost no
 * system calls. GIMI_SYSTEM: the system has none left. */
GIMNET_API gimi_status gimi_wait_set_descriptor(gimi_handle set, int32_t* descriptor);

/** Tells whether this thread is now inside a callback of an event loop (not 0). There gimi_ask()
 * answers GIMI_BAD_ARGUMENT instead of standing in the way of all others. What it was before. */
GIMNET_API int32_t gimi_in_callback(int32_t inside);

#ifdef __cplusplus
}
#endif

#endif /* GIMNET_GIMI_WAIT_H */
