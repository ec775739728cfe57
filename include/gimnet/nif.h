#ifndef GIMNET_NIF_H
#define GIMNET_NIF_H

/*
 * NIF: the network interface library of GIMnet, in C11. It turns a connection to a hub into a node:
 * a name, an id, messages out, messages and events in. GIMI (gimnet/gimi.hpp) is built on it;
 * programs should prefer GIMI.
 *
 *     nif_options options = {.struct_size = sizeof options, .name = "robot"};
 *     nif_node* node = NULL;
 *     if (nif_connect(&options, &node) != NIF_OK) { puts(nif_error_text()); return 1; }
 *     nif_send_to(node, peer, "hi", 2);
 *     nif_incoming in;
 *     while (nif_receive(node, &in, 1000) == NIF_OK) { show(&in); nif_release(&in); }
 *     nif_close(node);
 *
 * Threads. Every function may be called from any thread at any time, on one handle from many at
 * once, except where it says otherwise. Each handle owns one library thread that reads, answers
 * keep-alive, and dials again after a break.
 *
 * Handles. A handle that is NULL, was closed, or never came from nif_connect is answered with
 * NIF_CLOSED. A process has at most 4,096 open handles.
 *
 * fork. A child has none of its parent's library threads: every call on a handle of the parent is
 * answered with NIF_FORKED, and nif_close() there releases the descriptor without a word to the
 * hub. Connect anew in the child.
 *
 * Signals. No function may be called in a signal handler, nor nif_close(): the handler notes the
 * signal, and a thread of the program sees to it. The library never raises SIGPIPE and installs no
 * handler; interrupted waits go on until their time is up.
 *
 * Timeouts are in milliseconds: 0 does not wait, NIF_FOREVER waits without a limit.
 *
 * Text given to the library is NUL-terminated and is copied.
 *
 * Versions. Structures whose first member is struct_size are versioned by it: set it to sizeof and
 * leave what you do not need zero; zero always means the default. A program goes on with a library
 * that has more members: those it does not give are zero, and it gets those that it has. One with a
 * library that has fewer is refused only if it sets one of the others. Structures without it, of
 * which programs keep arrays or which the library makes (nif_bytes, nif_incoming, nif_subscription,
 * nif_watched, nif_reply, lists and their records), keep their members while NIF_VERSION_MAJOR is
 * the same: what comes later gets a function or a structure of its own.
 *
 * docs/protocol.md describes the bytes on the wire, docs/nif.md how this library uses them, and
 * why.
 */

#include <stddef.h>
#include <stdint.h>

#include "gimnet/nif_counters.h"
#include "gimnet/nif_names.h"
#include "gimnet/nif_status.h"
#include "gimnet/nif_watch.h"

#ifdef __cplusplus
extern "C" {
#endif

#define NIF_VERSION_MAJOR 0
#define NIF_VERSION_MINOR 1

/** Waits without a limit. */
#define NIF_FOREVER ((int32_t)-1)
/** Address of a BROADCAST to every node of the network. */
#define NIF_EVERY_NODE UINT32_C(0xFFFFFFFF)
/** Largest message that can be sent or, where nif_options.message_bytes_max allows it, received: 1
 * GiB, and 64 KiB for the headers of what stands on this library. */
#define NIF_MESSAGE_BYTES_MAX (((size_t)1 << 30) + 65536)
/** Most recipients of one LIST message. */
#define NIF_LIST_RECIPIENTS_MAX 1024
/** Most parts of one gathered payload. */
#define NIF_PARTS_MAX 64
/** Longest name in bytes, without the terminating NUL. */
#define NIF_NAME_BYTES_MAX 255
/** Most requests of one handle that may wait for their answers. Further callers wait for their
 * turn. */
#define NIF_REQUESTS_MAX 64
/** A count that nobody knows. */
#define NIF_COUNT_UNKNOWN UINT64_MAX

/* ---------------------------------------------------------------- connecting */

/** Resume: after a break the hub and this library send again what the other did not confirm, so
 * that nothing is lost and nothing arrives twice. Costs a copy of what is unconfirmed, at both
 * ends. */
typedef enum nif_resume {
  NIF_RESUME_DEFAULT = 0, /**< On for nodes with a name, off for nodes without one. */
  NIF_RESUME_OFF = 1,
  NIF_RESUME_ON = 2
} nif_resume;

struct nif_incoming;

/** The answer of a delivery callback: what it did with a message or event. */
typedef enum nif_verdict {
  NIF_DONE = 0,   /**< Seen to; the library releases it. */
  NIF_KEEP = 1,   /**< Kept; the program calls nif_release() on its copy of the nif_incoming later,
                     from any thread. */
  NIF_NOT_NOW = 2 /**< No room: it and all that follows wait in the receive queue until
                     nif_deliver() is called. */
} nif_verdict;

/** Called on the library's thread for everything received, in order, one at a time, with no lock
 * held. It may send (a send that would have to wait answers NIF_TIMEOUT) and must not block for
 * long: while it runs, nothing else is read. Requests and nif_close() answer NIF_IN_CALLBACK there.
 */
typedef nif_verdict (*nif_callback)(void* user, const struct nif_incoming* in);

/** The options of connecting. Zero members mean the default. */
typedef struct nif_options {
  size_t struct_size; /**< sizeof(nif_options). */
  /** `tcp://host:port` or `unix:/path`, or several of one network with commas. NULL or "": those of
   * GIMNET_HUB; where that is not set, the hub's default Unix socket (gimnet/tcphub.sock in
   * XDG_RUNTIME_DIR, else in the folder gimnet-UID in the temporary folder, which must belong to
   * this user), then tcp://127.0.0.1:7450. */
  const char* url;
  const char* name; /**< Name to register, NULL or "": a node without a name, found by id only. */
  const char* description; /**< For people, at most 256 bytes. */
  /** The longest time of nif_connect(), finding the host's address included. 0: 5,000;
   * NIF_FOREVER, or any negative time: as long as it takes. */
  int32_t connect_timeout_ms;
  /** Not 0: nif_connect() dials again until connect_timeout_ms is over if there is no hub yet. */
  uint8_t wait_for_hub;
  /** Not 0: do not dial again after a break; calls then answer NIF_NOT_CONNECTED. With
   * NIF_RESUME_ON the library dials as long as the session can be resumed: until its grace time is
   * over, nothing listens at the address any more, or a hub says that it does not know it. */
  uint8_t no_reconnect;
  uint8_t resume; /**< nif_resume. */
  /** Shard of the hub wished for, plus 1; 0: none. Honoured by a hub started with `--placement
   * hint`. */
  uint8_t shard_plus_one;
  /** Bytes of messages that may wait to be written (in addition to what the kernel holds), default
   * 256 KiB. */
  uint32_t send_queue_bytes;
  /** Bytes of written but unconfirmed frames kept for resume, default 512 KiB: as much as a hub's
   * reserve takes from two senders after it said PAUSE, so that it need not stop reading this node.
   */
  uint32_t resume_bytes;
  /** Bytes of received messages that may wait for the program, default 16 MiB. When it is full the
   * library stops reading from the hub and overwrites nothing; keep-alive goes on. One message
   * always fits, whatever its size. */
  size_t receive_queue_bytes;
  /** Largest message taken, default 64 MiB, at most NIF_MESSAGE_BYTES_MAX. Larger ones are refused,
   * or lost as a gap.
   */
  size_t message_bytes_max;
  /** Bytes of unfinished messages together, default the larger of 64 MiB and message_bytes_max. */
  size_t reassembly_bytes;
  /** SO_RCVBUF and SO_SNDBUF of the socket; default: the system's, and 256 KiB. */
  uint32_t socket_receive_bytes;
  uint32_t socket_send_bytes;
  /** If set, everything received is given to it instead of waiting for nif_receive(). */
  nif_callback callback;
  void* user; /**< Given to the callback unchanged. */
  /** Not 0: keep the session token in memory only. Otherwise the token of a node with a name stands
   * in a file of the user's runtime folder while the node lives, so that the program has its id and
   * name again at once when it crashed and is started anew (docs/nif.md, "Tokens"). Without
   * the file the node is connected all the same. */
  uint8_t no_token_file;
  /** A message of a service with delivery sync(n) counts as taken when nif_receive() gave it out or
   * the callback took it. Not 0: only nif_credit() says so, but for what the callback answered
   * NIF_DONE to. */
  uint8_t credit_by_program;
  /** Not 0: join as an administrator, who may change the hub: over its Unix socket, as root or as
   * the user that runs it. Anybody else is refused, NIF_DENIED. */
  uint8_t administrator;
  /** Bytes of the largest last message of an own service with `retain` that the library keeps to
   * give it to a hub that lost it, without a GIMI header. Default 16 MiB: as much as a hub keeps
   * itself. A hub that was told to keep more (`retained_message_bytes`) loses larger ones when it
   * is started again, unless this is as large. At most 64 MiB, which all services of the handle
   * have together. Messages not kept are counted (nif_counters.last_messages_not_kept). */
  uint32_t last_message_bytes;
  /** `http://host:port` or `http://user:password@host:port`: the HTTP proxy to dial the hub of
   * `url` (or GIMNET_HUB) through, by CONNECT; %XX stands for a special character of user or
   * password. NULL: the environment's GIMNET_PROXY, if it is set, for a hub that `url` or
   * GIMNET_HUB names by `tcp://`; "": none. */
  const char* proxy;
} nif_options;

/** Connects to a hub, registers the name, and stores the new handle in *node.
 *  Returns when the hub admitted the node, or failed: NIF_BAD_ARGUMENT (URL, options), NIF_NO_HUB,
 * NIF_NO_HOST, NIF_TIMEOUT, NIF_BAD_VERSION, NIF_DENIED (administrator), NIF_NAME_TAKEN,
 * NIF_BAD_NAME, NIF_HUB_FULL, NIF_REFUSED, NIF_PROTOCOL, NIF_NO_MEMORY, NIF_LIMIT (too many
 * handles), NIF_SYSTEM. On failure *node is NULL. options may be NULL: all defaults.
 */
GIMNET_API nif_status nif_connect(const nif_options* options, nif_node** node);

/** Leaves for good: writes what still waits (for at most one second), says GOODBYE, so that name
 * and id are free at once, and frees the handle. Calls of other threads that wait on it return
 * NIF_CLOSED first. Messages received and not released stay valid. NIF_CLOSED: no such handle.
 * NIF_IN_CALLBACK: called from this handle's callback. */
GIMNET_API nif_status nif_close(nif_node* node);

/** State of a handle at one moment. */
typedef struct nif_info {
  size_t struct_size; /**< sizeof(nif_info), set by the caller. */
  uint32_t
      id; /**< Node id, hub << 20 | index. Changes only if a session could not be taken up again. */
  uint32_t hub_id;
  uint8_t connected;        /**< 0 while the connection is broken. */
  uint8_t resume;           /**< 1: both ends keep what is unconfirmed. */
  uint8_t replaced;         /**< 1: see NIF_REPLACED. */
  uint8_t keep_alive_seen;  /**< 1: round_trip_ns and clock_offset_ns hold a measurement. */
  uint32_t reconnects;      /**< Times that the connection was made again. */
  int64_t round_trip_ns;    /**< To the hub and back, by the last keep-alive. */
  int64_t clock_offset_ns;  /**< Hub's clock minus this one, by the best of the last keep-alives. */
  uint32_t frame_bytes_max; /**< Largest frame length in use. */
  char name[NIF_NAME_BYTES_MAX + 1]; /**< As registered. */
  char hub_name[NIF_NAME_BYTES_MAX + 1];
  uint8_t token_kept; /**< 1: the session token is in a file, see nif_options.no_token_file. */
  uint8_t ended;      /**< 1: no connection will come any more; nif_last_error() says why. Close the
                         handle. */
} nif_info;

/** Fills *info, as much of it as struct_size says. Does not wait. NIF_BAD_ARGUMENT: NULL, or
 * struct_size is not set. */
GIMNET_API nif_status nif_get_info(nif_node* node, nif_info* info);

/** The node id, or 0 if there is no such handle. */
GIMNET_API uint32_t nif_id(nif_node* node);

/** Copies the sentence of the last trouble of the connection itself (why it broke, what the hub's
 * GOODBYE said), empty if there was none, into buffer, cut between characters to at most size - 1
 * bytes. Returns the length that it has uncut; 0 also if there is no such handle. buffer may be
 * NULL if size is 0. */
GIMNET_API size_t nif_last_error(nif_node* node, char* buffer, size_t size);

/* ---------------------------------------------------------------- sending */

/** Kinds of messages; the numbers are those of the wire. */
typedef enum nif_kind {
  NIF_UNICAST = 0, /**< To one node. */
  NIF_GROUP = 1,   /**< From the provider of a service to all its subscribers. */
  NIF_LIST = 2,    /**< To up to 1,024 nodes. */
  NIF_BROADCAST =
      3, /**< To every node of a hub (hub << 20 | 0xFFFFF) or of the network (NIF_EVERY_NODE). */
  NIF_SERVICE = 4 /**< To the provider of a service. */
} nif_kind;

/** Lanes: a lower one goes first at every queue. There is no order between lanes. */
typedef enum nif_lane {
  NIF_REAL_TIME = 0,
  NIF_NORMAL = 1,
  NIF_BULK = 2,
  NIF_BACKGROUND = 3
} nif_lane;

/** The fate of the message at a full queue (docs/protocol.md, section 5). */
typedef enum nif_policy {
  NIF_POLICY_DEFAULT =
      0,         /**< BLOCK for UNICAST and SERVICE; else the oldest waiting message goes. */
  NIF_BLOCK = 1, /**< Nothing is dropped, the sender waits. UNICAST and SERVICE only. */
  NIF_DROP = 2,  /**< The new message goes. */
  NIF_LATEST =
      3 /**< Replaces an older one of the same stream. On UNICAST and SERVICE only with a key. */
} nif_policy;

/** Bits of nif_outgoing.flags. */
enum {
  NIF_FLAG_REPORT = 0x01, /**< Deliver a NIF_REPORT if the message does not arrive. */
  NIF_FLAG_KEYED = 0x02,  /**< nif_outgoing.key is part of the message. */
  /** More messages follow at once: do not write yet. They are written with the next message
   * without this flag, at 64 KiB, by nif_flush(), and at the latest with the next keep-alive. */
  NIF_FLAG_MORE = 0x04,
  /** Drop it while there is no connection to the hub, also with resume: NIF_NOT_CONNECTED at once.
   */
  NIF_FLAG_NOT_WHILE_AWAY = 0x08
};

/** A piece of memory. */
typedef struct nif_bytes {
  const void* data; /**< May be NULL if size is 0. */
  size_t size;
} nif_bytes;

/** A message to send. Begin with NIF_OUTGOING_INIT: normal lane, default policy, empty, to nobody.
 */
typedef struct nif_outgoing {
  size_t struct_size;         /**< sizeof(nif_outgoing). */
  uint8_t kind;               /**< nif_kind. */
  uint8_t lane;               /**< nif_lane. */
  uint8_t policy;             /**< nif_policy. */
  uint8_t flags;              /**< NIF_FLAG_*. */
  uint32_t to;                /**< Node id, group id or broadcast address; ignored for LIST. */
  const uint32_t* recipients; /**< LIST: node ids in any order; repeated ones count once. */
  size_t recipient_count;     /**< LIST: 1..NIF_LIST_RECIPIENTS_MAX. */
  uint64_t key;               /**< With NIF_FLAG_KEYED: 8 bytes, little-endian on the wire. */
  const nif_bytes* parts;     /**< The payload, gathered from part_count pieces. */
  size_t part_count;          /**< 0..NIF_PARTS_MAX. */
  uint32_t age_ms_max;        /**< Not 0: dropped `too_old` on the way when older, by the clocks of
                                 the hubs (EXT AGE). */
  uint8_t trace_slots; /**< Up to 8 hubs on the way write arrival and departure into the message
                          (EXT TRACE). */
} nif_outgoing;

#define NIF_OUTGOING_INIT \
  {sizeof(nif_outgoing),  \
   NIF_UNICAST,           \
   NIF_NORMAL,            \
   NIF_POLICY_DEFAULT,    \
   0,                     \
   0,                     \
   NULL,                  \
   0,                     \
   0,                     \
   NULL,                  \
   0,                     \
   0,                     \
   0}

/** Sends a message; the payload is copied or written before the call returns. NIF_OK means that it
 * is on its way: taken by the kernel or waiting in the send queue, which is written without further
 * calls. Messages of one kind, destination and lane keep the order of the calls. A small message on
 * an idle connection costs one system call, in this thread.
 *
 *  Waits, for at most timeout_ms, while the hub has paused this (kind, destination, lane), while
 * the send queue or the resume buffer is full, while the receiver of a fragmented message (over 8
 * KiB, UNICAST) opens no window, and, where a session can be taken up again, while the connection
 * is broken. Waiting holds up no other destination.
 *
 *  The message is taken whole or not at all. If the time is over when it has begun, the library
 * keeps a copy of the rest and goes on to send it: of one such message of any size, or of several
 * that have at most send_queue_bytes together. A further one of over 8 KiB waits for them, unless
 * its time is NIF_FOREVER. Only reports (NIF_FLAG_REPORT) and nif_drain() tell the fate of
 * the rest.
 *
 *  NIF_TIMEOUT: nothing was sent. NIF_NOT_CONNECTED: broken, and not dialing again or no resume.
 * NIF_REPLACED. NIF_TOO_LARGE: over 1 GiB, or refused by the receiver. NIF_NOT_DELIVERED: a
 * fragmented message that the hub reported undeliverable. NIF_NOT_RETAINED: sent, but larger than
 * what the hub keeps of a service with retain. NIF_REFUSED: to the group of a service that the hub
 * did not take again. NIF_BAD_ARGUMENT, NIF_NO_MEMORY. */
GIMNET_API nif_status nif_send(nif_node* node, const nif_outgoing* message, int32_t timeout_ms);

/** nif_send() of one piece to one node in the normal lane, with the default policy, without a time
 * limit. */
GIMNET_API nif_status nif_send_to(nif_node* node, uint32_t to, const void* data, size_t size);

/** Writes what NIF_FLAG_MORE held back. Does not wait: what the kernel does not take now goes
 * without further calls. NIF_NOT_CONNECTED, NIF_REPLACED, NIF_REFUSED: no connection will come any
 * more. */
GIMNET_API nif_status nif_flush(nif_node* node);

/** Waits until everything sent so far was given to the kernel and, where resume is on, confirmed by
 * the hub. NIF_NOT_CONNECTED: broken without resume; or, once after each such loss, frames sent
 * since the last nif_drain() were given up unconfirmed, because the hub that came back does not
 * know this connection, or had left the resume buffer: some may not have arrived. NIF_TIMEOUT,
 * NIF_CLOSED, NIF_REPLACED. */
GIMNET_API nif_status nif_drain(nif_node* node, int32_t timeout_ms);

/* ---------------------------------------------------------------- receiving */

/** The messages and events of nif_receive() and the callback. In brackets: the members that are
 * set beside `type`. */
typedef enum nif_incoming_type {
  /** A message [from, to, kind, lane, flags, key, payload, extensions]. */
  NIF_MESSAGE = 0,
  /** The hub could not deliver messages of this node [from: the hub, reason, count, text: name of
   * the reason, payload: one such frame's 16-byte header and up to 16 bytes after it; to,
   * kind, lane and flags are those of that frame, so is key where it is KEYED]. Of a message over 4
   * KiB those bytes are as if it had come in one frame without a fragment header, as long as it is
   * among the last 1,024 such messages that asked for reports or have over 1 MiB. Hubs merge
   * reports: a program that ever asked for one gets those of messages over 1 MiB that did not, too.
   * One with NIF_DROP_NOT_RETAINED comes without being asked for, and nothing was lost. If the
   * last frame was the library's own, which asked whether a receiver is still there,
   * `kind` is 7 (TAKEN), and of the `count` messages before it only the reason is known. */
  NIF_REPORT = 1,
  /** Messages were lost [from: the sender; 0: any to this node; reason, text: its name; count: so
   * many messages]. `cut_message`: a part did not come, or the connection broke before it.
   * `too_large`: one message [also to, kind, lane, flags and key; payload: its first bytes, at most
   * 64]. With `link_lost` the count is of frames, of which a large message has many, or
   * NIF_COUNT_UNKNOWN: they had left a resume buffer unconfirmed when the connection broke, that of
   * the hub or, from the own id, of this node. `no_such_group`, from the own id: so many frames to
   * own services had waited over a break, and the hub did not take their services again.
   * `queue_full` and `over_budget`: the hub dropped so many frames for this node, since its queue
   * there was full, or the hub's memory was short [from: the node that had sent most of the bytes
   * in the queue, whoever lost frames; 0: not known]. They come before the messages behind the
   * gap. */
  NIF_GAP = 2,
  /** Connected again after a break [from: own node id; flags: NIF_CONNECTED_*]. The library
   * declares services and subscriptions again by itself. Not delivered for the first connection,
   * which nif_connect() made. */
  NIF_CONNECTED = 3,
  /** The connection broke [reason: GOODBYE code or 0, text; flags: NIF_DISCONNECTED_*]. Unless a
   * flag says otherwise the library dials again. */
  NIF_DISCONNECTED = 4,
  /** Another connection took the session over; nothing follows [text]. */
  NIF_SESSION_REPLACED = 5,
  /** The number of subscribers of a service of this node [group, count]: whenever some came or
   * went, and once when it was declared again after a break. */
  NIF_SUBSCRIBERS = 6,
  /** A service that this node subscribed changed: it appeared, has another provider or group
   * id, is away or there again, or went [flags: NIF_SERVICE_AWAY, text: full name, group (0: none;
   * with a reason, nif_status: the hub refused the subscription after a break, payload: its words),
   * from: its provider (0: nobody), count: the provider's session, message_type, instance,
   * delivery, direction]. Comes before the first message of another group, also after a break;
   * messages of former groups may still come. */
  NIF_SERVICE_MOVED = 8,
  /** An own service got another group id after a reconnect [text: service name, former_group, group
   * (0: the hub refused it; reason: nif_status; payload: its words)]. Send to the new id from now
   * on; what waited for the connection goes there, and what is still sent to the former id, unless
   * another own service has that. */
  NIF_OWN_SERVICE_MOVED = 9,
  /** Something that a watch of this node is about [watched; text and reason: why the hub ended it,
   * if NIF_WATCH_ENDED]. */
  NIF_WATCHED = 10,
  /** A node of another hub has the better claim to the own name; NIF_SESSION_REPLACED follows. Or
   * the text is the full name of an own service: that alone has ended [text: name, from: who has
   * it]. */
  NIF_NAME_LOST = 12
} nif_incoming_type;

/** Bits of nif_incoming.flags of a NIF_CONNECTED. */
enum {
  NIF_CONNECTED_RESUMED =
      0x01, /**< The counts went on: nothing was lost except what NIF_GAPs say. */
  NIF_CONNECTED_SAME_ID = 0x02 /**< The node has its former id. */
};
/** Bits of nif_incoming.flags of a NIF_SERVICE_MOVED. */
enum {
  /** The service takes data (NIF_ACCEPTS), and its node has lost its connection and not advertised
     it again yet: what is sent there may be dropped. */
  NIF_SERVICE_AWAY = 0x01
};
/** Bits of nif_incoming.flags of a NIF_DISCONNECTED. */
enum {
  /** The node was kicked, or no_reconnect is set: no connection will come any more, and nothing
     follows. */
  NIF_DISCONNECTED_FOR_GOOD = 0x01
};

/** Something received. Belongs to the caller until nif_release(). */
typedef struct nif_incoming {
  uint32_t type;       /**< nif_incoming_type; unknown ones of later versions are to be released and
                          skipped. */
  uint32_t from;       /**< Node id. */
  uint32_t to;         /**< Own id, group id, broadcast address; 0 for LIST. */
  uint8_t kind;        /**< nif_kind; of a NIF_REPORT also 7, see there. */
  uint8_t lane;        /**< nif_lane. */
  uint8_t flags;       /**< Of a NIF_MESSAGE: NIF_FLAG_REPORT, NIF_FLAG_KEYED; of others as
                          nif_incoming_type says. */
  uint8_t policy;      /**< nif_policy with which it was sent. */
  uint64_t key;        /**< With NIF_FLAG_KEYED. */
  const void* payload; /**< Aligned to 1. Valid until: nif_release(). */
  size_t size;
  const void* extensions; /**< EXT as on the wire, without its leading u16; NULL: none. */
  size_t extensions_size;
  int64_t arrival_ns; /**< When it was read from the socket, ns since 1970. */
  uint64_t count;     /**< Frames of a NIF_REPORT, messages or frames of a NIF_GAP, subscribers, the
                         session of a NIF_SERVICE_MOVED; NIF_COUNT_UNKNOWN. */
  /** nif_drop_reason of a NIF_REPORT and a NIF_GAP, the GOODBYE code (docs/protocol.md, section 3)
   * of a NIF_DISCONNECTED, nif_status of a NIF_SERVICE_MOVED, a NIF_OWN_SERVICE_MOVED and a
   * NIF_WATCHED; else 0. */
  uint32_t reason;
  uint32_t group;        /**< Group id; 0: none. */
  uint32_t former_group; /**< Of a NIF_OWN_SERVICE_MOVED; 0: none. */
  uint32_t message_type; /**< As its provider advertised it. */
  uint32_t instance;     /**< The same. */
  uint32_t delivery;     /**< nif_delivery. */
  uint32_t direction;    /**< nif_direction. */
  uint32_t epoch; /**< Of a GROUP message that counts in a window: for nif_credit(); else 0. */
  const nif_watched* watched; /**< Of a NIF_WATCHED, else NULL. Valid until: nif_release(). */
  const char* text;           /**< NUL-terminated, never NULL. Valid until: nif_release(). */
  void* storage;              /**< The library's; do not touch. */
} nif_incoming;

/** Takes the next message or event. NIF_TIMEOUT: none within timeout_ms. Those received before the
 * connection broke still come, then NIF_NOT_CONNECTED (with no_reconnect) or NIF_REPLACED.
 * NIF_BAD_ARGUMENT if a callback was set. */
GIMNET_API nif_status nif_receive(nif_node* node, nif_incoming* in, int32_t timeout_ms);

/** Takes up to `capacity` at once: waits for the first only. Stores the number in *count. As
 * nif_receive(). */
GIMNET_API nif_status nif_receive_many(nif_node* node, nif_incoming* in, size_t capacity,
                                       size_t* count, int32_t timeout_ms);

/** Gives back what a receive function or a callback that answers NIF_KEEP got. Once for each. NULL
 * is ignored. */
GIMNET_API void nif_release(nif_incoming* in);

/** A descriptor that polls readable while something waits for nif_receive(). Do not read from it,
 * do not close it. -1 if there is no such handle or no descriptor. Valid until: nif_close(). */
GIMNET_API int nif_event_fd(nif_node* node);

/** After NIF_NOT_NOW: there is room again, the library's thread calls the callback again with what
 * waits. Does not wait; may be called in the callback. Nothing happens where nothing was held back.
 * No errors beside those of handles.
 */
GIMNET_API nif_status nif_deliver(nif_node* node);

#ifdef __cplusplus
}
#endif

#endif /* GIMNET_NIF_H */
