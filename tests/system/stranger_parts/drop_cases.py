"""Section 5 of docs/protocol.md: why the hub drops a frame, as its sender is told."""

import struct

from stranger_parts import client as wire
from stranger_parts.bitestream import BOOL, U8, every, fields, put
from stranger_parts.case import PATIENT, Case
from stranger_parts.client import CTRL, F_FRAGMENT, F_KEYED, F_REPORT, GROUP, LIST, REPORT, UNICAST, u32
from support.waiting import wait_until

BULK = bytes(60_000)


def until_reported(sender, reason, write):
    """Calls `write` until a REPORT of that reason is there, and returns it."""
    for _ in range(5_000):
        write()
        sender.ping()
        if any(got.kind == REPORT and got.body[0] == reason for got in sender.waiting):
            return sender.report(reason)
    raise AssertionError(f"nothing was dropped for the reason {reason}")


class Drops(Case):
    def pair(self, *arguments, **how):
        hub = self.hub(*PATIENT, "--limit", "slow_consumer_bytes=0", *arguments, **how)
        return self.stranger(hub), self.stranger(hub)

    def test_a_node_that_is_away(self):
        hub = self.hub()
        one, two = self.stranger(hub), self.stranger(hub, "two")
        two.close()
        self.until_away(one, "two")
        one.write(UNICAST, two.id, b"x", flags=F_REPORT)
        self.assertEqual(one.report()[0], 3)

    def test_a_full_queue_a_message_that_was_cut_and_a_connection_that_closes(self):
        one, slow = self.pair()
        until_reported(one, 4, lambda: one.write(UNICAST, slow.id, BULK, flags=wire.DROP | F_REPORT))
        for offset in (0, 60_000):
            one.write(UNICAST, slow.id, struct.pack("<III", 9, offset, 120_000) + BULK, flags=wire.DROP | F_FRAGMENT | F_REPORT)
        self.assertEqual(one.report(17)[1], 1)
        slow.close()
        self.assertGreater(one.report(11)[1], 0)

    def test_a_newer_one_of_the_stream(self):
        one, slow = self.pair()
        key = struct.pack("<II", 5, 0)
        until_reported(one, 5, lambda: one.write(UNICAST, slow.id, key + BULK, flags=wire.LATEST | F_KEYED | F_REPORT))

    def test_one_that_is_larger_than_the_recipient_takes(self):
        hub = self.hub()
        one, small = self.stranger(hub), self.stranger(hub, frame_bytes=1_000)
        for size in (1_000, 1_001):
            one.write(UNICAST, small.id, bytes(size), flags=F_REPORT)
        self.assertEqual(one.report()[:2], (8, 1))
        self.assertEqual(len(small.data().body), 1_000)

    def test_a_group_that_is_not_the_senders(self):
        hub = self.hub()
        robot, other = self.stranger(hub, "robot"), self.stranger(hub)
        group = robot.advertise("odom")[3]
        other.write(GROUP, group, b"x", flags=F_REPORT)
        self.assertEqual(other.report()[0], 9)

    def test_a_group_without_subscribers(self):
        robot = self.stranger(self.hub(), "robot")
        group = robot.advertise("odom", direction=put(6, U8, 0))[3]
        robot.write(GROUP, group, b"x", flags=F_REPORT)
        self.assertEqual(robot.report()[0], 18)

    def test_a_last_message_that_is_not_kept(self):
        hub = self.hub("--limit", "retained_message_bytes=100")
        robot, viewer = self.stranger(hub, "robot"), self.stranger(hub)
        self.assertEqual(robot.welcome[19], 100)
        group = robot.advertise("map", retain=put(11, BOOL, True))[3]
        robot.write(GROUP, group, bytes(100))
        robot.write(GROUP, group, bytes(101))
        reason, count, header = robot.report()
        self.assertEqual((reason, count, header[4:8]), (21, 1, struct.pack("<I", group)))
        viewer.subscribe("robot/map")
        robot.write(GROUP, group, b"new")
        self.assertEqual(viewer.data().body, b"new", "nor is an older one kept")

    def test_a_former_id(self):
        hub = self.hub()
        one, two, admin = self.stranger(hub), self.stranger(hub, "two"), self.administrator(hub)
        admin.ask(CTRL, 5, u32(3, two.id) + u32(4, 7 << 20 | 500))
        self.goodbye(two)
        one.write(UNICAST, two.id, b"x", flags=F_REPORT)
        self.assertEqual(one.report()[0], 14)

    def test_no_memory_left_for_what_waits(self):
        one, slow = self.pair("--limit", "budget_bytes=4194304", "--limit", "lane1_bytes=1073741824")
        until_reported(one, 15, lambda: one.write(UNICAST, slow.id, BULK, flags=wire.DROP | F_REPORT))

    def test_a_recipient_that_takes_nothing(self):
        one, slow = self.pair("--limit", "block_ms=100")
        until_reported(one, 16, lambda: one.write(UNICAST, slow.id, BULK, flags=wire.BLOCK | F_REPORT))

    def test_what_ends_its_connection_is_counted(self):
        hub = self.hub()
        witness = self.stranger(hub)
        for name, reason, ids, source in (("malformed", 19, (5, 4), 0), ("wrong_source", 20, (4, 5), 1)):
            made = self.stranger(hub)
            made.write(LIST, 2, struct.pack("<2I", *ids) + b"x", src=made.id + source)
            self.goodbye(made)
            wait_until(lambda name=name: self.counted(witness, f"dropped.{name}"), f"the frame is counted as {name}")
            wire.seen.add(("reason", reason))

    @staticmethod
    def counted(who, counter):
        return sum(fields(fields(record)[2]).get(counter, 0) for record in every(who.ask(CTRL, 2), 3))
