#ifndef GIMNET_GIMI_OPTIONS_H
#define GIMNET_GIMI_OPTIONS_H

/* Options of GIMI's calls. Included by gimnet/gimi.h. Each begins with its struct_size, which
 * GIMI_OPTIONS() fills. Zero always means the default, and where a call takes a pointer to options,
 * NULL means all defaults. A later library has more members, at the
 * end and in place of `reserved`; one that is older refuses a program that sets a member which it
 * does not have. So `reserved` must be zero. */

#include "gimnet/gimi_types.h"

#ifdef __cplusplus
extern "C" {
#endif

/** Most messages of one (destination, key) that may wait for their ACK. */
#define GIMI_WINDOW_MAX 64
/** Most payload bytes of them. A larger message goes when no other waits. */
#define GIMI_WINDOW_BYTES_MAX ((size_t)1 << 20)
/** Largest message. */
#define GIMI_MESSAGE_BYTES_MAX ((size_t)1 << 30)
/** Messages that a queue keeps if nobody says otherwise, and at most. */
#define GIMI_QUEUE_MESSAGES_DEFAULT 64
#define GIMI_QUEUE_MESSAGES_MAX ((size_t)1 << 24)

/** Credentials of a node, for later versions: the only value is NULL. */
typedef struct gimi_credentials gimi_credentials;

typedef struct gimi_node_options {
  size_t struct_size;
  /** At most 255 bytes: up to 16 parts of A-Z a-z 0-9 . _ -, separated by `/`. NULL or "": a node
   * without a name, found by its id only. */
  const char* name;
  /** `tcp://host:port` or `unix:/path`, or several of one network with commas. NULL or "": those of
   * GIMNET_HUB, else the hub of this machine. */
  const char* hub;
  const char* description; /**< For people, at most 256 bytes. */
  /** `http://host:port` or `http://user:password@host:port`: the HTTP proxy to reach `hub` through.
   * NULL or "": the environment's GIMNET_PROXY, if it is set, for a hub that is named by tcp://. */
  const char* proxy;
  const gimi_credentials* credentials;
  int32_t timeout_ms;      /**< For joining; 0: 5,000. */
  uint8_t wait_for_hub;    /**< Not 0: dial again until timeout_ms if there is no hub yet. */
  uint8_t no_reconnect;    /**< Not 0: a break is the end. With resume 2 only if the hub cannot
                              resume the session. */
  uint8_t resume;          /**< 0: on for nodes with a name; 1: off; 2: on. On: a break loses
                              nothing. */
  uint8_t no_token_file;   /**< Not 0: the session token is kept in memory only. */
  uint8_t shard_plus_one;  /**< Shard of the hub wished for, plus 1. */
  uint8_t administrator;   /**< Not 0: join as one who may change the hub. */
  uint8_t number_if_taken; /**< Not 0: if the name is taken, join as NAME-2, NAME-3 ... NAME-99. */
  uint8_t reserved[1];
  uint32_t socket_receive_bytes; /**< SO_RCVBUF; 0: the system's. */
  uint32_t last_message_bytes;   /**< Of the largest last message of an own service with `retain`
                                    that is kept for a hub that was started again; 0: 16 MiB. */
  size_t message_bytes_max;      /**< Largest message taken; 0: 64 MiB, at most 1 GiB. */
  size_t receive_bytes;          /**< May wait unread; 0: 16 MiB. */
  size_t queue_messages;         /**< Size of queues that nobody asked for; 0: 64. */
} gimi_node_options;

typedef struct gimi_queue_options {
  size_t struct_size;
  size_t messages; /**< 1..GIMI_QUEUE_MESSAGES_MAX; 0: 64. */
  gimi_at_full_queue at_full;
  int32_t reserved;
} gimi_queue_options;

/** The wishes of a subscriber. Every wish works with every delivery (docs/gimi.md). */
typedef struct gimi_subscribe_options {
  size_t struct_size;
  double rate_hz; /**< Messages a second at most, the newest at each due time, 0.001..1,000; 0: no
                     bound. */
  /** Messages that may wait, 1..GIMI_QUEUE_MESSAGES_MAX. 0: 64, and with GIMI_OVERWRITE_OLDEST more
   * as long as they take 16 MiB at most (docs/gimi.md, "Services"). But 0 is 1 message with
   * newest_only, with rate_hz and of a service with GIMI_LATEST. A newer message overwrites that
   * one, whatever at_full says. */
  size_t queue;
  gimi_at_full_queue at_full;
  int32_t timeout_ms;  /**< For the hub's answer; 0: 5,000. */
  uint8_t newest_only; /**< Not 0: only the newest message waits, in the queue and at the hub; queue
                          is 0 or 1. */
  uint8_t reserved[3];
  int32_t silence_ms; /**< Not 0: while nothing comes, receive functions answer GIMI_SILENCE once in
                         that time. */
  /** For experts: untaken messages, 1..1,024. 0: 2 with newest_only, else any number, and of
   * GIMI_SYNC as many as the service allows, which is the most. */
  uint32_t window;
  uint32_t depth; /**< For experts: newest messages that the hub holds at a full window; 0: 1, at
                     most 64. */
} gimi_subscribe_options;

typedef struct gimi_send_options {
  size_t struct_size;
  gimi_key key;
  gimi_lane lane;
  /** 1..GIMI_WINDOW_MAX: synchronized, at most that many are not acknowledged. 0: unsynchronized.
   */
  uint32_t window;
  gimi_at_full_window at_full;
  uint32_t age_ms_max;  /**< Not 0: dropped on the way when older, by the clocks of the hubs. */
  uint8_t timestamp;    /**< Not 0: tell the receiver when it was sent: 8 bytes more. */
  uint8_t end_at_loss;  /**< Not 0: of a synchronized stream, once a message was lost, nothing more
                           is sent. */
  uint8_t wait_if_away; /**< Not 0: gimi_send() waits, within its time, for a service that is away.
                           0: it answers GIMI_NOT_FOUND at once. Of this sender alone. */
  uint8_t reserved[5];
} gimi_send_options;

typedef struct gimi_publish_options {
  size_t struct_size;
  gimi_key key;
  gimi_lane lane;
  gimi_delivery delivery;
  uint32_t window;      /**< Of GIMI_SYNC: messages not taken by a subscriber, 1..1,024; 0: 1. */
  uint8_t retain;       /**< Not 0: the hub keeps the last message for each new subscriber. */
  uint8_t no_timestamp; /**< Not 0: do not tell subscribers when it was sent: 8 bytes less. */
  uint8_t reserved[2];
  const char* metadata; /**< For people and tools, at most 4,096 bytes of UTF-8. */
  int32_t timeout_ms;   /**< For the hub's answer; 0: 5,000. */
  uint32_t age_ms_max;  /**< Not 0: dropped on the way when older, by the clocks of the hubs. */
} gimi_publish_options;

typedef struct gimi_accept_options {
  size_t struct_size;
  gimi_key key;    /**< Of the messages that it takes. */
  size_t messages; /**< Of its queue, as in gimi_queue_options. */
  gimi_at_full_queue at_full;
  int32_t timeout_ms;   /**< For the hub's answer; 0: 5,000. */
  const char* metadata; /**< For people and tools, at most 4,096 bytes of UTF-8. */
  uint32_t lease_ms;    /**< Later versions give one sender the service for so long; 0. */
  int32_t reserved;
  gimi_bytes safe_message; /**< Later versions give it out when the lease ends; empty. */
} gimi_accept_options;

/** The subjects of a watch: bits; 0: both. */
enum { GIMI_WATCH_NODES = 1, GIMI_WATCH_SERVICES = 2 };

#ifdef __cplusplus
}
#endif

#endif /* GIMNET_GIMI_OPTIONS_H */
