#ifndef GIMNET_GIMI_TYPES_H
#define GIMNET_GIMI_TYPES_H

/* Handles, answers and enumerations of GIMI. Included by gimnet/gimi.h. */

#include <stddef.h>
#include <stdint.h>

#include "gimnet/export.h"

#ifdef __cplusplus
extern "C" {
#endif

/** Names a node, publisher, subscription, queue, sender, watch, answering service, request, wait
 * set or the events of a connection: kind (8 bits), slot (24 bits) and generation (32 bits). 0 is
 * no handle. One of another kind, closed, or never given is refused. */
typedef uint64_t gimi_handle;

/** The id of a node: hub << 20 | index, shown as `7.17`. 0 is nobody. */
typedef uint32_t gimi_peer;

/** Waits without a limit; so does any negative time. 0 does not wait. */
#define GIMI_FOREVER (-1)
/** Longest name of a node or service in bytes, without the terminating NUL. */
#define GIMI_NAME_BYTES_MAX 255
/** Longest sentence of this library in bytes, without the terminating NUL. */
#define GIMI_SENTENCE_BYTES_MAX 1024
/** The longest sentence of gimi_error_text(): a hub may tell many faults of its configuration. */
#define GIMI_ERROR_BYTES_MAX 8192

/** The pointer to options of that type for a call, filled as told; what is not told is zero, the
 * default: gimi_join(GIMI_OPTIONS(gimi_node_options, .name = "robot"), &node). */
#define GIMI_OPTIONS(type, ...) (&(const type){.struct_size = sizeof(type), __VA_ARGS__})

/* Enumerations are int32_t. Show numbers that you do not know: later versions have more. */

/** Answers of all functions. gimi_error_text() is the sentence of the last failed one. */
typedef int32_t gimi_status;
enum {
  GIMI_OK = 0,
  GIMI_TIMEOUT = 1,        /**< The time given was not enough. Try again. */
  GIMI_CLOSED = 2,         /**< No such handle, or it or its node was closed. */
  GIMI_BAD_ARGUMENT = 3,   /**< A parameter is outside its range: a mistake of the program. */
  GIMI_NO_HUB = 4,         /**< Nothing answers at the hub's address. */
  GIMI_NO_HOST = 5,        /**< No address is known for the host in the hub's URL. */
  GIMI_NOT_CONNECTED = 6,  /**< The connection is broken at the moment. */
  GIMI_BAD_VERSION = 7,    /**< The hub speaks another major version of the protocol. */
  GIMI_NAME_TAKEN = 8,     /**< Another live node holds the name. */
  GIMI_BAD_NAME = 9,       /**< The name breaks the rules (docs/protocol.md, section 8). */
  GIMI_REFUSED = 10,       /**< The hub is full, draining, or ended the session. */
  GIMI_NOT_FOUND = 11,     /**< No node or service of that name. */
  GIMI_TAKEN = 12,         /**< This node has such a service already. */
  GIMI_DENIED = 13,        /**< This node may not do that. */
  GIMI_LIMIT = 14,         /**< A limit of the hub or of the library was reached. */
  GIMI_TOO_LARGE = 15,     /**< The message is larger than allowed. */
  GIMI_NOT_DELIVERED = 16, /**< The message is known not to have arrived. */
  GIMI_WINDOW_FULL = 17,   /**< GIMI_SKIP: nothing was sent. */
  GIMI_PROTOCOL = 18,      /**< The peer sent bytes that docs/protocol.md forbids. */
  GIMI_SYSTEM = 19,        /**< The operating system refused, or memory is out. */
  GIMI_FORKED = 20,       /**< The handle belongs to the parent process: after fork(), join anew. */
  GIMI_NOT_RETAINED = 21, /**< The message was published, but is not kept for later subscribers. */
  GIMI_BUSY = 22,         /**< Too many requests wait for the program that was asked. */
  GIMI_FAILED = 23,       /**< The program that was asked says so, with a code of its own. */
  GIMI_GONE = 24,         /**< The program that was asked has ended, or let the request go. */
  GIMI_SILENCE = 25,      /**< Nothing came for gimi_subscribe_options.silence_ms. */
  /* Of rights and trust. No call answers these yet. */
  GIMI_NOT_TRUSTED = 32,
  GIMI_NO_RIGHT = 33,
  GIMI_EXPIRED = 34
};

/** Why a message did not arrive. Numbers below 64 are the hub's (docs/protocol.md, section 5). */
typedef int32_t gimi_loss_reason;
enum {
  GIMI_LOSS_NONE = 0,
  GIMI_LOSS_NO_SUCH_NODE = 1,
  GIMI_LOSS_NO_ROUTE = 2,
  GIMI_LOSS_AWAY = 3,
  GIMI_LOSS_QUEUE_FULL = 4,
  GIMI_LOSS_REPLACED = 5,
  GIMI_LOSS_TOO_OLD = 6,
  GIMI_LOSS_HOP_LIMIT = 7,
  GIMI_LOSS_TOO_LARGE = 8,
  GIMI_LOSS_NOT_ALLOWED = 9,
  GIMI_LOSS_WRONG_WAY = 10,
  GIMI_LOSS_LINK_LOST = 11,
  GIMI_LOSS_SHARD_FULL = 12,
  GIMI_LOSS_NO_SUCH_GROUP = 13,
  GIMI_LOSS_RENUMBERED = 14,
  GIMI_LOSS_OVER_BUDGET = 15,
  GIMI_LOSS_TIMED_OUT = 16,
  GIMI_LOSS_CUT_MESSAGE = 17,
  GIMI_LOSS_NO_SUBSCRIBER = 18,
  GIMI_LOSS_MALFORMED = 19,
  GIMI_LOSS_WRONG_SOURCE = 20,
  GIMI_LOSS_LINK_UNSURE = 22,
  GIMI_LOSS_NOT_RECEIVED = 64, /**< Its receiver answered a later question, but did not get it. */
  GIMI_LOSS_REFUSED = 65,      /**< Its receiver does not take it: it is too large. */
  GIMI_LOSS_CONNECTION_LOST = 66, /**< The own connection broke, or ended. */
  GIMI_LOSS_SERVICE_GONE = 67     /**< The service was withdrawn or is somewhere else now. */
};

/** A lower lane goes first at every queue; there is no order between lanes. The numbers are those
 * of the wire plus 1, so that 0 is the default. */
typedef int32_t gimi_lane;
enum {
  GIMI_LANE_DEFAULT = 0, /**< GIMI_LANE_NORMAL. */
  GIMI_LANE_REAL_TIME = 1,
  GIMI_LANE_NORMAL = 2,
  GIMI_LANE_BULK = 3,
  GIMI_LANE_BACKGROUND = 4
};

/** A way to deliver: `stream` every message, in order; `latest` only the newest of those that wait;
 * `sync` at most a window of messages that the subscriber has not taken, its hub holding the newest
 * meanwhile. */
typedef int32_t gimi_delivery;
enum { GIMI_STREAM = 0, GIMI_LATEST = 1, GIMI_SYNC = 2 };

/** A service gives data to its subscribers, or takes data that others send to it. */
typedef int32_t gimi_direction;
enum { GIMI_PROVIDES = 0, GIMI_ACCEPTS = 1, GIMI_NOBODY = -1 };
/** The message type of an accepting service that answers requests. */
#define GIMI_REQUEST_TYPE 0x54534551u

/** The behaviour of a full queue when a message comes. */
typedef int32_t gimi_at_full_queue;
enum {
  GIMI_OVERWRITE_OLDEST = 0, /**< A ring buffer; of size 1 it holds the newest. */
  GIMI_STOP_READING = 1      /**< The node reads nothing more, for all its queues, until there is
                                room. Keep-alive goes on. */
};

/** The behaviour of a sender when as much as its window allows is not acknowledged. */
typedef int32_t gimi_at_full_window;
enum {
  GIMI_WAIT = 0,       /**< Until there is room, at most the time given. */
  GIMI_SKIP = 1,       /**< Send nothing and answer GIMI_WINDOW_FULL. */
  GIMI_HOLD_LATEST = 2 /**< Keep this one in place of one that is kept, and send it later. */
};

/** The kinds of events of a watch. */
typedef int32_t gimi_change;
enum {
  GIMI_SNAPSHOT_BEGINS = 0, /**< All told before is void. */
  GIMI_PRESENT = 1,         /**< Part of the snapshot. */
  GIMI_SNAPSHOT_ENDS = 2,   /**< All that is there was told; changes follow. */
  GIMI_NODE_JOINED = 3,
  GIMI_NODE_LEFT = 4, /**< For good: only its id, name and hub id are told. */
  GIMI_NODE_AWAY = 5, /**< Its connection broke, its grace time runs. */
  GIMI_NODE_BACK = 6,
  GIMI_NODE_RENAMED = 7,
  GIMI_CHANGED = 8, /**< Something else of the record. */
  GIMI_ADVERTISED = 9,
  GIMI_WITHDRAWN = 10,   /**< A service: only its name, group id and node are told. */
  GIMI_WATCH_ENDED = 255 /**< After a reconnect the hub did not take the watch again. */
};

/** The changes of the connection between a node and its hub. */
typedef int32_t gimi_connection_change;
enum {
  GIMI_CONNECTED = 0,       /**< The first connection. */
  GIMI_CONNECTION_LOST = 1, /**< The library dials again. */
  GIMI_RESUMED = 2,         /**< There is one again, and the session goes on. */
  GIMI_CONNECTED_ANEW = 3,  /**< There is one again; what was on its way is lost. */
  GIMI_CONNECTION_ENDED = 4 /**< No connection will come any more. */
};

/** The application's kind of a message: it selects a queue of the receiver. */
typedef struct gimi_key {
  uint32_t type;
  uint32_t instance;
} gimi_key;

/** A piece of memory. */
typedef struct gimi_bytes {
  const void* data; /**< May be NULL if size is 0. */
  size_t size;
} gimi_bytes;

/** A short English text for a number, for example "name taken"; "unknown ..." for one of a later
 * version. Never NULL; static. */
GIMNET_API const char* gimi_status_text(gimi_status status);
GIMNET_API const char* gimi_change_text(gimi_change change);

/** The sentence (what happened, to what, what to do) of the last call of this thread that failed:
 * UTF-8, at most GIMI_ERROR_BYTES_MAX bytes, never NULL. Calls that succeed, release and
 * gimi_close() leave it alone. Valid until: the next gimi_* call of this thread that fails. */
GIMNET_API const char* gimi_error_text(void);

#ifdef __cplusplus
}
#endif

#endif /* GIMNET_GIMI_TYPES_H */
