"""The protocol of docs/protocol.md with a socket and struct, so that the hub is not tested by its own code."""

import dataclasses
import random
import socket
import struct
import time

from support.tap import FrameCount
from support.waiting import PATIENCE_S

HEADER = 16
OPENING = b"GIMnet\x01\x00"
UNICAST, GROUP, LIST, BROADCAST, SERVICE, REPORT, FLOW, TAKEN = range(8)
LINK, NS, CTRL, ROUTE = 16, 17, 18, 19
HELLO, WELCOME, GOODBYE = 1, 2, 3
PING, PONG, CREDIT, PAUSE, RESUME, CONFIRM, SKIP, DROPPED, MISSED = range(1, 10)
BLOCK, DROP, LATEST = 1, 2, 3
FLAG_REPORT, FLAG_FRAGMENT, FLAG_EXT, FLAG_KEYED = 0x04, 0x08, 0x10, 0x20
GOODBYES = ("done bad_version malformed hello_timeout name_taken bad_name hub_full draining replaced silent "
            "slow_consumer wrong_source not_allowed too_many_requests stalled_frame kicked no_memory "
            "renumbered oddities").split()
_SIZES = {1: "?", 2: "B", 3: "<H", 4: "<I", 5: "<Q", 13: "<q"}


def frame(dst, src, payload=b"", kind=UNICAST, flags=0, lane=1, hops=0, length=None):
    size = len(payload) if length is None else length
    return struct.pack("<IIIBBBB", size, dst, src, kind, flags, hops, lane) + payload


def value(key, kind, content):
    """One Bitestream value with an integer key."""
    for code, pack, most in ((0, "B", 0xFF), (1, "<H", 0xFFFF), (2, "<I", 1 << 30)):
        if len(content) <= most:
            return bytes([kind << 3 | code]) + struct.pack("<I", key)[:3] + struct.pack(pack, len(content)) + content
    raise ValueError("too long")


def number(key, kind, content):
    return value(key, kind, struct.pack(_SIZES[kind], content))


def text(key, content):
    return value(key, 12, content.encode())


def values(stream):
    """{key: value} of a Bitestream with integer keys; the first of each."""
    found, at = {}, 0
    while at < len(stream):
        head = stream[at]
        kind = head >> 3
        key = int.from_bytes(stream[at + 1:at + 4], "little")
        size_bytes = 1 << (head & 3)
        size = int.from_bytes(stream[at + 4:at + 4 + size_bytes], "little")
        at += 4 + size_bytes
        content = stream[at:at + size]
        at += size
        if kind in _SIZES:
            content = struct.unpack(_SIZES[kind], content)[0]
        elif kind == 12:
            content = content.decode()
        found.setdefault(key, content)
    return found


def control(operation, body=b"", request=0):
    return struct.pack("<HH", operation, request) + body


def hello(name=None, role=0, shard=None, token=None, extra=b""):
    body = number(1, 2, role)
    if name is not None:
        body += text(2, name)
    if token is not None:
        body += value(3, 0, token)
    if shard is not None:
        body += number(11, 3, shard)
    return frame(0, 0, control(HELLO, body + extra), kind=LINK)


@dataclasses.dataclass
class Frame:
    dst: int
    src: int
    kind: int
    flags: int
    lane: int
    payload: bytes

    @property
    def operation(self):
        return struct.unpack_from("<H", self.payload)[0]

    @property
    def fields(self):
        return values(self.payload[4:])

    @property
    def goodbye(self):
        """Name of a GOODBYE's code; None for other frames."""
        if self.kind != LINK or self.operation != GOODBYE:
            return None
        return GOODBYES[self.fields[1]]


class Closed(Exception):
    """The hub closed the connection."""


class Client:
    """A connection to a hub. Reads only when asked to. The test's `clients` lists them all. Counts the frames of nodes that
    it sent, and that next() gave."""

    def __init__(self, test, hub, receive_bytes=None, local=False):
        """`local`: over the hub's Unix socket."""
        self.socket = socket.socket(socket.AF_UNIX if local else socket.AF_INET, socket.SOCK_STREAM)
        test.addCleanup(self.socket.close)
        test.__dict__.setdefault("clients", []).append(self)
        if receive_bytes:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_bytes)
        if not local:
            self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.socket.settimeout(PATIENCE_S)
        self.socket.connect(hub.socket_path if local else ("127.0.0.1", hub.port))
        self.id, self.welcome, self.pinged = 0, {}, 0
        self._bytes, self._sent, self.frames_got = bytearray(), FrameCount(), 0

    @property
    def frames_sent(self):
        return self._sent.frames

    def send(self, data):
        self.socket.sendall(data)
        self._sent.feed(data)
        return self

    def join(self, name=None, **how):
        self.send(OPENING + hello(name, **how))
        answer = self.first_answer()
        assert answer.operation == WELCOME, answer
        self.id, self.welcome = answer.dst, answer.fields
        return self

    def first_answer(self):
        """The frame behind the hub's opening."""
        opening = self._take(8)
        assert opening == OPENING, opening
        return self.next()

    def read_ahead(self):
        """What was read and not taken yet: for who goes on reading from the socket itself."""
        taken = bytes(self._bytes)
        self._bytes.clear()
        return taken

    def _take(self, size):
        while len(self._bytes) < size:
            try:
                more = self.socket.recv(1 << 16)
            except ConnectionResetError:
                more = b""
            if not more:
                raise Closed()
            self._bytes += more
        taken = bytes(self._bytes[:size])
        del self._bytes[:size]
        return taken

    def next(self):
        """The next frame of any kind. PINGs are answered. Closed: there is none."""
        length, dst, src, kind, flags, _, lane = struct.unpack("<IIIBBBB", self._take(16))
        got = Frame(dst, src, kind, flags, lane, self._take(length))
        self.frames_got += kind < LINK and kind not in (REPORT, FLOW)
        if kind == FLOW and got.payload[0] == PING:
            self.pinged += 1
            try:
                self.pong(got.payload)
            except OSError:
                pass
        return got

    def pong(self, ping):
        self.send(self.frame(0, struct.pack("<B3x12s", PONG, ping[4:16]) + struct.pack("<q", time.time_ns()), kind=FLOW))

    def ping(self, sequence=1):
        """Also tells the hub that this end is alive."""
        return self.send(self.frame(0, struct.pack("<B3xIq", PING, sequence, time.time_ns()), kind=FLOW))

    def frame(self, dst, payload=b"", **how):
        return frame(dst, self.id, payload, **how)

    def next_data(self):
        """The next frame of a node."""
        return self.next_where(lambda got: got.kind < REPORT)

    def next_where(self, wanted):
        while True:
            got = self.next()
            if wanted(got):
                return got

    def until_closed(self):
        """All frames until the hub closes."""
        frames = []
        try:
            while True:
                frames.append(self.next())
        except Closed:
            return frames

    def goodbye(self):
        """Name of the code with which the hub closes; None if it closes without a word."""
        return next((got.goodbye for got in self.until_closed() if got.goodbye), None)

    def ask(self, kind, operation, body=b"", request=1):
        self.send(self.frame(0, control(operation, body, request), kind=kind))
        return self.next_where(lambda got: got.kind == kind and got.operation == operation | 0x8000).fields


def varied_bytes(size, seed=0):
    """Bytes in which no two places look alike, so that parts that are swapped, repeated or lost are seen."""
    return random.Random(f"{seed} {size}").randbytes(size)
