#ifndef GIMNET_NIF_WATCH_H
#define GIMNET_NIF_WATCH_H

/* The own name, and watching the names and services of others. Included by gimnet/nif.h. */

#include <stdint.h>

#include "gimnet/nif_names.h"

#ifdef __cplusplus
extern "C" {
#endif

/* ---------------------------------------------------------------- the own name */

/** Takes another name in place of the one that this node has, if any. Id and subscriptions stay.
 * Services are withdrawn and declared again under the new name by the library, each with a
 * NIF_OWN_SERVICE_MOVED. NIF_NAME_LOST tells should a node of another hub have the better claim to
 * the name. NIF_TAKEN (a live node holds it; the sentence says which), NIF_BAD_NAME,
 * NIF_TIMEOUT, NIF_NOT_CONNECTED. */
GIMNET_API nif_status nif_register(nif_node* node, const char* name, int32_t timeout_ms);

/** Gives the own name back; the node goes on without one. Its services are withdrawn, and come back
 * should it take a name again. NIF_NOT_FOUND: it has none. */
GIMNET_API nif_status nif_unregister(nif_node* node, int32_t timeout_ms);

/* ---------------------------------------------------------------- watching */

/** The subjects of a watch: a set of bits. */
typedef enum nif_subjects {
  NIF_WATCH_NODES = 1,
  NIF_WATCH_SERVICES = 2,
  NIF_WATCH_ALL = 3,
  /** Beside the others: the hub sends more only as the program calls nif_watch_taken(), not as it
     receives. */
  NIF_WATCH_BY_HAND = 0x100
} nif_subjects;

/** The kinds of nif_watched; unknown ones of later versions are to be skipped. */
typedef enum nif_change {
  NIF_SNAPSHOT_BEGINS = 0, /**< Everything told of this watch before is void: once at its beginning,
                              and later whenever it was too far behind to be told each change. */
  NIF_PRESENT = 1,         /**< Part of the snapshot [node or service]. */
  NIF_SNAPSHOT_ENDS = 2,   /**< All that is there was told; changes follow. */
  NIF_NODE_JOINED = 3,     /**< [node] */
  NIF_NODE_LEFT = 4,       /**< For good [node: id, name, hub_id]. */
  NIF_NODE_AWAY = 5,       /**< Its connection broke, its grace time runs [node]. */
  NIF_NODE_BACK = 6,       /**< It is connected again [node]. */
  NIF_NODE_RENAMED = 7,    /**< [node, former_name] */
  NIF_CHANGED = 8,         /**< Something else of its record [node or service]. */
  NIF_ADVERTISED = 9,      /**< [service] */
  NIF_WITHDRAWN = 10,      /**< [service: group, name, node_id] */
  NIF_WATCH_ENDED = 255 /**< After a reconnect the hub did not take the watch again; the incoming's
                           text says why. */
} nif_change;

/** A node or service that changed, or is there. */
typedef struct nif_watched {
  uint32_t watch;
  uint32_t change; /**< nif_change. */
  uint32_t hub_id; /**< The hub of these nodes and services. */
  uint64_t epoch;  /**< Of that hub's versions: another one after it was started again. */
  uint64_t version;
  const nif_node_record* node;       /**< NULL: it is not about a node. */
  const nif_service_record* service; /**< NULL: it is not about a service. */
  const char* former_name;           /**< Never NULL. */
  uint8_t last; /**< 1: the last of those that came together; see nif_watch_taken(). */
} nif_watched;

/** Watches the nodes or services or both (nif_subjects) that fit the pattern (`*` one part, `**`
 * any number; NULL: all, nodes without a name too); stores the number of the watch in *watch. What
 * there is and what changes comes as NIF_WATCHED. Nothing is left out: the library sees gaps and
 * asks for a new snapshot, and after a reconnect it goes on where it was, or with a new snapshot. A
 * program that does not receive is told less often, not slower than others. NIF_BAD_NAME (no
 * pattern), NIF_BAD_ARGUMENT, NIF_LIMIT, NIF_TIMEOUT, NIF_NOT_CONNECTED. */
GIMNET_API nif_status nif_watch(nif_node* node, const char* pattern, uint32_t subjects,
                                uint32_t* watch, int32_t timeout_ms);

/** Asks for a new snapshot of a watch: for programs that threw away what they were told.
 * NIF_NOT_FOUND. */
GIMNET_API nif_status nif_watch_again(nif_node* node, uint32_t watch, int32_t timeout_ms);

/** For a watch with NIF_WATCH_BY_HAND: one that was `last` has been seen to, the hub may send more.
 * Does not wait; may be called in the callback. A number that no watch has is ignored. No errors
 * beside those of handles: while the connection is broken there is nothing to tell, and the hub
 * begins to count anew. */
GIMNET_API nif_status nif_watch_taken(nif_node* node, uint32_t watch);

/** Ends a watch. NIF_NOT_FOUND. Events received before still come. */
GIMNET_API nif_status nif_unwatch(nif_node* node, uint32_t watch, int32_t timeout_ms);

#ifdef __cplusplus
}
#endif

#endif /* GIMNET_NIF_WATCH_H */
