"""Received messages, what may be sent, and records of nodes and services."""

from __future__ import annotations

import ctypes
import importlib
import time
import weakref
from dataclasses import dataclass
from typing import Any, Dict, List, Mapping, NamedTuple, Optional, Tuple

from . import _c, bitestream, errors

__all__ = ["Age", "Event", "Message", "NodeRecord", "Peer", "ServiceRecord"]


class Peer(int):
    """A node by its id: shown as `7.17`, node 17 of hub 7."""

    def __str__(self) -> str:
        return f"{self >> 20}.{self & 0xFFFFF}"

    def __repr__(self) -> str:
        return f"Peer({self})"


class Age(NamedTuple):
    """Seconds, by the clocks of the hubs. `error` is the part of this node: half of its shortest round trip."""

    seconds: float
    error: float


class Message:
    """A message that was received. Immutable, and safe in every thread.

    `data` is a memoryview. Small messages are copies; a larger one (above 4 KiB) is a view of the
    library's memory, which lives as long as any view of it. Times are in seconds since 1970.
    """

    __slots__ = ("_born", "arrival", "begins_stream", "data", "key", "lane", "plain", "sender", "sent", "sequence", "service")

    def __init__(self, raw: Any, data: memoryview) -> None:
        self.data = data
        self.service: str = raw.service.decode()
        """Full name of the service that published it, or of the own one to which it was sent; "": to this node."""
        self.sender = Peer(getattr(raw, "from"))
        self.sequence: int = raw.sequence
        self.key: Tuple[int, int] = (raw.key.type, raw.key.instance)
        self.sent: Optional[float] = raw.sent_ns / 1e9 if raw.flags & _c.GIMI_STAMPED else None
        self.arrival: float = raw.arrival_ns / 1e9
        self.lane = LANE_NAMES.get(raw.lane, f"unknown {raw.lane}")
        self.begins_stream = bool(raw.flags & _c.GIMI_BEGINS_STREAM)
        self.plain = bool(raw.flags & _c.GIMI_PLAIN)
        self._born = _born(raw) if raw.flags & _c.GIMI_AGED else None

    @property
    def age(self) -> Optional[Age]:
        """How long ago it was sent. None: not known; it is known of what is published with `age_max`."""
        return Age((time.monotonic_ns() - self._born[0]) / 1e9, self._born[1] / 1e9) if self._born else None

    @property
    def value(self) -> Dict[bitestream.Key, Any]:
        """The data as a dictionary. BitestreamError: it is no Bitestream."""
        return bitestream.decode(self.data)

    @property
    def text(self) -> str:
        """The data as UTF-8. UnicodeDecodeError."""
        return str(self.data, "utf-8")

    def array(self, dtype: Any, shape: Any = -1) -> Any:
        """A numpy array over the data, read-only and without a copy: message.array("f4", (480, 640)).
        ImportError: numpy is not installed. ValueError: the data do not have that size."""
        try:
            numpy = importlib.import_module("numpy")
        except ImportError:
            raise ImportError("message.array() needs numpy: install python3-numpy, or use message.data") from None
        return numpy.frombuffer(self.data, dtype).reshape(shape)

    def __repr__(self) -> str:
        return f"<Message {self.sequence} of {self.service or str(self.sender)}, {len(self.data)} bytes>"


def _born(raw: Any) -> Tuple[int, int]:
    """When it was sent, by the clock of time.monotonic_ns(), and the error of that."""
    age, error = ctypes.c_int64(), ctypes.c_int64()
    errors.check(_c.lib.gimi_message_age(raw, age, error))
    return time.monotonic_ns() - age.value, error.value


def _view(address: int, size: int) -> Tuple[Any, memoryview]:
    """A read-only view of the library's memory, and the object by which it lives."""
    block = (ctypes.c_ubyte * size).from_address(address)
    return block, memoryview(block).cast("B").toreadonly()


def _release_at_end(block: Any, release: Any, raw: Any) -> None:
    weakref.finalize(block, release, raw).atexit = False


def taken(raw: _c.gimi_message) -> Message:
    """The message of a gimi_receive(), which this releases when its last view ends."""
    if raw.size <= _c.GIMI_PACKED_BYTES_MAX:
        message = Message(raw, memoryview(ctypes.string_at(raw.data, raw.size) if raw.size else b""))
        _c.lib.gimi_message_release(raw)
        return message
    block, data = _view(raw.data, raw.size)
    _release_at_end(block, _c.lib.gimi_message_release, raw)
    return Message(raw, data)


class _Batch:
    """The memory of one gimi_receive_packed(); each large view of it holds it."""

    def __init__(self, raw: _c.gimi_batch) -> None:
        self._raw = raw

    def __del__(self) -> None:
        _c.lib.gimi_batch_release(self._raw)


def _keep(_: Any) -> None:
    """The batch is an argument of the view's finalizer, and ends with the last of them."""


def unpacked(raw: _c.gimi_batch) -> List[Message]:
    """The messages of a gimi_receive_packed(): small ones are slices of one bytes object."""
    batch = _Batch(raw)
    small = memoryview(ctypes.string_at(raw.bytes, raw.bytes_size) if raw.bytes_size else b"")
    messages = []
    for index in range(raw.count):
        one = _c.gimi_message.from_address(raw.messages + index * raw.message_size)
        if one.size <= _c.GIMI_PACKED_BYTES_MAX:
            offset = one.data - raw.bytes if one.size else 0
            data = small[offset:offset + one.size]
        else:
            block, data = _view(one.data, one.size)
            _release_at_end(block, _keep, batch)
        messages.append(Message(one, data))
    return messages


def payload(value: Any) -> Tuple[Any, int, Any]:
    """What the library gets for a value, its size, and what has to live meanwhile: a dictionary as a
    Bitestream, text as UTF-8, any buffer as it is. BitestreamError, TypeError."""
    if isinstance(value, Mapping):
        value = bitestream.encode(value)
    elif isinstance(value, str):
        try:
            value = value.encode()
        except UnicodeEncodeError as error:
            raise errors.BadArgument(f"the message is not Unicode text: {error}") from None
    if isinstance(value, bytes):
        return value, len(value), value
    try:
        view = memoryview(value)
    except TypeError:
        raise TypeError(f"a message is a dict, a str, or has the buffer protocol; this is a {type(value).__name__}") from None
    if view.readonly or not view.c_contiguous or view.nbytes == 0:
        copied = view.tobytes()
        return copied, len(copied), copied
    block = (ctypes.c_ubyte * view.nbytes).from_buffer(view.cast("B") if view.format != "B" or view.ndim != 1 else view)
    return ctypes.addressof(block), view.nbytes, block


@dataclass(frozen=True)
class NodeRecord:
    """A node of the network. `joined` is how many seconds ago it joined."""

    id: Peer
    name: str
    hub_id: int
    hub_name: str
    description: str
    place: str
    joined: float
    services: int
    connected: bool

    @classmethod
    def of(cls, raw: Any) -> NodeRecord:
        """From the library's struct."""
        return cls(Peer(raw.id), raw.name.decode(), raw.hub_id, raw.hub_name.decode(), raw.description.decode(),
                   raw.place.decode(), raw.joined_ms / 1e3, raw.services, bool(raw.connected))


LANES = {"real_time": _c.GIMI_LANE_REAL_TIME, "normal": _c.GIMI_LANE_NORMAL, "bulk": _c.GIMI_LANE_BULK,
         "background": _c.GIMI_LANE_BACKGROUND}
DELIVERIES = {"stream": _c.GIMI_STREAM, "latest": _c.GIMI_LATEST, "sync": _c.GIMI_SYNC}


def chosen(what: str, words: Mapping[str, int], word: str) -> int:
    """The number of that word. BadArgument names those that there are."""
    if word not in words:
        raise errors.BadArgument(f"there is no {what} {word!r}: use {', '.join(words)}")
    return words[word]


LANE_NAMES = {number: name for name, number in LANES.items()}
_DELIVERY_NAMES = {number: name for name, number in DELIVERIES.items()}


@dataclass(frozen=True)
class ServiceRecord:
    """A service of the network. `accepts`: others send to it, instead of subscribing. `missed`: messages that
    subscribers at the asked hub missed; `missed_most`: the one of them that missed most."""

    name: str
    hub_name: str
    metadata: str
    node: Peer
    key: Tuple[int, int]
    accepts: bool
    delivery: str
    window: int
    subscribers: int
    retain: bool
    missed: int
    missed_most: Optional[Peer]

    @classmethod
    def of(cls, raw: Any) -> ServiceRecord:
        """From the library's struct."""
        delivery = _DELIVERY_NAMES.get(raw.delivery, f"unknown {raw.delivery}")
        return cls(raw.name.decode(), raw.hub_name.decode(), raw.metadata.decode(), Peer(raw.node),
                   (raw.key.type, raw.key.instance), raw.direction == _c.GIMI_ACCEPTS, delivery, raw.window,
                   raw.subscribers, bool(raw.retain), raw.missed, Peer(raw.missed_most) if raw.missed_most else None)


@dataclass(frozen=True)
class Event:
    """What a watch tells: `change` in words, and the node or the service, or neither."""

    change: str
    node: Optional[NodeRecord]
    service: Optional[ServiceRecord]
    former_name: str
    why: str

    @classmethod
    def of(cls, raw: Any) -> Event:
        """From the library's struct."""
        return cls(_c.lib.gimi_change_text(raw.change).decode(), NodeRecord.of(raw.node.contents) if raw.node else None,
                   ServiceRecord.of(raw.service.contents) if raw.service else None,
                   (raw.former_name or b"").decode(), (raw.why or b"").decode())
