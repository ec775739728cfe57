#ifndef GIMNET_NIF_NAMES_H
#define GIMNET_NIF_NAMES_H

/* Names, services and other questions to the hub. Included by gimnet/nif.h.
 *
 * All of these ask the hub and wait for its answer, for at most timeout_ms, over a break too:
 * beside what is named below they answer NIF_TIMEOUT, NIF_NOT_CONNECTED (broken, and the time is
 * up), NIF_REFUSED or NIF_REPLACED (it will not come back), NIF_PROTOCOL (the hub's answer cannot
 * be), NIF_BAD_ARGUMENT (NULL), NIF_IN_CALLBACK, NIF_NO_MEMORY, and what nif.h says of handles.
 * Names are at most NIF_NAME_BYTES_MAX bytes: up to 16 parts of A-Z a-z 0-9 . _ -, separated by `/`
 * (docs/protocol.md, section 8). */

#include <stddef.h>
#include <stdint.h>

#include "gimnet/nif_status.h"

#ifdef __cplusplus
extern "C" {
#endif

/** One connection to a hub, one node. Opaque; not a pointer to anything. */
typedef struct nif_node nif_node;

/** Finds a node by its name. An answer is remembered for a second, and forgotten earlier where a
 * REPORT says no_such_node or renumbered, and at every break. NIF_NOT_FOUND, NIF_BAD_NAME,
 * NIF_TIMEOUT, NIF_NOT_CONNECTED. */
GIMNET_API nif_status nif_resolve(nif_node* node, const char* name, uint32_t* id,
                                  int32_t timeout_ms);

/** Finds the name of a node, "" for one without a name; remembered as those of nif_resolve().
 * `name` must have room for NIF_NAME_BYTES_MAX + 1 bytes. NIF_NOT_FOUND. */
GIMNET_API nif_status nif_reverse(nif_node* node, uint32_t id, char* name, int32_t timeout_ms);

/** One node of a list. Text: NUL-terminated, never NULL. */
typedef struct nif_node_record {
  uint32_t id;
  uint32_t hub_id;
  uint32_t services;  /**< Services it provides or accepts. */
  uint32_t connected; /**< 0: within its grace time. */
  uint64_t joined_ms; /**< Milliseconds since it joined. */
  const char* name;
  const char* hub_name;
  const char* description;
  const char* place; /**< Address of the peer as its hub sees it. */
} nif_node_record;

typedef struct nif_node_list {
  size_t count;
  const nif_node_record* records; /**< Ascending node ids. */
} nif_node_list;

/** Lists the nodes whose name matches the pattern (`*` one part, `**` any number; NULL: all nodes,
 * also those without a name) into *list, which nif_free_nodes() frees. It is asked for in pages:
 * nodes that come or go meanwhile may be in it or not. NIF_BAD_NAME: no pattern. */
GIMNET_API nif_status nif_list_nodes(nif_node* node, const char* pattern, nif_node_list** list,
                                     int32_t timeout_ms);
GIMNET_API void nif_free_nodes(nif_node_list* list);

typedef enum nif_direction { NIF_PROVIDES = 0, NIF_ACCEPTS = 1 } nif_direction;
/** The messages that a subscriber gets: all; only the newest of those that wait; or, of sync(n), at
 * most n that it has not taken, its hub holding the newest for it. */
typedef enum nif_delivery {
  NIF_STREAM_DELIVERY = 0,
  NIF_LATEST_DELIVERY = 1,
  NIF_SYNC_DELIVERY = 2
} nif_delivery;

/** A service to advertise. Its full name is `node name/name`. */
typedef struct nif_service {
  size_t struct_size; /**< sizeof(nif_service). */
  const char* name;   /**< One part, without '/'. */
  uint32_t message_type;
  uint32_t instance;
  uint8_t direction;    /**< nif_direction. */
  uint8_t delivery;     /**< nif_delivery. */
  const char* metadata; /**< For people and tools, at most 4,096 bytes of UTF-8; may be NULL. */
  uint32_t window; /**< n of NIF_SYNC_DELIVERY, 0: 1. At most the hub's limit, 1,024 unless it was
                      set. */
  /** Not 0: the hub keeps the last message (16 MiB) and gives it to each new subscriber first. The
   * library keeps a copy (nif_options.last_message_bytes) and gives it to a hub that may have lost
   * its own, before newer messages of its lane: after a break without resume, under another group,
   * or after a NIF_GAP of the own id. Subscribers may get it twice then. */
  uint8_t retain;
} nif_service;

/** Declares a service; stores its group id in *group and, if subscribers is not NULL, how many
 * subscribers wait for it already. The library declares it again after every reconnect, under the
 * former group id where the hub can. NIF_BAD_NAME, NIF_TAKEN (this node has such a service),
 * NIF_LIMIT, NIF_DENIED (a node without a name). */
GIMNET_API nif_status nif_advertise(nif_node* node, const nif_service* service, uint32_t* group,
                                    uint32_t* subscribers, int32_t timeout_ms);

/** Ends an own service. NIF_NOT_FOUND; NIF_DENIED: it is another node's; NIF_BAD_ARGUMENT: group is
 * 0. */
GIMNET_API nif_status nif_withdraw(nif_node* node, uint32_t group, int32_t timeout_ms);

/** The same by its name, whatever group it has by now: also of a service that the hub moved or
 * refuses at the moment. The library declares it no more, whatever this answers; where the hub
 * could not be told within the time given, it is as soon as there is a connection. NIF_NOT_FOUND:
 * this node has no such service. NIF_BAD_NAME. */
GIMNET_API nif_status nif_withdraw_service(nif_node* node, const char* name, int32_t timeout_ms);

/** One service of a list. Text: NUL-terminated, never NULL. */
typedef struct nif_service_record {
  uint32_t group;
  uint32_t node_id;
  uint32_t message_type;
  uint32_t instance;
  uint32_t subscribers;
  uint8_t direction;
  uint8_t delivery;
  const char* name; /**< Full name. */
  const char* metadata;
  const char* hub_name;
  uint32_t window; /**< n of NIF_SYNC_DELIVERY. */
  uint8_t retain;
  uint64_t missed;      /**< Messages that subscribers at the asked hub missed, as they say. A watch
                           does not tell it. */
  uint32_t missed_most; /**< The node id of the one that missed most; 0: nobody did. */
} nif_service_record;

typedef struct nif_service_list {
  size_t count;
  const nif_service_record* records; /**< Ascending group ids. */
} nif_service_list;

/** Lists services by a pattern of full names, as nif_list_nodes(). */
GIMNET_API nif_status nif_list_services(nif_node* node, const char* pattern,
                                        nif_service_list** list, int32_t timeout_ms);
GIMNET_API void nif_free_services(nif_service_list* list);

/** The state of a subscription at the moment. */
typedef struct nif_subscription {
  uint32_t group; /**< 0: there is no such service yet; NIF_SERVICE_MOVED comes when there is. */
  uint32_t message_type;
  uint32_t instance;
  uint32_t delivery; /**< nif_delivery. */
  uint32_t window;   /**< In force: messages that may be untaken; 0: any number. */
  uint32_t retain;   /**< 1: the last message comes first. */
  /** nif_direction. NIF_ACCEPTS: nothing will come, since the service takes data; this tells where
   * it is, for who sends to it (NIF_SERVICE). */
  uint32_t direction;
  uint32_t provider; /**< Node id; 0: nobody provides it at the moment. */
  uint64_t session;  /**< Of the provider: tells one program from the next under that id. */
} nif_subscription;

/** The part of a service that a subscriber wants. Members that are 0 ask for nothing. */
typedef struct nif_pace {
  size_t struct_size; /**< sizeof(nif_pace). */
  uint32_t window;    /**< Untaken messages at most, with any delivery; of sync(n) fewer than n. */
  uint32_t depth;     /**< Newest messages that the hub holds meanwhile; 0: 1, always the latest. At
                         most 64. */
  double rate_hz;     /**< Messages a second at most, the newest at each due time: 0.001..1,000. */
} nif_pace;

/** Subscribes to a service by its full name; it need not exist yet. The library subscribes again
 * after every reconnect. subscription may be NULL. NIF_BAD_NAME (also of a name without a /, which
 * no service has, and of a pattern, which nif_watch() takes), NIF_LIMIT, NIF_DENIED. */
GIMNET_API nif_status nif_subscribe(nif_node* node, const char* full_name,
                                    nif_subscription* subscription, int32_t timeout_ms);

/** The same with a pace; NULL: none. Of a service that is subscribed already this changes it; where
 * the hub could not be told within the time given, it is with the next connection. Also
 * NIF_BAD_REQUEST: a number beyond the hub's limit.
 */
GIMNET_API nif_status nif_subscribe_paced(nif_node* node, const char* full_name,
                                          const nif_pace* pace, nif_subscription* subscription,
                                          int32_t timeout_ms);

/** With nif_options.credit_by_program: the program took so many messages of the group that came
 * with this nif_incoming.epoch. The hub is told at once, or, with `more`, when half of the window
 * was taken: more is waiting to be taken anyway. An epoch of 0, an earlier one, and groups without
 * a window are ignored. Does not wait; may be called in the callback. No errors beside those of
 * handles: while the connection is broken it is told after it is back. */
GIMNET_API nif_status nif_credit(nif_node* node, uint32_t group, uint32_t epoch, uint32_t messages,
                                 int more);

/** Ends a subscription. NIF_NOT_FOUND. Messages that are on their way already may still come. The
 * library subscribes to it no more, whatever this answers; where the hub could not be told within
 * the time given, it is as soon as there is a connection. */
GIMNET_API nif_status nif_unsubscribe(nif_node* node, const char* full_name, int32_t timeout_ms);

/* ---------------------------------------------------------------- asking the hub */

/** Kinds for nif_request(); the operations are in docs/protocol.md, sections 8 and 9. */
enum { NIF_NS = 17, NIF_CTRL = 18 };
enum {
  NIF_CTRL_HUB_INFO = 1,
  NIF_CTRL_STATISTICS = 2,
  NIF_CTRL_CONNECTIONS = 3,
  NIF_CTRL_KICK = 4,
  NIF_CTRL_REASSIGN = 5,
  NIF_CTRL_DRAIN = 6,
  NIF_CTRL_RELOAD = 7,
  NIF_CTRL_LOG_LEVEL = 8,
  NIF_CTRL_HUBS = 9,
  NIF_CTRL_LINKS = 10,
  NIF_CTRL_LINK_ADD = 11,
  NIF_CTRL_LINK_REMOVE = 12,
  NIF_CTRL_LINK_COST = 13
};

/** Most bytes of content of a nif_request(). */
#define NIF_REQUEST_BYTES_MAX ((size_t)16 * 1024)

/** An answer of the hub as it came. Belongs to the caller until nif_free_reply(). */
typedef struct nif_reply {
  uint16_t status;     /**< Of the wire: 0 done. */
  const void* content; /**< Bitestream of the answer, keys 1 and 2 included. */
  size_t size;
  const char* sentence; /**< Of the hub, if status is not 0; never NULL. */
} nif_reply;

/** Sends a request (kind NIF_NS or NIF_CTRL, an operation below 0x8000, and its Bitestream) to the
 * own hub and waits for the answer. NIF_OK: *reply holds it, whatever its status. NIF_BAD_ARGUMENT
 * also: another kind or operation, or more than NIF_REQUEST_BYTES_MAX bytes of content. */
GIMNET_API nif_status nif_request(nif_node* node, uint8_t kind, uint16_t operation,
                                  const void* content, size_t size, nif_reply** reply,
                                  int32_t timeout_ms);
/** The same of another hub of the network; hub_id 0 is the own hub. Requests that change a hub are
 * answered `denied` there. */
GIMNET_API nif_status nif_request_of_hub(nif_node* node, uint32_t hub_id, uint8_t kind,
                                         uint16_t operation, const void* content, size_t size,
                                         nif_reply** reply, int32_t timeout_ms);
GIMNET_API void nif_free_reply(nif_reply* reply);

/** Measures the way to the hub with one FLOW PING: round trip and hub's clock minus this one, in
 * ns; either may be NULL. The clock offset is good to half of the round trip. */
GIMNET_API nif_status nif_ping_hub(nif_node* node, int64_t* round_trip_ns, int64_t* clock_offset_ns,
                                   int32_t timeout_ms);

#ifdef __cplusplus
}
#endif

#endif /* GIMNET_NIF_NAMES_H */
