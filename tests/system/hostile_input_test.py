#!/usr/bin/env python3
"""Frames that docs/protocol.md forbids: each gets its documented answer, costs the hub nothing that it keeps, and shows in
a counter."""

import socket
import struct
import unittest

from support.bad_input import STATUSES, HostileInput
from support.processes import run_gimnet
from support.wire import (BLOCK, BROADCAST, CTRL, DROP, FLAG_EXT, FLAG_FRAGMENT, FLAG_KEYED, FLAG_REPORT, FLOW, GOODBYE,
                          GROUP, LATEST, LINK, LIST, NS, OPENING, PING, REPORT, ROUTE, SERVICE, UNICAST, Client, Closed,
                          control, frame, hello, number, text, value)


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
            self.malformed(kind=kind)

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
                    self.assertEqual(client.goodbye(), "malformed")
                    self.expect("malformed")
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
                self.expect("dropped.no_route")
            else:
                code = "malformed" if field == 0 else "wrong_source"
                self.assertEqual(client.goodbye(), code)
                self.expect(code, f"dropped.{code}")

    def test_destinations_that_are_not_there(self):
        client = Client(self, self.hub).join()
        no_such_node, no_route, no_such_group = 1, 2, 13
        names = {no_such_node: "no_such_node", no_route: "no_route", no_such_group: "no_such_group"}
        cases = ((UNICAST, client.id + 1000, no_such_node), (UNICAST, 7 << 20, no_such_node), (UNICAST, 0, no_route),
                 (UNICAST, 8 << 20 | 1, no_route), (UNICAST, 0xFFFFFFFF, no_route), (GROUP, 7 << 20 | 5, no_such_group),
                 (GROUP, 8 << 20 | 5, no_route), (SERVICE, 7 << 20 | 5, no_such_group))
        for kind, dst, reason in cases:
            with self.subTest(kind=kind, dst=dst):
                client.send(client.frame(dst, b"x", kind=kind, flags=FLAG_REPORT))
                report = client.next_where(lambda got: got.kind == REPORT)
                self.assertEqual(report.payload[0], reason)
                self.assertEqual(report.payload[8:16], struct.pack("<II", 1, dst))
                self.expect(f"dropped.{names[reason]}")
        for node, reason in ((client.id + 1000, no_such_node), (8 << 20 | 1, no_route)):
            client.send(client.frame(1, struct.pack("<I", node) + b"x", kind=LIST, flags=FLAG_REPORT))
            self.assertEqual(client.next_where(lambda got: got.kind == REPORT).payload[0], reason)
            self.expect(f"dropped.{names[reason]}")

    def test_a_second_hello(self):
        self.closed_as("malformed", hello())
        self.closed_as("malformed", OPENING + bytes(8))  # read as a header: an impossible length

    def test_policies_that_do_not_fit(self):
        for kind in (GROUP, BROADCAST):
            self.malformed(kind=kind, flags=BLOCK)
        self.malformed(kind=LIST, dst=1, flags=BLOCK, payload=struct.pack("<I", 7 << 20 | 1))
        for kind in (UNICAST, SERVICE):
            self.malformed(kind=kind, flags=LATEST)

    def test_flags_with_which_a_request_would_be_misread(self):
        request = control(1, request=1)
        ping = bytes([PING, 0, 0, 0]) + bytes(12)
        before = {FLAG_FRAGMENT: struct.pack("<III", 1, 0, len(request)), FLAG_KEYED: bytes(8), FLAG_EXT: bytes(2)}
        for kind, payload in ((FLOW, ping), (LINK, control(GOODBYE)), (NS, request), (CTRL, request)):
            for flag, what in before.items():
                if flag == FLAG_EXT and kind in (NS, CTRL):
                    continue
                self.malformed(kind=kind, dst=0, flags=flag, payload=what + payload)
        for extensions in (bytes([1, 0, 5]), bytes([200, 0]), b"\1"):
            self.malformed(kind=NS, dst=0, flags=FLAG_EXT, payload=extensions)

    def test_extensions_of_a_request_are_skipped_and_its_policy_says_nothing(self):
        client = Client(self, self.hub).join("robot")
        extensions = bytes([0, 3]) + bytes(3) + bytes([77, 1, 1])
        for kind, operation in ((NS, 3), (CTRL, 1)):
            for flags in (0, BLOCK, DROP, LATEST, FLAG_REPORT):
                with self.subTest(kind=kind, flags=flags):
                    before = struct.pack("<H", len(extensions)) + extensions
                    client.send(client.frame(0, before + control(operation, text(3, "robot"), request=9), kind=kind,
                                             flags=flags | FLAG_EXT))
                    answer = client.next_where(lambda got: got.kind == kind)
                    self.assertEqual(struct.unpack_from("<HH", answer.payload), (operation | 0x8000, 9))
                    self.assertEqual(answer.fields[1], 0)

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
                self.closed_as("wrong_source", frame(victim.id, source, b"x"))

    def test_half_a_header_or_half_a_frame(self):
        for how, size in (("closed", 1), ("shut down", 15), ("reset", 16), ("closed", 17), ("reset", 4_000)):
            with self.subTest(how=how, size=size):
                client = Client(self, self.hub).join()
                client.send(client.frame(client.id, bytes(50_000))[:size])
                if how == "shut down":
                    client.socket.shutdown(socket.SHUT_WR)
                    self.assertIsNone(client.goodbye(), "an end is not answered")
                elif how == "reset":
                    client.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
                client.socket.close()
                self.expect("unfinished_frames")

    def test_who_ends_between_two_frames_is_no_bad_input(self):
        client = Client(self, self.hub).join()
        client.send(client.frame(client.id, b"whole"))
        client.next_data()
        client.socket.close()

    def test_unknown_extensions_are_carried(self):
        sender, receiver = Client(self, self.hub).join(), Client(self, self.hub).join()
        payload = struct.pack("<HBB3sBB", 7, 250, 3, b"abc", 251, 0) + b"data"
        sender.send(sender.frame(receiver.id, payload, flags=FLAG_EXT))
        self.assertEqual(receiver.next_data().payload, payload)

    def test_fragments_that_overlap_or_never_end_are_for_their_receiver_to_judge(self):
        sender, receiver = Client(self, self.hub).join(), Client(self, self.hub).join()
        cases = [(1, 0, 100, b"first"), (1, 3, 100, b"overlaps"), (1, 0, 100, b"again"), (2, 0, 100, b"never ends")]
        for number, offset, total, data in cases:
            sender.send(sender.frame(receiver.id, struct.pack("<III", number, offset, total) + data, flags=FLAG_FRAGMENT))
        for number, offset, total, data in cases:
            self.assertEqual(receiver.next_data().payload, struct.pack("<III", number, offset, total) + data)

    def test_fragments_that_never_began_are_dropped(self):
        sender, receiver = Client(self, self.hub).join(), Client(self, self.hub).join()
        for offset, data in ((90, b"the end ..."), (20, b"a middle")):
            sender.send(sender.frame(receiver.id, struct.pack("<III", 3, offset, 101) + data, flags=FLAG_FRAGMENT))
            self.expect("dropped.cut_message")
        sender.send(sender.frame(receiver.id, b"whole"))
        self.assertEqual(receiver.next_data().payload, b"whole")

    def test_flow_that_is_unknown_or_too_short(self):
        for payload in (b"", b"\x01", b"\x00" * 16, b"\x0a" + bytes(15), b"\x09" + bytes(14), b"\xff" + bytes(15), b"\x04" + bytes(6),
                        b"\x06" + bytes(14)):
            self.malformed(dst=0, kind=FLOW, payload=payload)

    def test_confirmations_of_what_was_never_sent(self):
        client = Client(self, self.hub).join()
        client.send(client.frame(0, b"\x06" + bytes(7) + b"\xff" * 8, kind=FLOW))
        client.ping()
        client.next_where(lambda got: got.kind == FLOW and got.payload[0] == 2)

    def test_requests_that_cannot_be_read_or_are_not_known(self):
        client = Client(self, self.hub).join()
        for kind, operation, body, status in (
                (NS, 999, b"", "not_supported"), (NS, 32, b"", "not_supported"), (NS, 3, b"\xff", "bad_request"),
                (NS, 3, b"", "bad_request"), (NS, 7, text(3, "a b"), "bad_request"), (CTRL, 999, b"", "not_supported"),
                (CTRL, 3, b"\xff", "bad_request"), (CTRL, 4, number(3, 4, client.id), "denied"), (CTRL, 6, b"", "denied")):
            with self.subTest(kind=kind, operation=operation):
                self.asked(client, kind, operation, body, [status])
                if status == "not_supported":
                    self.expect("names.unknown" if kind == NS else "ctrl.unknown")

    def test_control_frames_without_a_request(self):
        for kind in (NS, CTRL):
            for size in range(4):
                client = Client(self, self.hub).join()
                client.send(client.frame(0, bytes(size), kind=kind))
                self.assertEqual(client.goodbye(), "malformed")
                self.expect("malformed")

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
                    if self.asked(client, NS, operation, body, STATUSES) != "bad_request":
                        self.assertEqual(name, "10,000 keys", "the first of repeated keys counts")
            for operation in (3, 4):
                with self.subTest(bomb=name, administration=operation):
                    self.asked(client, CTRL, operation, body, ["done", "bad_request", "denied"])

    def test_a_request_for_a_hub_that_is_not_there(self):
        client = Client(self, self.hub).join()
        for dst in (8 << 20, client.id, 0xFFFFFFFF):
            client.send(client.frame(dst, control(3, text(3, "robot"), 9), kind=NS))
            answer = client.next_where(lambda got: got.kind == NS)
            self.assertEqual(answer.payload[:4], struct.pack("<HH", 0x8003, 9))
            self.assertIn(b"no route", answer.payload)
            self.expect("names.refused.not_found")

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
        if answers != count:
            self.expect("too_many_requests")

    def test_the_tool_says_what_the_hub_counted(self):
        self.closed_as("malformed", lambda client: client.frame(0, b"", kind=99))
        self.assertIn("ledger:", run_gimnet(self.hub, "status").out.decode())


if __name__ == "__main__":
    unittest.main()
