"""Sections 2 and 4 to 7 of docs/protocol.md: data, its flow, and GIMI messages."""

import random
import struct
import time

from stranger_parts import client as wire
from stranger_parts.bitestream import BOOL, TEXT, U8, every, fields, put
from stranger_parts.case import Case
from stranger_parts.client import BROADCAST, FLOW, GROUP, LIST, NS, SERVICE, TAKEN, UNICAST, u32
from support.processes import start_recv
from support.waiting import wait_until


class Data(Case):
    def test_each_way_of_addressing(self):
        hub = self.hub(shards=2)
        one, two, three = (self.stranger(hub, name) for name in ("one", "two", "three"))
        one.write(UNICAST, two.id, b"hi")
        got = two.data()
        self.assertEqual((got.kind, got.dst, got.src, got.lane, got.body), (UNICAST, two.id, one.id, 1, b"hi"))
        ids = sorted((two.id, three.id))
        one.write(LIST, 2, struct.pack("<2I", *ids) + b"both", lane=0)
        for receiver in (two, three):
            got = receiver.data()
            self.assertEqual((got.kind, got.dst, got.body, got.lane), (LIST, 0, b"both", 0))
        one.write(BROADCAST, 7 << 20 | wire.EVERY_NODE, b"all")
        self.assertEqual([receiver.data().body for receiver in (two, three)], [b"all", b"all"])
        one.write(9, two.id, b"not known yet")
        self.assertEqual((two.data().kind), 9)

    def test_group_and_service(self):
        hub = self.hub()
        provider, subscriber = self.stranger(hub, "robot"), self.stranger(hub)
        self.assertEqual(subscriber.subscribe("robot/odom").get(4, 0), 0, "there is no such service yet")
        group = provider.advertise("odom", type=u32(4, 17), instance=u32(5, 3))[3]
        moved = subscriber.event(32)
        self.assertEqual((moved[3], moved[4], moved[5], moved[7], moved[8]), ("robot/odom", group, provider.id, 17, 3))
        provider.write(GROUP, group, b"pose")
        self.assertEqual(subscriber.data(GROUP).body, b"pose")
        commands = provider.advertise("drive", direction=put(6, U8, 1))[3]
        subscriber.write(SERVICE, commands, b"go")
        self.assertEqual(provider.data(SERVICE).body, b"go")
        subscriber.write(SERVICE, group, b"go", flags=wire.F_REPORT)
        self.assertEqual(subscriber.report()[0], 9, "it gives data and takes none")
        provider.ask(NS, 8, u32(3, group))
        self.assertEqual(subscriber.event(32).get(5, 0), 0)

    def test_a_window_and_its_credit(self):
        hub = self.hub()
        robot, viewer = self.stranger(hub, "robot"), self.stranger(hub)
        group = robot.advertise("map", delivery=put(7, U8, 2), window=u32(10, 2), retain=put(11, BOOL, True))[3]
        answer = viewer.subscribe("robot/map", u32(5, 1) + put(7, U8, 5))
        self.assertEqual((answer[3], answer[9], answer[10], answer[11]), (5, 2, 2, True))
        for number in range(9):
            robot.write(GROUP, group, bytes([number]))
        robot.ping()
        self.assertEqual([viewer.data(GROUP).body for _ in range(2)], [b"\0", b"\1"])
        viewer.flow(wire.CREDIT, struct.pack("<IQ", group, 2), number=5)
        self.assertEqual(viewer.data(GROUP).body, b"\x08", "the newest of those that waited")
        self.assertEqual(viewer.welcome[7] & 1, 1, "the hub takes MISSED")
        viewer.flow(wire.MISSED, struct.pack("<IQ", group, 6))
        viewer.ping()

        def missed():
            service = fields(every(robot.ask(NS, 9, put(3, TEXT, "robot/map")), 3)[0])
            return service.get(13), service.get(14)
        wait_until(lambda: missed() == (6, viewer.id), "the hub to know what was missed")
        late = self.stranger(hub)
        late.subscribe("robot/map")
        self.assertEqual(late.data(GROUP).body, b"\x08", "the last one is kept")

    def test_extensions_and_keys_are_carried(self):
        hub = self.hub()
        one, two = self.stranger(hub), self.stranger(hub)
        trace = struct.pack("<BB", 1, 28) + struct.pack("<B3x", 0) + bytes(24)
        # A second ago: the hub would write its own time into an origin that is in the future by its clock.
        age = struct.pack("<BBqI", 2, 12, time.time_ns() - 1_000_000_000, 3_600_000)
        unknown = b"\xc8\x02hi"
        extensions = trace + age + unknown
        body = struct.pack("<H", len(extensions)) + extensions + struct.pack("<II", 5, 6) + b"data"
        one.write(UNICAST, two.id, body, flags=wire.F_EXT | wire.F_KEYED)
        got = two.data()
        used, hub_id, arrival, departure = struct.unpack_from("<B3xI4xqq", got.body, 4)
        self.assertEqual((used, hub_id), (1, 7))
        self.assertLessEqual(arrival, departure)
        self.assertEqual(got.body[2 + len(trace):], age + unknown + struct.pack("<II", 5, 6) + b"data")

    def test_a_message_of_many_fragments_and_its_progress(self):
        hub = self.hub(shards=2)
        one, two = self.stranger(hub), self.stranger(hub)
        message = random.Random(1).randbytes(3 << 20)
        sent = taken = 0
        allowed, parts = 1 << 20, bytearray()
        while taken < len(message):
            while sent < min(allowed, len(message)):
                part = message[sent:sent + 8000]
                one.write(UNICAST, two.id, struct.pack("<III", 5, sent, len(message)) + part, flags=wire.F_FRAGMENT)
                sent += len(part)
            while taken < min(sent, len(message)):
                got = two.data()
                number, offset, total = struct.unpack_from("<III", got.body)
                self.assertEqual((number, offset, total), (5, taken, len(message)))
                parts += got.body[12:]
                taken = len(parts)
            two.write(TAKEN, one.id, struct.pack("<III", 5, taken, taken + (1 << 20)), lane=0)
            number, confirmed, allowed = struct.unpack("<III", one.data(TAKEN).body)
            self.assertEqual((number, confirmed), (5, taken))
        self.assertEqual(bytes(parts), message)

    def test_what_cannot_be_delivered_is_reported(self):
        hub = self.hub()
        one = self.stranger(hub)
        one.write(UNICAST, 7 << 20 | 999, b"x", flags=wire.F_REPORT)
        reason, count, header = one.report()
        self.assertEqual((reason, count, header[4:8]), (1, 1, struct.pack("<I", 7 << 20 | 999)))
        one.write(GROUP, 7 << 20 | 999, b"x", flags=wire.F_REPORT)
        self.assertEqual(one.report()[0], 13)
        one.write(UNICAST, 8 << 20 | 1, b"x", flags=wire.F_REPORT)
        self.assertEqual(one.report()[0], 2)
        two = self.stranger(hub)
        old = struct.pack("<HBBqI", 14, 2, 12, time.time_ns() - 10**10, 1000)
        one.write(UNICAST, two.id, old + b"x", flags=wire.F_REPORT | wire.F_EXT)
        self.assertEqual(one.report()[0], 6)


class Flow(Case):
    def test_pause_resume_at_a_receiver_that_does_not_read(self):
        hub = self.hub()
        slow, fast = self.stranger(hub), self.stranger(hub)
        fast.socket.settimeout(0.02)
        sent = 0
        paused = None
        while paused is None and sent < 1000:
            fast.write(UNICAST, slow.id, bytes(60000), flags=wire.BLOCK)
            slow.flow(wire.PING, bytes(12))
            sent += 1
            try:
                paused = fast.wait(lambda got: got.kind == FLOW and got.body[0] == wire.PAUSE)
            except TimeoutError:
                continue
        self.assertIsNotNone(paused)
        self.assertEqual(struct.unpack("<BBxI", paused.body[1:]), (UNICAST, 1, slow.id))
        fast.socket.settimeout(20)
        for _ in range(sent):
            slow.data()
        resumed = fast.wait(lambda got: got.kind == FLOW and got.body[0] == wire.RESUME)
        self.assertEqual(resumed.body[1:], paused.body[1:])

    def test_who_is_flooded_hears_what_was_dropped_and_who_filled_the_queue(self):
        hub = self.hub("--limit", "lane1_bytes=65536")
        slow, flood = self.stranger(hub), self.stranger(hub)
        sent = 300
        for _ in range(sent):
            flood.write(UNICAST, slow.id, bytes(60000), flags=wire.DROP)
        flood.write(UNICAST, flood.id, b"all came", flags=wire.DROP)
        flood.data()
        dropped = slow.wait(lambda got: got.kind == FLOW and got.body[0] == wire.DROPPED)
        reason, source, count = struct.unpack_from("<BxxIQ", dropped.body, 1)
        self.assertEqual((reason, source), (4, flood.id))
        self.assertLess(0, count)
        self.assertLess(count, sent)

    def test_a_connection_is_resumed_without_loss(self):
        hub = self.hub()
        sender = self.stranger(hub)
        first = self.stranger(hub, "robot", resume=True, epoch=77)
        sender.write(UNICAST, first.id, b"1")
        self.assertEqual(first.data().body, b"1")
        first.flow(wire.CONFIRM, bytes(4) + struct.pack("<Q", first.taken))
        first.close()
        for text in (b"2", b"3"):
            sender.write(UNICAST, first.id, text)
        again = self.stranger(hub, token=first.welcome[2], resume=True, epoch=77, hub_epoch=first.welcome[5],
                              taken=first.taken)
        self.assertTrue(again.welcome[11])
        self.assertEqual([again.data().body for _ in range(2)], [b"2", b"3"])

    def test_what_is_not_sent_again_is_announced(self):
        hub = self.hub("--limit", "resume_bytes=65536")
        sender = self.stranger(hub)
        first = self.stranger(hub, "robot", resume=True, epoch=78)
        for _ in range(40):
            sender.write(UNICAST, first.id, bytes(4000), flags=wire.DROP)
            first.data()
        first.close()
        again = self.stranger(hub, token=first.welcome[2], resume=True, epoch=78, hub_epoch=first.welcome[5], taken=0)
        skip = again.wait(lambda got: got.kind == FLOW and got.body[0] == wire.SKIP)
        skipped = struct.unpack_from("<Q", skip.body, 8)[0]
        self.assertGreater(skipped, 0)
        self.assertLess(skipped, 40)
        for _ in range(40 - skipped):
            again.data()


class Gimi(Case):
    def test_a_message_its_ack_and_a_ping(self):
        hub = self.hub()
        recv = start_recv(self, hub, "B", "-n", "1")
        made = self.stranger(hub)
        to = made.resolve("B")
        key = struct.pack("<II", 0, 0)
        stamp = struct.pack("<q", time.time_ns())
        made.write(UNICAST, to, key + struct.pack("<IIBBH", 1, 8, 5, 0, 0) + stamp + b"echo", flags=wire.F_KEYED)
        pong = made.data()
        self.assertEqual(pong.body[8:], struct.pack("<IIBBH", 1, 8, 6, 0, 0) + stamp + b"echo")
        made.write(UNICAST, to, key + struct.pack("<IIBBH", 1, 1, 0, 1 | 2, 8) + stamp + b"hello", flags=wire.F_KEYED)
        ack = made.data()
        self.assertEqual(struct.unpack("<IIBBHQI", ack.body[8:]), (1, 1, 1, 0, 0, 0, 0))
        self.assertEqual((recv.wait(), recv.out), (0, b"hello\n"))
