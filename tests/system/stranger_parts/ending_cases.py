"""Section 3 of docs/protocol.md: how the hub ends a connection, and what it says."""

import struct
import time

from stranger_parts import client as wire
from stranger_parts.bitestream import TEXT, put
from stranger_parts.case import PATIENT, Case
from stranger_parts.client import CTRL, NS, UNICAST, Refused, u32


def header(size, source, hops=0):
    return struct.pack("<IIIBBBB", size, 0, source, UNICAST, 0, hops, 1)


class Endings(Case):
    def test_another_major_version(self):
        made = self.connected(self.hub())
        made.socket.sendall(b"GIMnet\2\0")
        made.read_opening()
        self.assertEqual(self.goodbye(made), 1)

    def test_bytes_that_are_forbidden(self):
        made = self.stranger(self.hub())
        made.socket.sendall(header(0, made.id, hops=1))
        self.assertEqual(self.goodbye(made), 2)

    def test_no_hello(self):
        made = self.connected(self.hub("--limit", "handshake_ms=100"))
        made.socket.sendall(wire.OPENING)
        made.read_opening()
        self.assertEqual(self.goodbye(made), 3)

    def test_a_role_that_is_not_admitted(self):
        hub = self.hub()
        for role in (1, 2, 9):
            with self.assertRaises(Refused) as refused:
                self.stranger(hub, role=role)
            self.assertEqual(refused.exception.args[0], 12)

    def test_nothing_is_heard(self):
        made = self.stranger(self.hub("--limit", "silent_ms=100", "--limit", "keep_alive_ms=20"))
        made.answers_pings = False
        self.assertEqual(self.goodbye(made), 9)

    def test_a_frame_that_does_not_end(self):
        made = self.stranger(self.hub("--limit", "stalled_frame_ms=100", *PATIENT))
        made.socket.sendall(header(100, made.id) + b"half of")
        self.assertEqual(self.goodbye(made), 14)

    def test_more_requests_than_may_wait(self):
        made = self.stranger(self.hub(*PATIENT))
        ask = struct.pack("<HH", 5, 1)
        request = struct.pack("<IIIBBBB", len(ask), 0, made.id, NS, 0, 0, 1) + ask
        deadline = time.monotonic() + made.patience_s
        code = None
        # All of them stand in what the hub reads at once, unless the network cut them.
        while code is None and time.monotonic() < deadline:
            try:
                made.socket.sendall(1000 * request)
                made.ping()
            except Refused as refused:
                code = refused.args[0]
        self.assertEqual(code, 13)

    def test_one_that_takes_nothing_hears_it_at_its_next_welcome(self):
        hub = self.hub("--limit", "slow_consumer_ms=100", *PATIENT)
        slow, fast = self.stranger(hub, "slow"), self.stranger(hub)
        for _ in range(300):
            fast.write(UNICAST, slow.id, bytes(60_000), flags=wire.DROP)
        self.until_away(fast, "slow")
        again = self.stranger(hub, token=slow.welcome[2])
        self.assertEqual((again.id, again.welcome[16]), (slow.id, 10))
        self.assertTrue(again.welcome[17])

    def test_what_administrators_end(self):
        hub = self.hub()
        one, two, admin = self.stranger(hub, "one"), self.stranger(hub, "two"), self.administrator(hub)
        admin.ask(CTRL, 4, u32(3, one.id) + put(4, TEXT, "enough"))
        self.assertEqual(self.goodbye(one), 15)
        admin.ask(CTRL, 5, u32(3, two.id) + u32(4, 7 << 20 | 500))
        self.assertEqual(self.goodbye(two), 17)
