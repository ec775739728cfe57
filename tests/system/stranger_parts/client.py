"""docs/protocol.md: one connection to a hub."""

import collections
import socket
import struct
import time

from stranger_parts.bitestream import BOOL, OPAQUE, TEXT, U16, U32, U64, U8, fields, put

OPENING = bytes.fromhex("47494d6e65740100")
UNICAST, GROUP, LIST, BROADCAST, SERVICE, REPORT, FLOW, TAKEN = range(8)
LINK, NS, CTRL = 16, 17, 18
BLOCK, DROP, LATEST = 1, 2, 3
F_REPORT, F_FRAGMENT, F_EXT, F_KEYED = 4, 8, 16, 32
HELLO, WELCOME, GOODBYE = 1, 2, 3
PING, PONG, CREDIT, PAUSE, RESUME, CONFIRM, SKIP, DROPPED, MISSED = range(1, 10)
ANSWER = 0x8000
EVERY_NODE = 0xFFFFF

# What the client did and saw of the tables of the document, as ("FLOW", 1): the test compares it with the tables.
seen = set()

Got = collections.namedtuple("Got", "dst src kind flags hops lane body")


class Refused(Exception):
    """The hub said GOODBYE: code and sentence."""


class Denied(Exception):
    """An answer with a status that is not 0: status and sentence."""


class Stranger:
    """Single-threaded; keeps alive whenever it waits."""

    def __init__(self, address, patience_s=60.0):
        scheme, _, rest = address.partition(":")
        if scheme == "unix":
            self.socket = socket.socket(socket.AF_UNIX)
            self.socket.connect(rest)
        else:
            host, port = rest.removeprefix("//").rsplit(":", 1)
            self.socket = socket.create_connection((host, int(port)))
            self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.socket.settimeout(patience_s)
        self.patience_s = patience_s
        self.id, self.welcome, self.requests = 0, {}, 0
        self.taken = 0  # data frames of this epoch
        self.answers_pings = True
        self.waiting = collections.deque()
        self.unread = bytearray()

    def close(self):
        self.socket.close()

    # ---- frames

    def write(self, kind, dst=0, body=b"", flags=0, lane=1, src=None):
        seen.add(("kind", kind))
        source = self.id if src is None else src
        self.socket.sendall(struct.pack("<IIIBBBB", len(body), dst, source, kind, flags, 0, lane) + body)

    def _exactly(self, count):
        while len(self.unread) < count:
            more = self.socket.recv(1 << 16)
            if not more:
                raise ConnectionError("the hub closed the connection")
            self.unread += more
        taken = bytes(self.unread[:count])
        del self.unread[:count]
        return taken

    def read(self):
        """The next frame, whatever it is. PINGs are answered, data frames counted."""
        size, dst, src, kind, flags, hops, lane = struct.unpack("<IIIBBBB", self._exactly(16))
        got = Got(dst, src, kind, flags, hops, lane, self._exactly(size))
        seen.add(("kind", kind))
        if kind == FLOW:
            seen.add(("FLOW", got.body[0]))
            if got.body[0] == PING and self.answers_pings:
                self.flow(PONG, got.body[4:16] + struct.pack("<q", time.time_ns()))
        elif kind < 16 and kind != REPORT:
            self.taken += 1
        elif kind == LINK and got.body[:2] == struct.pack("<H", GOODBYE):
            said = fields(got.body[4:])
            seen.add(("GOODBYE", said.get(1, 0)))
            raise Refused(said.get(1, 0), said.get(2, ""))
        elif kind >= 16 and got.body[2:4] == b"\0\0":
            seen.add((kind, struct.unpack_from("<H", got.body)[0]))
        return got

    def wait(self, wanted):
        """The next frame for which `wanted` holds. Others wait until they are asked for."""
        for index, got in enumerate(self.waiting):
            if wanted(got):
                del self.waiting[index]
                return got
        deadline = time.monotonic() + self.patience_s
        while time.monotonic() < deadline:
            got = self.read()
            if wanted(got):
                return got
            self.waiting.append(got)
        raise TimeoutError("the frame did not come")

    def data(self, kind=None):
        return self.wait(lambda got: got.kind < 16 and got.kind not in (FLOW, REPORT) and kind in (None, got.kind))

    # ---- section 3

    def read_opening(self):
        if self._exactly(8) != OPENING:
            raise ConnectionError("no hub")

    def join(self, name="", role=0, token=b"", epoch=0, resume=False, frame_bytes=0, hub_epoch=0, taken=0, description="",
             extra=b""):
        body = b""
        for key, kind, content in ((1, U8, role), (2, TEXT, name), (3, OPAQUE, token), (4, U64, epoch), (5, BOOL, resume),
                                   (6, U32, frame_bytes), (8, TEXT, description), (9, U64, hub_epoch), (10, U64, taken)):
            if content:
                body += put(key, kind, content)
        self.socket.sendall(OPENING)
        self.write(LINK, 0, struct.pack("<HH", HELLO, 0) + body + extra, src=0)
        self.read_opening()
        got = self.read()
        seen.add(("LINK", HELLO))
        operation, request = struct.unpack_from("<HH", got.body)
        if (got.kind, operation, request) != (LINK, WELCOME, 0):
            raise ConnectionError(f"neither WELCOME nor GOODBYE: {got}")
        seen.add(("LINK", WELCOME))
        self.welcome = fields(got.body[4:])
        if 16 in self.welcome:
            seen.add(("GOODBYE", self.welcome[16]))  # of the connection before
        self.id = self.welcome[1]
        return self

    def leave(self):
        """Says GOODBYE and waits until the hub has closed."""
        self.write(LINK, 0, struct.pack("<HH", GOODBYE, 0) + put(1, U16, 0))
        seen.update({("LINK", GOODBYE), ("GOODBYE", 0)})
        try:
            while True:
                self.read()
        except (ConnectionError, Refused):
            self.close()

    # ---- section 4

    def flow(self, operation, rest, number=0):
        seen.add(("FLOW", operation))
        self.write(FLOW, 0, bytes([operation, number, 0, 0]) + rest)

    def ping(self, sequence=1):
        sent = time.time_ns()
        self.flow(PING, struct.pack("<Iq", sequence, sent))
        pong = self.wait(lambda got: got.kind == FLOW and got.body[0] == PONG)
        number, back, now = struct.unpack_from("<Iqq", pong.body, 4)
        assert (number, back) == (sequence, sent), "not this PING's"
        return now

    # ---- sections 8 and 9

    def ask(self, kind, operation, body=b"", dst=0):
        """The answer's bytes behind operation and request number."""
        self.requests += 1
        seen.add((kind, operation))
        self.write(kind, dst, struct.pack("<HH", operation, self.requests) + body)
        mine = struct.pack("<HH", operation | ANSWER, self.requests)
        answer = self.wait(lambda got: got.kind == kind and got.body[:4] == mine).body[4:]
        status = fields(answer).get(1, 0)
        seen.add(("status", status))
        if status:
            raise Denied(status, fields(answer).get(2, ""))
        return answer

    def resolve(self, name):
        return fields(self.ask(NS, 3, put(3, TEXT, name)))[3]

    def advertise(self, service, **more):
        return fields(self.ask(NS, 7, put(3, TEXT, service) + b"".join(more.values())))

    def subscribe(self, full_name, more=b""):
        return fields(self.ask(NS, 10, put(3, TEXT, full_name) + more))

    def event(self, operation):
        mine = struct.pack("<HH", operation, 0)
        return fields(self.wait(lambda got: got.kind == NS and got.body[:4] == mine).body[4:])

    def report(self, wanted=None):
        """(reason, count, header of the last frame) of the next REPORT, or of the next one of that reason."""
        got = self.wait(lambda frame: frame.kind == REPORT and wanted in (None, frame.body[0]))
        reason, count = struct.unpack_from("<B3xI", got.body)
        seen.add(("reason", reason))
        return reason, count, got.body[8:24]


def u32(key, content):
    return put(key, U32, content)
