#ifndef GIMNET_GIMI_RECORDS_H
#define GIMNET_GIMI_RECORDS_H

/* The records of a hub: nodes, services, hubs, links, counters. Included by gimnet/gimi.h. Text is
 * never NULL. */

#include "gimnet/gimi_types.h"

#ifdef __cplusplus
extern "C" {
#endif

/** Records that a call made. It owns them and all that they point to until gimi_list_release(). */
typedef struct gimi_list {
  size_t count;
  size_t record_size;  /**< The library's. */
  const void* records; /**< The library's: read them with gimi_list_get(). */
  void* storage;       /**< The library's. */
} gimi_list;

/** Copies a record to `record`, as much of it as record_size, its size in this header, says; what
 * an older library does not have is zero. GIMI_BAD_ARGUMENT: NULL, no such index, or a size over
 * 4,096. */
GIMNET_API gimi_status gimi_list_get(const gimi_list* list, size_t index, void* record,
                                     size_t record_size);
/** Gives the memory back and empties the struct; does nothing with an empty one. NULL is ignored.
 */
GIMNET_API void gimi_list_release(gimi_list* list);

typedef struct gimi_node_record {
  gimi_peer id;
  uint32_t hub_id;
  const char* name; /**< "" for a node without a name. */
  const char* hub_name;
  const char* description;
  const char* place;  /**< Its address as its hub sees it. */
  uint64_t joined_ms; /**< Milliseconds since it joined. */
  uint32_t services;  /**< How many it provides or accepts. */
  uint8_t connected;  /**< 0: within its grace time. */
  uint8_t reserved[3];
} gimi_node_record;

typedef struct gimi_service_record {
  const char* name; /**< In full: node name/service name. */
  const char* hub_name;
  const char* metadata;
  gimi_peer node; /**< Of the provider. */
  uint32_t group_id;
  gimi_key key;
  gimi_direction direction;
  gimi_delivery delivery;
  uint32_t subscribers;
  uint32_t window; /**< Of GIMI_SYNC. */
  uint64_t missed; /**< Messages that subscribers at the asked hub missed, as they say. A watch does
                      not tell it. */
  gimi_peer missed_most; /**< The one of them that missed most; 0: nobody did. */
  uint8_t retain;        /**< 1: a new subscriber gets the last message first. */
  uint8_t reserved[3];
} gimi_service_record;

typedef struct gimi_hub_record {
  const char* name;
  const char* version;
  uint64_t uptime_ms;
  uint32_t hub_id;
  uint32_t shards;
  uint32_t nodes;
  uint32_t services;
} gimi_hub_record;

/** gimi_counter_record.shard of what the hub counted of peers that it did not admit. */
#define GIMI_CONDUCTOR UINT32_C(65535)

/** One counter of one io thread of the hub, by the names of docs/operations.md, in the hub's order.
 */
typedef struct gimi_counter_record {
  const char* name;
  uint64_t value;
  uint32_t shard; /**< Or GIMI_CONDUCTOR. */
  uint32_t reserved;
} gimi_counter_record;

typedef struct gimi_connection_record {
  const char* name;
  const char* transport; /**< "tcp" or "unix". */
  const char* peer;      /**< Its address. */
  gimi_peer node;
  uint32_t shard;
  uint64_t queued_bytes;   /**< Waiting for it at the hub. */
  uint64_t accepted;       /**< Frames that the hub took from it. */
  uint64_t received_bytes; /**< That the hub had from it. */
  uint64_t delivered;      /**< Frames handed to its connection; with resume, confirmed by it. */
  uint64_t sent_bytes;     /**< That the hub wrote to it. */
  uint64_t dropped;        /**< Frames that were for it. */
  uint64_t missed;         /**< Messages that its subscriptions missed, as it says. */
  uint8_t connected;
  uint8_t reserved[7];
  uint64_t queue_full; /**< Of those dropped, since its queue was full. */
} gimi_connection_record;

/** A link of a hub, as that hub tells. It keeps its members: what comes later of a link gets an
 * array of its own. */
typedef struct gimi_edge {
  uint32_t hub_id;
  uint32_t cost; /**< 0: not measured yet. */
} gimi_edge;

/** A hub that the asked one can reach, or could once, itself among them, and the way to it. */
typedef struct gimi_network_hub_record {
  const char* name;
  const char* version;
  const gimi_edge* edges;
  size_t edge_count;
  uint32_t hub_id;
  uint32_t distance; /**< Links on the way; 0: the hub that was asked. */
  uint32_t cost;     /**< Of the way; 0 also while its first link is not measured. */
  uint32_t next_hop; /**< Itself for the hub that was asked; 0: there is no way. */
  uint32_t nodes;    /**< 0 of another hub also where they are not known. */
  uint32_t services; /**< The same. */
  uint8_t reachable;
  uint8_t too_far; /**< 1: reachable, but over more links than a message may cross. */
  uint8_t reserved[6];
} gimi_network_hub_record;

/** A link of a hub to another one. */
typedef struct gimi_link_record {
  const char* name;
  const char* peer;  /**< The URL that is dialled, or where the other side came from. */
  const char* state; /**< dialling, away, learning, standby, damped, up or ended. */
  const char* last_error;
  uint32_t hub_id;         /**< At the other end; 0: not known. */
  uint32_t cost;           /**< 0: not measured yet. */
  uint32_t rtt_us;         /**< 0: none yet. */
  uint32_t dialled;        /**< 1: by this hub. */
  int64_t clock_offset_ns; /**< The other hub's clock minus this one's. */
  uint64_t clock_error_ns; /**< Of the offset; 0: it is not known. */
  uint64_t queued_bytes;
  uint64_t sent_bytes;
  uint64_t received_bytes;
  uint64_t accepted;   /**< Messages' frames from it. */
  uint64_t delivered;  /**< Frames that the other side confirmed. */
  uint64_t dropped;    /**< Frames for it. */
  uint64_t unsure;     /**< Of these, those that may have arrived. */
  uint64_t queue_full; /**< Of those dropped, since its queue was full. */
} gimi_link_record;

/** A key of the hub's configuration whose value is another one now, as its file writes them. */
typedef struct gimi_hub_change_record {
  const char* key;
  const char* from;
  const char* to;
  uint32_t needs_restart; /**< 1: `from` stays in force until then. */
  uint32_t reserved;
} gimi_hub_change_record;

/** When one hub had a message, by that hub's clock, in ns since 1970. */
typedef struct gimi_trace_hop_record {
  int64_t arrival_ns;
  int64_t departure_ns;
  uint32_t hub_id;
  uint32_t reserved;
} gimi_trace_hop_record;

/** The records of an event grow as those of lists, and are read by pointers: at least so many bytes
 * behind them are zero. So members that an older library does not have are zero here, too. In all
 * versions of libgimnet.so.1 these two records grow by no more than that. */
#define GIMI_RECORD_ROOM_BYTES 256

/** A node or a service that is there or changed, or neither for what is about the watch itself. It
 * owns its memory until gimi_watch_event_release(). */
typedef struct gimi_watch_event {
  gimi_change change;
  uint32_t hub_id;
  uint64_t epoch;                     /**< Of the hub's versions: another one after it was started
                                         again. */
  uint64_t version;                   /**< Of the hub's names and services after this change. */
  const gimi_node_record* node;       /**< NULL: it is not about a node. */
  const gimi_service_record* service; /**< NULL: it is not about a service. */
  const char* former_name;            /**< Of a node that was renamed. */
  const char* why;                    /**< Of GIMI_WATCH_ENDED. */
  void* storage;                      /**< The library's. */
  uint64_t reserved[2];
} gimi_watch_event;

/** As gimi_list_release(). */
GIMNET_API void gimi_watch_event_release(gimi_watch_event* event);

/** State of a node's connection at one moment. */
typedef struct gimi_node_state {
  size_t struct_size; /**< Set by the caller. */
  gimi_peer id;       /**< Changes only if a session could not be taken up again after a break. */
  uint32_t hub_id;
  uint32_t reconnects;
  uint8_t connected;
  uint8_t ended; /**< 1: it will not connect again; `trouble` says why. */
  uint8_t reserved[2];
  int64_t hub_round_trip_ns;       /**< 0: not measured yet. */
  int64_t hub_clock_offset_ns;     /**< Hub's clock minus this one. */
  uint64_t last_messages_not_kept; /**< Messages published with `retain` that are not kept for a hub
                                      that is started again. */
  char name[GIMI_NAME_BYTES_MAX + 1];
  char hub_name[GIMI_NAME_BYTES_MAX + 1];
  char trouble[GIMI_SENTENCE_BYTES_MAX + 1]; /**< Why the connection broke last. */
} gimi_node_state;

/** An event of a node's connection. */
typedef struct gimi_connection_event {
  size_t struct_size; /**< Set by the caller. */
  gimi_connection_change change;
  uint32_t skipped;                      /**< Events right before it that went, since 64 waited. */
  int64_t when_ns;                       /**< By this machine's clock, ns since 1970. */
  char why[GIMI_SENTENCE_BYTES_MAX + 1]; /**< The cause in words; GIMNET_LOG=info shows it, too. */
} gimi_connection_event;

/** Losses: messages and frames that were on their way to a node and cannot be given out. */
typedef struct gimi_lost_counts {
  size_t struct_size;         /**< Set by the caller. */
  uint64_t dropped;           /**< Messages of too many keys, or that are no GIMI messages. */
  uint64_t incomplete;        /**< Messages of which a part did not come, or did not fit. */
  uint64_t too_large;         /**< Messages larger than gimi_node_options.message_bytes_max. */
  uint64_t frames_broken_off; /**< Frames that the hub could not send again after a break. */
  uint64_t unknown_service;   /**< Messages of no service that this node subscribed. */
  uint64_t unreadable;        /**< Frames of other nodes that break the protocol. */
  uint64_t outdated;          /**< Messages that came after their sender had begun anew. */
  uint64_t queue_full;        /**< Frames dropped because this node's queue at the hub was full. */
  gimi_peer queue_filled_by;  /**< The node that had sent most of the bytes in it; 0: not known. */
  uint32_t reserved;
  uint64_t over_budget; /**< Frames dropped because the hub's memory for what waits was short. */
} gimi_lost_counts;

/** The fate of the messages of one stream. */
typedef struct gimi_send_counts {
  size_t struct_size; /**< Set by the caller. */
  uint64_t sent;
  uint64_t acknowledged;
  uint64_t lost;                /**< Known not to have arrived, or nobody will ever tell. */
  uint64_t skipped;             /**< Not sent: GIMI_SKIP, or replaced under GIMI_HOLD_LATEST. */
  uint64_t waiting;             /**< Sent and not acknowledged yet, and one that is held. */
  gimi_loss_reason loss_reason; /**< Of the last one; GIMI_LOSS_LINK_UNSURE stays. */
  char loss[GIMI_SENTENCE_BYTES_MAX + 1]; /**< The same in words. */
} gimi_send_counts;

/** The messages of a queue or subscription. */
typedef struct gimi_queue_counts {
  size_t struct_size;   /**< Set by the caller. */
  uint64_t waiting;     /**< Messages that wait now. */
  uint64_t received;    /**< All that ever came. */
  uint64_t overwritten; /**< Went because the queue was full. */
  uint64_t missed;      /**< Of a subscription: those that did not come, and those overwritten. */
} gimi_queue_counts;

#ifdef __cplusplus
}
#endif

#endif /* GIMNET_GIMI_RECORDS_H */
