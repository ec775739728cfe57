"""A hub that invents others, for tests of what it can do to its neighbour."""

import os
import struct
import threading
import time

from stranger_parts.bitestream import OPAQUE, TEXT, TIME, U16, U64, put
from stranger_parts.client import FLOW, PING, PONG, Refused, Stranger
from support.waiting import wait_until

ROUTE, RECORD, RECORDS_END, KEEP_ALIVE = 19, 1, 2, 3
OWN_HUB, INSTANCE = 9, 4711
NEIGHBOURS = 64  # of one part of a record


class Liar:
    """Links to a hub as hub 9, and says what no honest hub says. Ends with the test."""

    def __init__(self, test, hub):
        self._unique = b"u" * 16
        self._link = Stranger(hub.url)
        introduction = put(20, U16, OWN_HUB) + put(21, OPAQUE, self._unique) + put(22, U64, INSTANCE) + put(26, TEXT, "liar")
        self._link.join(role=1, extra=introduction)
        self._ended, self._lock = threading.Event(), threading.Lock()
        self.closed, self._asked, self._answered = False, 0, set()  # numbers of PINGs
        self._peer = (self._link.welcome[20], self._link.welcome[21])
        self._sequence = 0
        for work in (self._read, self._keep_alive):
            threading.Thread(target=work, daemon=True).start()
        test.addCleanup(self.end)
        self._say_neighbours([self._peer])
        self._route(RECORDS_END)

    def end(self):
        self._ended.set()
        self._link.close()

    def send(self, frame):
        """The bytes of any frame."""
        with self._lock:
            self._link.socket.sendall(frame)

    def wait_until_taken(self):
        """The hub has read all frames, and the link stands."""
        self._asked += 1
        sequence = 1_000_000 + self._asked
        with self._lock:
            self._link.flow(PING, struct.pack("<Iq", sequence, 0))
        wait_until(lambda: sequence in self._answered or self.closed, "the PONG")
        assert not self.closed, "the hub closed the link"

    def invent(self, hubs):
        """So many hubs behind this one, each with a record of its own; they can be reached, and answer nothing."""
        others = [(number, struct.pack("<IIII", number, 1, 2, 3)) for number in range(20, 20 + hubs)]
        for number, unique in others:
            self._record(number, unique, number, 1, [(OWN_HUB, self._unique)])
        self._say_neighbours([self._peer] + others)

    def flood(self, seconds):
        """Records of ever new hubs that nobody can reach, up to 5,000 a second. Returns how many."""
        until, count = time.monotonic() + seconds, 0
        while time.monotonic() < until and not self._ended.wait(0.02):
            for _ in range(100):
                count += 1
                self._record(5, os.urandom(16), count, 1, [self._peer])
        return count

    def _say_neighbours(self, neighbours):
        for part, begin in enumerate(range(0, len(neighbours), NEIGHBOURS)):
            self._sequence += 1
            self._record(OWN_HUB, self._unique, INSTANCE, self._sequence, neighbours[begin:begin + NEIGHBOURS], part)

    def _record(self, hub, unique, instance, sequence, neighbours, part=0):
        listed = b"".join(struct.pack("<HH16s", number, 10, of) for number, of in sorted(neighbours))
        body = put(1, U16, hub) + put(2, OPAQUE, unique) + put(3, U64, instance)
        body += put(5, U16, part) if part else b""
        body += put(6, U64, sequence)
        body += b"" if part else put(8, TEXT, f"invented-{hub}")
        self._route(RECORD, body + put(12, OPAQUE, listed))

    def _route(self, operation, body=b""):
        with self._lock:
            self._link.write(ROUTE, body=struct.pack("<HH", operation, 0) + body)

    def _keep_alive(self):
        try:
            while not self._ended.wait(0.2):
                self._route(KEEP_ALIVE, put(1, TIME, time.time_ns()) + put(4, U64, 0) + put(5, U64, 0))
        except OSError:
            pass

    def _read(self):
        try:
            while True:
                got = self._link.read()
                if got.kind == FLOW and got.body[0] == PONG:
                    self._answered.add(struct.unpack_from("<I", got.body, 4)[0])
        except (OSError, Refused, ValueError):
            self.closed = True
