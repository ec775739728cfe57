#ifndef GIMNET_NIF_STATUS_H
#define GIMNET_NIF_STATUS_H

/* The answers of NIF's calls, and reasons for messages not to arrive. Included by gimnet/nif.h. */

#include "gimnet/export.h"

#ifdef __cplusplus
extern "C" {
#endif

/** Answers of all functions. The sentence that belongs to the last failed call is nif_error_text().
 */
typedef enum nif_status {
  NIF_OK = 0,      /**< Done. */
  NIF_TIMEOUT = 1, /**< The time given was not enough; nothing was done unless the function says so.
                      Try again. */
  NIF_CLOSED = 2,  /**< No such handle, or it was closed while the call waited. */
  NIF_BAD_ARGUMENT = 3, /**< A parameter is outside its range; the sentence says which. A mistake of
                           the program. */
  NIF_NO_HUB = 4, /**< Nothing answers at the address. Is the hub running? See also NIF_NO_HOST. */
  NIF_NOT_CONNECTED =
      5, /**< The connection is broken at the moment; the library dials again by itself. */
  NIF_BAD_VERSION = 6, /**< The hub speaks another major version of the protocol. */
  NIF_NAME_TAKEN =
      7, /**< Another live node holds the name; the sentence names it. Choose another name. */
  NIF_BAD_NAME = 8,  /**< The name breaks the rules of docs/protocol.md, section 8. */
  NIF_HUB_FULL = 9,  /**< The hub has no room or no memory for another node. Try later. */
  NIF_REFUSED = 10,  /**< The hub ended the connection for another reason (draining, kicked, ...):
                        the sentence. */
  NIF_REPLACED = 11, /**< Another connection took this session over. The handle does not dial again;
                        close it. */
  NIF_NOT_FOUND = 12, /**< No node or service of that name or id. */
  NIF_TAKEN = 13,     /**< The name is in use already. */
  NIF_DENIED = 14,    /**< This node may not do that. */
  NIF_LIMIT = 15, /**< A limit of the hub or of this library was reached; the sentence names it. */
  NIF_NOT_SUPPORTED = 16, /**< The hub does not know the operation. */
  NIF_BAD_REQUEST =
      17,             /**< The hub could not read the request, or a number in it is out of range. */
  NIF_TOO_LARGE = 18, /**< The message is larger than allowed, or than the recipient takes. */
  NIF_NOT_DELIVERED =
      19, /**< The hub reported, while the message was still being sent, that it cannot arrive. */
  NIF_PROTOCOL = 20,  /**< The peer sent bytes that docs/protocol.md forbids; is it a GIMnet hub? */
  NIF_NO_MEMORY = 21, /**< Out of memory or descriptors in this process. */
  NIF_IN_CALLBACK =
      22, /**< The call would wait for the library's own thread, which is inside the callback. */
  NIF_FORKED = 23,           /**< The handle belongs to the parent process. */
  NIF_BUFFER_TOO_SMALL = 24, /**< Reserved: no call answers it. */
  NIF_SYSTEM = 25,           /**< The operating system refused; the sentence says what. */
  NIF_NO_HOST = 26, /**< No address is known for the host in the hub's URL. Is its name right? */
  NIF_NOT_RETAINED = 27 /**< The message is on its way to the subscribers of an own service with
                           retain, but the hub does not keep it for later ones: it is too large. */
} nif_status;

/** A short English text for a status, for example "name taken". Never NULL; static. */
GIMNET_API const char* nif_status_text(nif_status status);

/** Longest sentence of nif_error_text() in bytes, without the terminating NUL. */
#define NIF_SENTENCE_BYTES_MAX 1024

/** A sentence about the last call of this thread that did not answer NIF_OK or NIF_TIMEOUT: what
 * happened, to what, what to do, in UTF-8. Never NULL. A longer one than NIF_SENTENCE_BYTES_MAX is
 * cut between two characters. Valid until: the next nif_* call of this thread. */
GIMNET_API const char* nif_error_text(void);

/** Why frames did not arrive: nif_incoming.reason of a NIF_REPORT and a NIF_GAP. The numbers are
 * those of the wire, and their meaning is in docs/protocol.md, section 5; later versions may have
 * more. */
typedef enum nif_drop_reason {
  NIF_DROP_NO_SUCH_NODE = 1,
  NIF_DROP_NO_ROUTE = 2,
  NIF_DROP_AWAY = 3,
  NIF_DROP_QUEUE_FULL = 4,
  NIF_DROP_REPLACED = 5,
  NIF_DROP_TOO_OLD = 6,
  NIF_DROP_HOP_LIMIT = 7,
  NIF_DROP_TOO_LARGE = 8,
  NIF_DROP_NOT_ALLOWED = 9,
  NIF_DROP_WRONG_WAY = 10,
  NIF_DROP_LINK_LOST = 11,
  NIF_DROP_SHARD_FULL = 12,
  NIF_DROP_NO_SUCH_GROUP = 13,
  NIF_DROP_RENUMBERED = 14,
  NIF_DROP_OVER_BUDGET = 15,
  NIF_DROP_TIMED_OUT = 16,
  NIF_DROP_CUT_MESSAGE = 17,
  NIF_DROP_NO_SUBSCRIBER = 18,
  NIF_DROP_MALFORMED = 19,
  NIF_DROP_WRONG_SOURCE = 20,
  /** Of a NIF_REPORT only: the message reached the subscribers of an own service with retain, but
   * its hub does not keep it for later ones. */
  NIF_DROP_NOT_RETAINED = 21,
  NIF_DROP_LINK_UNSURE = 22 /**< A connection on the way broke: it may have arrived. */
} nif_drop_reason;

#ifdef __cplusplus
}
#endif

#endif /* GIMNET_NIF_STATUS_H */
