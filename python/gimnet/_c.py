"""The part of gimnet/gimi.h that the package uses: constants, structs and functions, under their C names.
tests/python/layout_test.py compares all of it with what a C compiler says."""

from __future__ import annotations

import ctypes
import os
import pathlib
from ctypes import POINTER, c_char, c_char_p, c_double, c_int32, c_int64, c_size_t, c_uint8, c_uint32, c_uint64, c_void_p
from typing import Any, List

GIMI_OK = 0
GIMI_TIMEOUT = 1
GIMI_CLOSED = 2
GIMI_BAD_ARGUMENT = 3
GIMI_NO_HUB = 4
GIMI_NO_HOST = 5
GIMI_NOT_CONNECTED = 6
GIMI_BAD_VERSION = 7
GIMI_NAME_TAKEN = 8
GIMI_BAD_NAME = 9
GIMI_REFUSED = 10
GIMI_NOT_FOUND = 11
GIMI_TAKEN = 12
GIMI_DENIED = 13
GIMI_LIMIT = 14
GIMI_TOO_LARGE = 15
GIMI_NOT_DELIVERED = 16
GIMI_WINDOW_FULL = 17
GIMI_PROTOCOL = 18
GIMI_SYSTEM = 19
GIMI_FORKED = 20
GIMI_NOT_RETAINED = 21
GIMI_BUSY = 22
GIMI_FAILED = 23
GIMI_GONE = 24
GIMI_SILENCE = 25
GIMI_NOT_TRUSTED = 32
GIMI_NO_RIGHT = 33
GIMI_EXPIRED = 34

GIMI_RAN_NO = 0
GIMI_RAN_MAYBE = 1
GIMI_RAN_YES = 2
GIMI_LANE_REAL_TIME = 1
GIMI_LANE_NORMAL = 2
GIMI_LANE_BULK = 3
GIMI_LANE_BACKGROUND = 4

GIMI_STREAM = 0
GIMI_LATEST = 1
GIMI_SYNC = 2
GIMI_PROVIDES = 0
GIMI_ACCEPTS = 1
GIMI_BEGINS_STREAM = 0x01
GIMI_PLAIN = 0x02
GIMI_STAMPED = 0x08
GIMI_AGED = 0x10
GIMI_CONNECTED = 0
GIMI_CONNECTION_LOST = 1
GIMI_RESUMED = 2
GIMI_CONNECTED_ANEW = 3
GIMI_CONNECTION_ENDED = 4
GIMI_WATCH_NODES = 1
GIMI_WATCH_SERVICES = 2
GIMI_NAME_BYTES_MAX = 255
GIMI_SENTENCE_BYTES_MAX = 1024
GIMI_BATCH_MESSAGES_MAX = 64
GIMI_PACKED_BYTES_MAX = 4096


class gimi_key(ctypes.Structure):
    _fields_ = [("type", c_uint32), ("instance", c_uint32)]


class gimi_bytes(ctypes.Structure):
    _fields_ = [("data", c_void_p), ("size", c_size_t)]


class gimi_node_options(ctypes.Structure):
    _fields_ = [("struct_size", c_size_t), ("name", c_char_p), ("hub", c_char_p), ("description", c_char_p),
                ("proxy", c_char_p), ("credentials", c_void_p), ("timeout_ms", c_int32), ("wait_for_hub", c_uint8),
                ("no_reconnect", c_uint8), ("resume", c_uint8), ("no_token_file", c_uint8), ("shard_plus_one", c_uint8),
                ("administrator", c_uint8), ("number_if_taken", c_uint8), ("reserved", c_uint8 * 1),
                ("socket_receive_bytes", c_uint32), ("last_message_bytes", c_uint32), ("message_bytes_max", c_size_t),
                ("receive_bytes", c_size_t), ("queue_messages", c_size_t)]


class gimi_subscribe_options(ctypes.Structure):
    _fields_ = [("struct_size", c_size_t), ("rate_hz", c_double), ("queue", c_size_t), ("at_full", c_int32),
                ("timeout_ms", c_int32), ("newest_only", c_uint8), ("reserved", c_uint8 * 3), ("silence_ms", c_int32),
                ("window", c_uint32), ("depth", c_uint32)]


class gimi_send_options(ctypes.Structure):
    _fields_ = [("struct_size", c_size_t), ("key", gimi_key), ("lane", c_int32), ("window", c_uint32),
                ("at_full", c_int32), ("age_ms_max", c_uint32), ("timestamp", c_uint8), ("end_at_loss", c_uint8),
                ("wait_if_away", c_uint8), ("reserved", c_uint8 * 5)]


class gimi_publish_options(ctypes.Structure):
    _fields_ = [("struct_size", c_size_t), ("key", gimi_key), ("lane", c_int32), ("delivery", c_int32),
                ("window", c_uint32), ("retain", c_uint8), ("no_timestamp", c_uint8), ("reserved", c_uint8 * 2),
                ("metadata", c_char_p), ("timeout_ms", c_int32), ("age_ms_max", c_uint32)]


class gimi_accept_options(ctypes.Structure):
    _fields_ = [("struct_size", c_size_t), ("key", gimi_key), ("messages", c_size_t), ("at_full", c_int32),
                ("timeout_ms", c_int32), ("metadata", c_char_p), ("lease_ms", c_uint32), ("reserved", c_int32),
                ("safe_message", gimi_bytes)]


class gimi_message(ctypes.Structure):
    _fields_ = [("data", c_void_p), ("size", c_size_t), ("service", c_char_p), ("identity", c_void_p),
                ("sent_ns", c_int64), ("arrival_ns", c_int64), ("key", gimi_key), ("from", c_uint32),
                ("sequence", c_uint32), ("reconnects", c_uint32), ("lane", c_int32), ("flags", c_uint32),
                ("content", c_uint32), ("counted", c_uint32 * 2), ("storage", c_void_p), ("name_storage", c_void_p),
                ("born_ns", c_int64), ("born_error_ns", c_int64), ("reserved", c_uint64 * 1)]


class gimi_batch(ctypes.Structure):
    _fields_ = [("count", c_uint32), ("message_size", c_uint32), ("messages", c_void_p), ("bytes", c_void_p),
                ("bytes_size", c_size_t), ("storage", c_void_p)]


class gimi_list(ctypes.Structure):
    _fields_ = [("count", c_size_t), ("record_size", c_size_t), ("records", c_void_p), ("storage", c_void_p)]


class gimi_node_record(ctypes.Structure):
    _fields_ = [("id", c_uint32), ("hub_id", c_uint32), ("name", c_char_p), ("hub_name", c_char_p),
                ("description", c_char_p), ("place", c_char_p), ("joined_ms", c_uint64), ("services", c_uint32),
                ("connected", c_uint8), ("reserved", c_uint8 * 3)]


class gimi_service_record(ctypes.Structure):
    _fields_ = [("name", c_char_p), ("hub_name", c_char_p), ("metadata", c_char_p), ("node", c_uint32),
                ("group_id", c_uint32), ("key", gimi_key), ("direction", c_int32), ("delivery", c_int32),
                ("subscribers", c_uint32), ("window", c_uint32), ("missed", c_uint64), ("missed_most", c_uint32),
                ("retain", c_uint8), ("reserved", c_uint8 * 3)]


class gimi_watch_event(ctypes.Structure):
    _fields_ = [("change", c_int32), ("hub_id", c_uint32), ("epoch", c_uint64), ("version", c_uint64),
                ("node", POINTER(gimi_node_record)), ("service", POINTER(gimi_service_record)),
                ("former_name", c_char_p), ("why", c_char_p), ("storage", c_void_p), ("reserved", c_uint64 * 2)]


class gimi_node_state(ctypes.Structure):
    _fields_ = [("struct_size", c_size_t), ("id", c_uint32), ("hub_id", c_uint32), ("reconnects", c_uint32),
                ("connected", c_uint8), ("ended", c_uint8), ("reserved", c_uint8 * 2),
                ("hub_round_trip_ns", c_int64), ("hub_clock_offset_ns", c_int64),
                ("last_messages_not_kept", c_uint64), ("name", c_char * (GIMI_NAME_BYTES_MAX + 1)),
                ("hub_name", c_char * (GIMI_NAME_BYTES_MAX + 1)), ("trouble", c_char * (GIMI_SENTENCE_BYTES_MAX + 1))]


class gimi_connection_event(ctypes.Structure):
    _fields_ = [("struct_size", c_size_t), ("change", c_int32), ("skipped", c_uint32), ("when_ns", c_int64),
                ("why", c_char * (GIMI_SENTENCE_BYTES_MAX + 1))]


class gimi_queue_counts(ctypes.Structure):
    _fields_ = [("struct_size", c_size_t), ("waiting", c_uint64), ("received", c_uint64), ("overwritten", c_uint64),
                ("missed", c_uint64)]


class gimi_request_options(ctypes.Structure):
    _fields_ = [("struct_size", c_size_t), ("timeout_ms", c_int32), ("lane", c_int32), ("repeat", c_uint8),
                ("reserved", c_uint8 * 7)]


class gimi_reply(ctypes.Structure):
    _fields_ = [("data", c_void_p), ("size", c_size_t), ("from", c_uint32), ("ran", c_int32), ("code", c_int32),
                ("ended", c_uint32), ("storage", c_void_p), ("reserved", c_uint64 * 3)]


class gimi_answer_options(ctypes.Structure):
    _fields_ = [("struct_size", c_size_t), ("metadata", c_char_p), ("timeout_ms", c_int32), ("reserved", c_uint32)]


class gimi_request(ctypes.Structure):
    _fields_ = [("data", c_void_p), ("size", c_size_t), ("left_ms", c_int64), ("arrival_ns", c_int64), ("from", c_uint32),
                ("content", c_uint32), ("storage", c_void_p), ("reserved", c_uint64 * 3)]


class gimi_ready(ctypes.Structure):
    _fields_ = [("member", c_uint64), ("user", c_uint64), ("reserved", c_uint64)]


_HANDLE, _HANDLE_OUT = c_uint64, POINTER(c_uint64)
# Those that answer a status, by their parameters.
_STATUS_FUNCTIONS = {
    "gimi_message_age": [POINTER(gimi_message), POINTER(c_int64), POINTER(c_int64)],
    "gimi_join": [POINTER(gimi_node_options), _HANDLE_OUT],
    "gimi_close": [_HANDLE],
    "gimi_state": [_HANDLE, POINTER(gimi_node_state)],
    "gimi_watch_connection": [_HANDLE, _HANDLE_OUT],
    "gimi_connection_receive": [_HANDLE, c_int32, POINTER(gimi_connection_event)],
    "gimi_advertise": [_HANDLE, c_char_p, POINTER(gimi_publish_options), _HANDLE_OUT],
    "gimi_publish": [_HANDLE, c_void_p, c_size_t, c_int32, c_int32],
    "gimi_wait_for_subscribers": [_HANDLE, c_size_t, c_int32],
    "gimi_subscribers_changed": [_HANDLE, c_int32, POINTER(c_size_t)],
    "gimi_service_name": [_HANDLE, c_char_p, c_size_t],
    "gimi_subscribe": [_HANDLE, c_char_p, POINTER(gimi_subscribe_options), _HANDLE_OUT],
    "gimi_accept": [_HANDLE, c_char_p, POINTER(gimi_accept_options), _HANDLE_OUT],
    "gimi_sender_to_service": [_HANDLE, c_char_p, POINTER(gimi_send_options), c_int32, _HANDLE_OUT],
    "gimi_sender": [_HANDLE, c_uint32, POINTER(gimi_send_options), _HANDLE_OUT],
    "gimi_send": [_HANDLE, c_void_p, c_size_t, c_int32, c_int32],
    "gimi_try_send": [_HANDLE, c_void_p, c_size_t, c_int32, c_int32],
    "gimi_send_confirmed": [_HANDLE, c_void_p, c_size_t, c_int32],
    "gimi_receive": [_HANDLE, c_int32, POINTER(gimi_message)],
    "gimi_receive_packed": [_HANDLE, c_uint32, c_int32, POINTER(gimi_batch)],
    "gimi_counts": [_HANDLE, POINTER(gimi_queue_counts)],
    "gimi_find": [_HANDLE, c_char_p, c_int32, POINTER(c_uint32)],
    "gimi_nodes": [_HANDLE, c_char_p, c_int32, POINTER(gimi_list)],
    "gimi_services": [_HANDLE, c_char_p, c_int32, POINTER(gimi_list)],
    "gimi_list_get": [POINTER(gimi_list), c_size_t, c_void_p, c_size_t],
    "gimi_watch": [_HANDLE, c_char_p, c_uint32, c_int32, _HANDLE_OUT],
    "gimi_watch_receive": [_HANDLE, c_int32, POINTER(gimi_watch_event)],
    "gimi_ask_later": [_HANDLE, c_char_p, POINTER(gimi_bytes), POINTER(gimi_request_options), _HANDLE_OUT],
    "gimi_wait_for_reply": [_HANDLE, c_int32, POINTER(gimi_reply)],
    "gimi_answer": [_HANDLE, c_char_p, POINTER(gimi_answer_options), _HANDLE_OUT],
    "gimi_next_request": [_HANDLE, c_int32, POINTER(gimi_request)],
    "gimi_reply_to": [POINTER(gimi_request), c_void_p, c_size_t, c_int32],
    "gimi_fail_request": [POINTER(gimi_request), c_int32, c_char_p],
    "gimi_wait_set_create": [_HANDLE_OUT],
    "gimi_wait_set_add": [_HANDLE, _HANDLE, c_uint64],
    "gimi_wait_set_remove": [_HANDLE, _HANDLE],
    "gimi_wait_set_wait": [_HANDLE, POINTER(gimi_ready), c_uint32, c_size_t, c_int32, POINTER(c_size_t)],
    "gimi_wait_set_wake": [_HANDLE],
    "gimi_wait_set_descriptor": [_HANDLE, POINTER(c_int32)],
}
_OTHER_FUNCTIONS = {
    "gimi_id": (c_uint32, [_HANDLE]),
    "gimi_subscribers": (c_size_t, [_HANDLE]),
    "gimi_unsent": (c_uint64, [_HANDLE]),
    "gimi_message_release": (None, [POINTER(gimi_message)]),
    "gimi_batch_release": (None, [POINTER(gimi_batch)]),
    "gimi_list_release": (None, [POINTER(gimi_list)]),
    "gimi_reply_release": (None, [POINTER(gimi_reply)]),
    "gimi_request_release": (None, [POINTER(gimi_request)]),
    "gimi_watch_event_release": (None, [POINTER(gimi_watch_event)]),
    "gimi_change_text": (c_char_p, [c_int32]),
    "gimi_error_text": (c_char_p, []),
}
FUNCTIONS = (*_STATUS_FUNCTIONS, *_OTHER_FUNCTIONS)


def _places() -> List[str]:
    """Where the library may be: GIMNET_LIBRARY alone, or in a wheel, an installed prefix, a build of this
    tree, and where the system looks."""
    told = os.environ.get("GIMNET_LIBRARY")
    if told:
        return [told]
    here = pathlib.Path(__file__).resolve().parent
    near = [here / "libgimnet.so.1", here.parents[2] / "libgimnet.so.1"]
    near.append(here.parents[1] / "build" / "release" / "lib" / "libgimnet.so.1")
    return [*(str(path) for path in near if path.exists()), "libgimnet.so.1"]


def _load() -> Any:
    place = _places()[0]
    try:
        library = ctypes.CDLL(place)
    except OSError as error:
        raise ImportError(f"cannot load {place}: {error}; install libgimnet.so.1, or name it in GIMNET_LIBRARY") from None
    for name, parameters in _STATUS_FUNCTIONS.items():
        function = getattr(library, name)
        function.restype, function.argtypes = c_int32, parameters
    for name, (result, parameters) in _OTHER_FUNCTIONS.items():
        function = getattr(library, name)
        function.restype, function.argtypes = result, parameters
    return library


lib = _load()
