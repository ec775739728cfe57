"""docs/protocol.md, section 10: the side of a hub that links to another one."""

import struct

from stranger_parts.bitestream import OPAQUE, TEXT, U16, U64, put
from stranger_parts.case import Case
from stranger_parts.client import UNICAST, Refused

ROUTE = 19
RECORDS_END = 2
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

    def test_a_hub_id_that_is_taken(self):
        with self.assertRaises(Refused) as refused:
            self.link(hub_id=7)
        self.assertEqual(refused.exception.args[0], ID_TAKEN)

    def test_a_copy_of_the_hub(self):
        known = self.link()
        with self.assertRaises(Refused) as refused:
            self.link(unique=known.welcome[21])
        self.assertEqual(refused.exception.args[0], COPIED)
