"""docs/protocol.md, section 10: the side of a hub that links to another one."""

import struct
import unittest

from stranger_parts.bitestream import BOOL, OPAQUE, TEXT, U16, U64, fields, put
from stranger_parts.case import Case
from stranger_parts.client import GROUP, UNICAST, Refused

ROUTE = 19
RECORDS_END, JOIN, LEAVE, JOINS_END, JOINED = 2, 7, 8, 9, 10
ID_TAKEN, COPIED = 19, 20
OWN_HUB = 9


class Links(Case):
    def setUp(self):
        self.to = self.hub("--accept-links", hub_id=7)

    def link(self, hub_id=OWN_HUB, unique=b"u" * 16):
        """A connection over which this test is a hub."""
        introduction = (put(20, U16, hub_id) + put(21, OPAQUE, unique) + put(22, U64, 4711) +
                        put(26, TEXT, "stranger"))
        return self.connected(self.to).join(role=1, extra=introduction)

    def test_a_frame_crosses_the_link_both_ways(self):
        robot = self.stranger(self.to, "robot")
        link = self.link()
        self.assertEqual(link.welcome[20], 7)
        self.assertEqual(link.id, OWN_HUB << 20)
        link.write(ROUTE, body=struct.pack("<HH", RECORDS_END, 0))
        link.write(UNICAST, robot.id, b"from afar", src=OWN_HUB << 20 | 5)
        got = robot.data()
        self.assertEqual((got.body, got.src, got.hops), (b"from afar", OWN_HUB << 20 | 5, 1))

    def test_a_frame_of_the_hub_itself_is_dropped_and_the_link_stays(self):
        robot = self.stranger(self.to, "robot")
        link = self.link()
        link.write(UNICAST, robot.id, b"a lie", src=robot.id)
        link.write(UNICAST, robot.id, b"the truth", src=OWN_HUB << 20 | 5)
        self.assertEqual(robot.data().body, b"the truth")

    @unittest.expectedFailure
    def test_a_hub_that_speaks_as_another_one(self):
        """The known gap: a link may speak for every hub but the reader's own until identities travel, or `allow` is set."""
        robot = self.stranger(self.to, "robot")
        link = self.link()
        self.route(link, RECORDS_END)
        link.write(UNICAST, robot.id, b"a lie", src=(OWN_HUB + 1) << 20 | 5)
        link.write(UNICAST, robot.id, b"the truth", src=OWN_HUB << 20 | 5)
        self.assertEqual(robot.data().body, b"the truth")

    def test_a_hub_id_that_is_taken(self):
        with self.assertRaises(Refused) as refused:
            self.link(hub_id=7)
        self.assertEqual(refused.exception.args[0], ID_TAKEN)

    def test_a_copy_of_the_hub(self):
        known = self.link()
        with self.assertRaises(Refused) as refused:
            self.link(unique=known.welcome[21])
        self.assertEqual(refused.exception.args[0], COPIED)

    def route(self, link, operation, body=b""):
        link.write(ROUTE, body=struct.pack("<HH", operation, 0) + body)

    def joined(self, link, group, subscribers=b""):
        """Joins, and waits for the answer."""
        self.route(link, JOIN, put(1, OPAQUE, struct.pack("<III", group, 0, 1)) + put(2, BOOL, True) + subscribers)
        head = struct.pack("<HH", JOINED, 0)
        got = link.wait(lambda frame: frame.kind == ROUTE and frame.body[:4] == head)
        self.assertEqual(fields(got.body[4:])[1], struct.pack("<I", group))

    def test_a_hub_joins_a_group_and_carries_its_messages(self):
        robot = self.stranger(self.to, "robot")
        group = robot.advertise("scan", retain=put(11, BOOL, True))[3]
        robot.write(GROUP, group, b"kept")
        link = self.link()
        self.route(link, RECORDS_END)
        self.joined(link, group)
        self.assertEqual((link.data().body, robot.event(33)[4]), (b"kept", 1))
        robot.write(GROUP, group, b"scan")
        got = link.data()
        self.assertEqual((got.kind, got.dst, got.src, got.body), (GROUP, group, robot.id, b"scan"))
        self.route(link, LEAVE, put(1, OPAQUE, struct.pack("<I", group)))
        self.assertEqual(robot.event(33)[4], 0)
        self.route(link, JOINS_END)

    def test_a_provider_counts_the_subscribers_that_a_hub_says(self):
        robot = self.stranger(self.to, "robot")
        group = robot.advertise("scan")[3]
        link = self.link()
        self.route(link, RECORDS_END)
        self.joined(link, group, put(3, OPAQUE, struct.pack("<I", 40)))
        self.assertEqual(robot.event(33)[4], 40)
        self.stranger(self.to, "viewer").subscribe("robot/scan")
        self.assertEqual(robot.event(33)[4], 41)
        join = put(1, OPAQUE, struct.pack("<III", group, 0, 1))
        for wrong in (b"\0" * 4, b"\1" * 3, b"\1" * 8):
            self.route(link, JOIN, join + put(3, OPAQUE, wrong))
        self.route(link, JOIN, join + put(3, OPAQUE, struct.pack("<I", 0xFFFFFFFF)))
        self.assertEqual(robot.event(33)[4], 0xFFFFFFFF, "of a liar, and no more than a number can be")
        self.joined(link, group)
        self.assertEqual(robot.event(33)[4], 2, "a hub that says nothing has one")

    def test_lies_about_groups_cost_others_nothing(self):
        robot = self.stranger(self.to, "robot")
        group = robot.advertise("scan")[3]
        viewer = self.stranger(self.to, "viewer")
        viewer.subscribe("robot/scan")
        link = self.link()
        self.route(link, RECORDS_END)
        for first in range(0, 70_000, 500):
            entries = b"".join(struct.pack("<III", 7 << 20 | index % 0xFFFFE + 1, 0, 1)
                               for index in range(first + 1000, first + 1500))
            self.route(link, JOIN, put(1, OPAQUE, entries))
        self.route(link, JOIN, b"\0\1\0\0\3abc")
        # A message as if it came from the provider, and one of a group that nobody wants.
        link.write(GROUP, group, b"a lie", src=OWN_HUB << 20 | 5)
        link.write(GROUP, OWN_HUB << 20 | 5, b"nobody's", src=OWN_HUB << 20 | 5)
        link.write(UNICAST, viewer.id, b"behind them", src=OWN_HUB << 20 | 5)
        self.assertEqual(viewer.data().body, b"behind them")
        robot.write(GROUP, group, b"the truth")
        self.assertEqual(viewer.data().body, b"the truth")
