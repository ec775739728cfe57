#ifndef GIMNET_NIF_COUNTERS_H
#define GIMNET_NIF_COUNTERS_H

/* The counters of the library. Included by gimnet/nif.h. */

#include <stddef.h>
#include <stdint.h>

#include "gimnet/nif_names.h"

#ifdef __cplusplus
extern "C" {
#endif

/** The counters of one handle since nif_connect(). */
typedef struct nif_counters {
  size_t struct_size;         /**< sizeof(nif_counters), set by the caller. */
  uint64_t messages_sent;     /**< nif_send() calls that sent a message. */
  uint64_t messages_received; /**< NIF_MESSAGEs put into the receive queue. */
  uint64_t frames_sent;       /**< Data frames written for the first time. */
  uint64_t frames_resent;     /**< ... written again after a resume. */
  uint64_t frames_received;
  uint64_t bytes_sent; /**< All bytes given to the kernel. */
  uint64_t bytes_received;
  uint64_t write_calls; /**< System calls that wrote: how well bursts are gathered. */
  uint64_t read_calls;
  uint64_t frames_let_go;       /**< Left the resume buffer unconfirmed, to make room. */
  uint64_t frames_replaced;     /**< LATEST frames replaced in the own send queue. */
  uint64_t messages_lost;       /**< Fragmented messages that ended unfinished at this end. */
  uint64_t pauses;              /**< PAUSEs of the hub. */
  uint64_t gaps;                /**< NIF_GAPs delivered. */
  uint64_t frames_ignored;      /**< Well-formed frames that this version does not know. */
  uint64_t receive_queue_bytes; /**< Waiting for the program now. */
  uint64_t send_queue_bytes;    /**< Waiting to be written now. */
  uint64_t retained_bytes;      /**< Waiting to be confirmed now. */
  uint64_t
      read_stops; /**< Times that the library stopped reading because the receive queue was full. */
  /** Messages of own services with `retain` that the library did not keep for a hub that loses
   * them: over nif_options.last_message_bytes or, with those of the other services, over 64 MiB; or
   * no memory. */
  uint64_t last_messages_not_kept;
  /** Frames of other nodes that could not be read, and were dropped: a header, extension or TAKEN
   * that docs/protocol.md does not allow. REPORTs of other hubs count, too. */
  uint64_t frames_unreadable;
} nif_counters;

/** Fills *counters, as much of it as struct_size says. Does not wait. NIF_BAD_ARGUMENT: NULL, or
 * struct_size is not set. */
GIMNET_API nif_status nif_get_counters(nif_node* node, nif_counters* counters);

#ifdef __cplusplus
}
#endif

#endif /* GIMNET_NIF_COUNTERS_H */
