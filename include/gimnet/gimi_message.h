#ifndef GIMNET_GIMI_MESSAGE_H
#define GIMNET_GIMI_MESSAGE_H

/* Received messages, alone and in batches. Included by gimnet/gimi.h. */

#include "gimnet/gimi_types.h"

#ifdef __cplusplus
extern "C" {
#endif

/** Bits of gimi_message.flags. */
enum {
  /** The sender began the stream anew since the message before it: it is another process under the
   * same id. `sequence` counts anew, and nothing was missed. */
  GIMI_BEGINS_STREAM = 0x01,
  /** It was sent with NIF, without a GIMI header: sequence and key are 0. */
  GIMI_PLAIN = 0x02,
  /** Published with GIMI_LATEST: gaps in `sequence` are what was skipped for newer ones. */
  GIMI_OF_LATEST = 0x04,
  GIMI_STAMPED = 0x08, /**< `sent_ns` is set. */
  GIMI_AGED = 0x10     /**< gimi_message_age() knows its age. */
};

/** The content of a message. Numbers from 64 belong to applications. */
enum { GIMI_CONTENT_BYTES = 0, GIMI_CONTENT_BITESTREAM = 1, GIMI_CONTENT_UTF8 = 2 };

/** The sender of a message, as far as the hubs vouch for it. No message has one yet. */
typedef struct gimi_identity gimi_identity;

/** A message that was received. It owns its memory until gimi_message_release(), also after its
 * node was closed. Small messages share blocks of 256 KiB: a program that keeps few of many for
 * long copies those. A struct may be moved in memory. It has 128 bytes where pointers have 64 bits;
 * the reserved members are for later versions. */
typedef struct gimi_message {
  const void*
      data; /**< NULL if size is 0. More than 8 KiB are aligned to 64. Valid until: release. */
  size_t size;
  const char* service; /**< Full name of the service that published it, or of the own service to
                          which it was sent; "" for one that was sent to this node. NULL in an
                          empty struct. Valid until: release. */
  const gimi_identity* identity; /**< NULL: not known. */
  int64_t sent_ns;               /**< When it was sent, by the sender's clock, ns since 1970. */
  int64_t arrival_ns;            /**< When it was read here, by this machine's clock. */
  gimi_key key;
  gimi_peer from; /**< Its sender: the first hub vouches for it. */
  /** Counted by the sender for each (destination, key) from 1, and by a publisher for all its
   * subscribers; after 2^32 - 1 comes 0. */
  uint32_t sequence;
  uint32_t reconnects; /**< gimi_node_state.reconnects when it came. */
  gimi_lane lane;
  uint32_t flags;
  uint32_t content;      /**< GIMI_CONTENT_*. */
  uint32_t counted[2];   /**< The library's. */
  void* storage;         /**< The library's. */
  void* name_storage;    /**< The library's. */
  int64_t born_ns;       /**< The library's. */
  int64_t born_error_ns; /**< The library's. */
  uint64_t reserved[1];
} gimi_message;

/** Gives the memory back and empties the struct; does nothing with an empty one. NULL is ignored.
 */
GIMNET_API void gimi_message_release(gimi_message* message);

/** Stores how long ago a message was sent, in ns, by the clocks of the hubs, and the error that
 * this node's part has: half of its shortest round trip to its hub. Where the clock of the sender's
 * machine stands does not matter. The sender has a part like that, and each link. Either pointer
 * may be NULL. GIMI_NOT_FOUND: not known. It is known of messages with age_ms_max
 * (gimi_publish_options, gimi_send_options), once the hub has answered a PING. */
GIMNET_API gimi_status gimi_message_age(const gimi_message* message, int64_t* age_ns,
                                        int64_t* error_ns);

/** Memory of the library for a message that is to be published. The program fills it, and may make
 * size smaller. */
typedef struct gimi_loaned {
  void* data; /**< Aligned to 64. NULL in an empty struct. Valid until: it is published or released.
               */
  size_t size;
  void* storage; /**< The library's. */
  uint64_t reserved[3];
} gimi_loaned;

/** As gimi_message_release(), of a loan that is not published. */
GIMNET_API void gimi_loan_release(gimi_loaned* loan);

/** Most messages of one gimi_receive_packed(). */
#define GIMI_BATCH_MESSAGES_MAX 64
/** Data up to this size stand in gimi_batch.bytes. */
#define GIMI_PACKED_BYTES_MAX 4096

/** Messages that were received together, for languages in which a call is expensive. One release
 * for all; do not release its messages. `data` of each message up to GIMI_PACKED_BYTES_MAX points
 * into `bytes`, where the messages stand behind each other in their order, each at a multiple of 8;
 * larger ones have memory of their own. */
typedef struct gimi_batch {
  uint32_t count;
  uint32_t message_size; /**< From one message to the next in `messages`. */
  const gimi_message* messages;
  const void* bytes;
  size_t bytes_size;
  void* storage; /**< The library's. */
} gimi_batch;

/** As gimi_message_release(), of a batch. */
GIMNET_API void gimi_batch_release(gimi_batch* batch);

#ifdef __cplusplus
}
#endif

#endif /* GIMNET_GIMI_MESSAGE_H */
