#!/usr/bin/env python3
"""Bytes that docs/protocol.md forbids: each gets its documented answer, costs the hub nothing that it keeps, and shows in
a counter. Every test ends by sending through the same hub as if nothing had happened."""

import socket
import struct
import unittest

from support.processes import Hub, run_gimnet
from support.waiting import wait_until
from support.wire import (BLOCK, BROADCAST, CTRL, FLAG_EXT, FLAG_FRAGMENT, FLAG_KEYED, FLAG_REPORT, FLOW, GROUP, HELLO,
                          LATEST, LINK, LIST, NS, OPENING, REPORT, ROUTE, SERVICE, UNICAST, Client, Closed, control,
                          frame, hello, text, value)


class HostileInput(unittest.TestCase):
    HANDSHAKE_MS = 60_000

    def setUp(self):
        self.hub = Hub(self, "--limit", f"handshake_ms={self.HANDSHAKE_MS}")

    def tearDown(self):
        for client in getattr(self, "clients", ()):
            client.socket.close()
        first, second = Client(self, self.hub).join(), Client(self, self.hub).join()
        first.send(first.frame(second.id, b"still here"))
        self.assertEqual(second.next_data().payload, b"still here")
        for client in (first, second):
            client.send(client.frame(0, control(3), kind=LINK))
            client.until_closed()
        wait_until(lambda: self.hub.counter("connections") == 1, "nothing that stays but the asking tool")
        self.hub.quiet_status(self)

    def closed_as(self, code, data, counter=None):
        """What the hub answers a node that sends `data`."""
        before = self.hub.counter(counter) if counter else 0
        client = Client(self, self.hub).join()
        client.send(data(client) if callable(data) else data)
        self.assertEqual(client.goodbye(), code)
        if counter:
            self.assertEqual(self.hub.counter(counter), before + 1)

    def malformed(self, **how):
        how.setdefault("payload", b"x")
        with self.subTest(**how):
            self.closed_as("malformed", lambda client: frame(how.pop("dst", client.id), client.id, **how), "malformed")


class Handshakes(HostileInput):
    def test_garbage_is_not_answered(self):
        for data in (b"GET / HTTP/1.1\r\n\r\n", b"\x16\x03\x01\x02\x00", b"GIMnot\x01\x00", bytes(1000)):
            with self.subTest(data=data[:8]):
                client = Client(self, self.hub).send(data)
                with self.assertRaises(Closed):
                    client.next()

    def test_another_major_version(self):
        for major in (0, 2, 255):
            client = Client(self, self.hub).send(b"GIMnet" + bytes([major, 0]) + hello())
            answer = client.first_answer()
            self.assertEqual(answer.goodbye, "bad_version")
            self.assertIn("1", answer.fields[2], "it names the version that is spoken here")

    def test_another_minor_version_is_welcome(self):
        client = Client(self, self.hub).send(b"GIMnet\x01\x63" + hello())
        self.assertIsNone(client.first_answer().goodbye)

    def test_a_hello_that_is_too_long(self):
        for length in (1024 - 8 - 16 + 1, 65536, 2**32 - 1):
            with self.subTest(length=length):
                client = Client(self, self.hub).send(OPENING + frame(0, 0, control(HELLO), kind=LINK, length=length))
                self.assertEqual(client.first_answer().goodbye, "malformed")

    def test_a_first_frame_that_is_no_hello(self):
        for data in (frame(1, 0, b"x"), frame(0, 0, control(HELLO), kind=NS), frame(0, 0, control(9), kind=LINK)):
            with self.subTest(data=data):
                self.assertEqual(Client(self, self.hub).send(OPENING + data).first_answer().goodbye, "malformed")

    def test_bad_names_and_roles(self):
        for name in ("/", "a//b", "a b", "x" * 256, "/".join("a" * 17)):
            with self.subTest(name=name):
                answer = Client(self, self.hub).send(OPENING + hello(name)).first_answer()
                self.assertIn(answer.goodbye, ("bad_name", "malformed"))
        for role in (1, 2, 3, 255):
            with self.subTest(role=role):
                answer = Client(self, self.hub).send(OPENING + hello(role=role)).first_answer()
                self.assertIn(answer.goodbye, ("not_allowed", "malformed"))

    def test_unknown_keys_are_skipped_and_broken_ones_refused(self):
        client = Client(self, self.hub).send(OPENING + hello(extra=value(999, 0, b"later")))
        self.assertIsNone(client.first_answer().goodbye)
        bomb = b""
        for _ in range(20):
            bomb = value(9, 14, bomb or b"\0")
        for body in (b"\xff", bytes([12 << 3, 2, 0, 0, 50]) + b"short", value(2, 15, b"x"), bomb):
            with self.subTest(body=body[:8]):
                client = Client(self, self.hub).send(OPENING + frame(0, 0, control(HELLO, body), kind=LINK))
                self.assertEqual(client.first_answer().goodbye, "malformed")


class UnfinishedHandshakes(HostileInput):
    HANDSHAKE_MS = 1_500  # waited for; whoever means well is faster by far

    def test_half_an_opening_and_then_nothing(self):
        client = Client(self, self.hub).send(OPENING[:5])
        self.assertEqual([got.goodbye for got in self.after_opening(client)][-1:], ["hello_timeout"])

    def after_opening(self, client):
        """Frames behind the opening; none where the hub closes without a word."""
        try:
            return [client.first_answer()]
        except Closed:
            return []

    def test_a_hello_that_never_ends(self):
        client = Client(self, self.hub).send(OPENING + frame(0, 0, control(HELLO), kind=LINK, length=500))
        self.assertEqual(client.first_answer().goodbye, "hello_timeout")

    def test_many_silent_connections_cost_nothing_that_stays(self):
        quiet = [socket.create_connection(("127.0.0.1", self.hub.port), timeout=20) for _ in range(500)]
        for connection in quiet:
            self.addCleanup(connection.close)
        for connection in quiet:
            data = b""
            while chunk := connection.recv(4096):
                data += chunk
            self.assertTrue(data.startswith(OPENING), data)


class Frames(HostileInput):
    def test_lengths(self):
        for length in (65537, 1 << 20, 2**31, 2**32 - 1):
            self.malformed(length=length)

    def test_reserved_bits(self):
        for lane in (4, 8, 0x80, 0xFF):
            self.malformed(lane=lane)
        for flags in (0x40, 0x80, 0xC0):
            self.malformed(flags=flags)
        for hops in (1, 255):
            self.malformed(hops=hops)

    def test_unknown_kinds(self):
        for kind in (20, 21, 100, 255):
            self.malformed(kind=kind)

    def test_kinds_that_a_node_may_not_send(self):
        for kind in (REPORT, ROUTE):
            with self.subTest(kind=kind):
                client = Client(self, self.hub).join()
                client.send(client.frame(client.id, b"x", kind=kind))
                self.assertIn(client.goodbye(), ("malformed", "not_allowed"))

    def test_kinds_not_known_yet_are_routed_like_unicast(self):
        sender, receiver = Client(self, self.hub).join(), Client(self, self.hub).join()
        for kind in range(8, 16):
            sender.send(sender.frame(receiver.id, b"later", kind=kind))
        got = [receiver.next_where(lambda frame: 8 <= frame.kind < 16).kind for _ in range(8)]
        self.assertEqual(got, list(range(8, 16)))

    def test_every_kind_without_a_payload(self):
        receiver = Client(self, self.hub).join()
        for kind in range(20):
            with self.subTest(kind=kind):
                client = Client(self, self.hub).join()
                client.send(client.frame(receiver.id if kind in (0, 7) or 8 <= kind < 16 else 0, b"", kind=kind))
                if kind in (LIST, REPORT, FLOW, LINK, NS, CTRL, ROUTE):
                    self.assertIn(client.goodbye(), ("malformed", "not_allowed"))
                else:
                    client.ping()
                    self.assertEqual(client.next().kind, FLOW)

    def test_the_other_byte_order(self):
        client = Client(self, self.hub).join()
        for field in range(3):
            client = Client(self, self.hub).join()
            numbers = [5, client.id, client.id]
            words = [struct.pack(">I" if i == field else "<I", number) for i, number in enumerate(numbers)]
            client.send(b"".join(words) + bytes([UNICAST, FLAG_REPORT, 0, 1]) + b"hello")
            if field == 1:  # an id like any other, of a hub that is not there
                self.assertEqual(client.next_where(lambda got: got.kind == REPORT).payload[0], 2)
            else:
                self.assertEqual(client.goodbye(), "malformed" if field == 0 else "wrong_source")

    def test_destinations_that_are_not_there(self):
        client = Client(self, self.hub).join()
        no_such_node, no_route, no_such_group, no_subscriber = 1, 2, 13, 18
        cases = ((UNICAST, client.id + 1000, no_such_node), (UNICAST, 7 << 20, no_such_node), (UNICAST, 0, no_route),
                 (UNICAST, 8 << 20 | 1, no_route), (UNICAST, 0xFFFFFFFF, no_route), (GROUP, 7 << 20 | 5, no_such_group),
                 (GROUP, 8 << 20 | 5, no_route), (SERVICE, 7 << 20 | 5, no_such_group))
        for kind, dst, reason in cases:
            with self.subTest(kind=kind, dst=dst):
                client.send(client.frame(dst, b"x", kind=kind, flags=FLAG_REPORT))
                report = client.next_where(lambda got: got.kind == REPORT)
                self.assertEqual(report.payload[0], reason)
                self.assertEqual(report.payload[8:16], struct.pack("<II", 1, dst))

    def test_a_second_hello(self):
        self.closed_as("malformed", hello(), "malformed")
        client = Client(self, self.hub).join()
        client.send(OPENING + bytes(8))  # read as a header: an impossible length
        self.assertEqual(client.goodbye(), "malformed")

    def test_policies_that_do_not_fit(self):
        for kind in (GROUP, BROADCAST):
            self.malformed(kind=kind, flags=BLOCK)
        self.malformed(kind=LIST, dst=1, flags=BLOCK, payload=struct.pack("<I", 7 << 20 | 1))
        for kind in (UNICAST, SERVICE):
            self.malformed(kind=kind, flags=LATEST)

    def test_lists(self):
        def ids(*numbers):
            return struct.pack(f"<{len(numbers)}I", *numbers)
        base = 7 << 20
        for count, payload in ((0, b"x"), (1025, ids(*range(base + 1, base + 1026))), (2**32 - 1, b"x"),
                               (2, ids(base + 2, base + 1)), (2, ids(base + 1, base + 1)), (2, ids(base + 1)),
                               (3, ids(base + 1, base + 2) + b"x")):
            self.malformed(kind=LIST, dst=count, payload=payload)

    def test_a_list_of_1024_is_fine(self):
        sender, receiver = Client(self, self.hub).join(), Client(self, self.hub).join()
        numbers = range(receiver.id, receiver.id + 1024)
        sender.send(sender.frame(1024, struct.pack("<1024I", *numbers) + b"all", kind=LIST))
        got = receiver.next_data()
        self.assertEqual((got.dst, got.payload), (0, b"all"))

    def test_headers_that_do_not_fit(self):
        for payload in (b"", b"\x01", b"\xff\xff", b"\x05\x00\x00\x04\x00"):
            self.malformed(flags=FLAG_EXT, payload=payload)
        for payload in (b"", bytes(11), bytes(12)):
            self.malformed(flags=FLAG_FRAGMENT, payload=payload)
        self.malformed(flags=FLAG_KEYED, payload=bytes(7))

    def test_flow_and_link_for_somebody_else(self):
        self.malformed(dst=7 << 20 | 1, kind=FLOW, payload=b"\x01" + bytes(15))
        self.malformed(dst=7 << 20 | 1, kind=LINK, payload=control(3))

    def test_fragments_that_lie(self):
        for number, offset, total in ((1, 0, 0), (1, 1, 1), (1, 2**32 - 1, 2**32 - 1), (1, 5, 4), (1, 2**32 - 1, 1)):
            self.malformed(flags=FLAG_FRAGMENT, payload=struct.pack("<III", number, offset, total) + b"xy")

    def test_a_spoofed_source(self):
        victim = Client(self, self.hub).join()
        for source in (victim.id, 0, 0xFFFFFFFF):
            with self.subTest(source=source):
                self.closed_as("wrong_source", frame(victim.id, source, b"x"), "wrong_source")

    def test_half_a_header(self):
        client = Client(self, self.hub).join()
        client.send(client.frame(client.id, b"x")[:7])
        client.socket.shutdown(socket.SHUT_WR)
        client.until_closed()

    def test_flow_that_is_unknown_or_too_short(self):
        for payload in (b"", b"\x01", b"\x00" * 16, b"\x08" + bytes(15), b"\xff" + bytes(15), b"\x04" + bytes(6),
                        b"\x06" + bytes(14)):
            self.malformed(dst=0, kind=FLOW, payload=payload)

    def test_confirmations_of_what_was_never_sent(self):
        client = Client(self, self.hub).join()
        client.send(client.frame(0, b"\x06" + bytes(7) + b"\xff" * 8, kind=FLOW))
        client.ping()
        self.assertIn(client.goodbye() if self.closes(client) else None, (None, "malformed"))

    def closes(self, client):
        try:
            client.next_where(lambda got: got.kind == FLOW and got.payload[0] == 2)
            return False
        except Closed:
            return True

    def test_control_frames_that_cannot_be_read(self):
        client = Client(self, self.hub).join()
        for kind, operation, body in ((NS, 999, b""), (NS, 3, b"\xff"), (NS, 3, b""), (NS, 7, text(3, "a b")),
                                      (CTRL, 999, b""), (CTRL, 3, b"\xff")):
            with self.subTest(kind=kind, operation=operation):
                self.assertGreater(client.ask(kind, operation, body)[1], 0)
        client.send(client.frame(0, b"\x01", kind=NS))
        self.assertIn(self.answer_or_goodbye(client), ("malformed", "bad_request"))

    def answer_or_goodbye(self, client):
        client.ping()
        try:
            client.next_where(lambda got: got.kind == NS or (got.kind == FLOW and got.payload[0] == 2))
            return "bad_request"
        except Closed:
            return "malformed"

    def test_bitestream_bombs_in_requests(self):
        client = Client(self, self.hub).join()
        deep = b"\0"
        while len(deep) < 50_000:
            deep = value(3, 14, deep)
        claims = bytes([15 << 3 | 2, 3, 0, 0]) + struct.pack("<I", 2**32 - 1)
        many = value(3, 15, b"a") * 10_000
        for name, body in (("nested", deep), ("a length of 2^32-1", claims), ("10,000 keys", many)):
            for operation in (3, 5, 7, 10):
                with self.subTest(bomb=name, operation=operation):
                    before = self.refused("bad_request")
                    status = client.ask(NS, operation, body)[1]
                    if status == 2:
                        self.assertEqual(self.refused("bad_request"), before + 1)
                    else:
                        self.assertEqual(name, "10,000 keys", "the first of repeated keys counts")

    def refused(self, status):
        """Requests that were answered so; the counter is there once it is not 0."""
        return self.hub.status()["counters"].get(f"names.refused.{status}", 0)

    def test_a_request_for_a_hub_that_is_not_there(self):
        client = Client(self, self.hub).join()
        before = self.refused("not_found")
        for dst in (8 << 20, client.id, 0xFFFFFFFF):
            client.send(client.frame(dst, control(3, text(3, "robot"), 9), kind=NS))
            answer = client.next_where(lambda got: got.kind == NS)
            self.assertEqual(answer.payload[:4], struct.pack("<HH", 0x8003, 9))
            self.assertIn(b"no route", answer.payload)
        self.assertEqual(self.refused("not_found"), before + 3)

    def test_too_many_requests(self):
        client = Client(self, self.hub).join()
        count = 20000
        try:
            client.send(client.frame(0, control(5, b"", 1), kind=NS) * count)
        except OSError:
            pass
        answers, code = 0, None
        while answers < count and code is None:
            try:
                got = client.next()
            except Closed:
                break
            answers += got.kind == NS
            code = got.goodbye
        self.assertTrue(code == "too_many_requests" or answers == count, (code, answers))

    def test_the_tool_says_what_the_hub_counted(self):
        self.closed_as("malformed", lambda client: client.frame(0, b"", kind=99), "malformed")
        self.assertIn("ledger:", run_gimnet(self.hub, "status").out.decode())


if __name__ == "__main__":
    unittest.main()
