"""Sections 8 and 9 of docs/protocol.md: names, services, administration."""

import signal
import struct

from stranger_parts.bitestream import F64, TEXT, U16, U8, every, fields, put
from stranger_parts.case import PATIENT, Case
from stranger_parts.client import (CTRL, F_EXT, F_FRAGMENT, F_KEYED, F_REPORT, FLOW, LATEST, LINK, NS, Denied, Refused,
                                   u32)


class Names(Case):
    def test_resolve_reverse_list(self):
        hub = self.hub()
        one, two = self.stranger(hub, "a/one"), self.stranger(hub, "a/two")
        self.assertEqual(one.resolve("a/two"), two.id)
        self.assertEqual(fields(one.ask(NS, 4, u32(3, two.id)))[3], "a/two")
        with self.assertRaises(Denied) as denied:
            one.resolve("a/three")
        self.assertEqual(denied.exception.args[0], 3)
        self.assertIn("a/three", denied.exception.args[1])
        names, after = [], b""
        while True:
            page = one.ask(NS, 5, put(3, TEXT, "a/*") + after + u32(5, 1))
            records = [fields(record) for record in every(page, 3)]
            names += [record[2] for record in records]
            if not fields(page).get(4):
                break
            after = u32(4, fields(page)[5])
        self.assertEqual(names, ["a/one", "a/two"])

    def test_a_service_from_advertise_to_withdraw(self):
        hub = self.hub()
        robot, viewer = self.stranger(hub, "robot"), self.stranger(hub)
        group = robot.advertise("scan", delivery=put(7, U8, 1), metadata=put(8, TEXT, "360 beams"))[3]
        found = [fields(record) for record in every(viewer.ask(NS, 9, put(3, TEXT, "**")), 3)]
        self.assertEqual([(r[1], r[2], r[3], r[7], r[8]) for r in found],
                         [(group, "robot/scan", robot.id, 1, "360 beams")])
        self.assertEqual(viewer.subscribe("robot/scan")[4], group)
        told = robot.event(33)
        self.assertEqual((told[3], told[4]), (group, 1))
        viewer.ask(NS, 11, put(3, TEXT, "robot/scan"))
        told = robot.event(33)
        self.assertEqual((told[3], told[4]), (group, 0))
        robot.ask(NS, 8, u32(3, group))

    def test_a_service_has_another_group_after_its_hub_was_killed(self):
        hub = self.hub(*PATIENT)
        robot = self.stranger(hub, "robot")
        before = robot.advertise("scan")[3]
        hub.process.signal(signal.SIGKILL)
        hub.process.wait()
        hub = hub.again(self)
        other = self.stranger(hub, "other")
        robot = self.stranger(hub, "robot", token=robot.welcome[2])
        groups = [who.advertise(service)[3] for who, service in ((other, "a"), (robot, "scan"), (other, "b"))]
        self.assertEqual(len({before, *groups}), 4, "each id once")
        self.assertEqual(other.subscribe("robot/scan")[4], groups[1])

    def test_a_service_keeps_its_group_while_others_provide_it(self):
        hub = self.hub()
        robot, viewer = self.stranger(hub, "robot"), self.stranger(hub)
        group = robot.advertise("scan")[3]
        first = viewer.subscribe("robot/scan")
        self.assertEqual((first[4], first[5]), (group, robot.id))
        robot.ask(NS, 8, u32(3, group))
        moved = viewer.event(32)
        self.assertEqual((moved[4], moved.get(5, 0)), (group, 0), "nobody provides it")
        self.assertEqual(robot.advertise("scan")[3], group)
        moved = viewer.event(32)
        self.assertEqual((moved[4], moved[5], moved[6]), (group, robot.id, first[6]))
        self.assertNotEqual(robot.advertise("scan", type=u32(4, 8))[3], group, "other terms")

    def test_a_subscriber_is_told_that_a_service_takes_data(self):
        hub = self.hub()
        viewer, robot = self.stranger(hub), self.stranger(hub, "robot")
        self.assertEqual(viewer.subscribe("robot/drive").get(4, 0), 0)
        group = robot.advertise("drive", direction=put(6, U8, 1))[3]
        moved = viewer.event(32)
        self.assertEqual((moved[4], moved[12]), (group, 1))
        answer = viewer.subscribe("robot/drive")
        self.assertEqual((answer[4], answer[12]), (group, 1))
        group = robot.advertise("drive", direction=put(6, U8, 0))[3]
        moved = viewer.event(32)
        self.assertEqual((moved[4], moved.get(12, 0)), (group, 0))
        self.assertNotIn(12, viewer.subscribe("robot/drive"))

    def test_refusals(self):
        hub = self.hub()
        nameless, robot = self.stranger(hub), self.stranger(hub, "robot")
        for who, operation, body, status in ((nameless, 7, put(3, TEXT, "odom"), 2), (robot, 999, b"", 1),
                                             (robot, 3, put(3, U16, 5), 2), (robot, 8, u32(3, 1), 3)):
            with self.assertRaises(Denied) as denied:
                who.ask(NS, operation, body)
            self.assertEqual(denied.exception.args[0], status, denied.exception)
            self.assertTrue(denied.exception.args[1])

    def test_flags_of_a_request(self):
        hub = self.hub()
        robot = self.stranger(hub, "robot")
        request = struct.pack("<HH", 3, 99) + put(3, TEXT, "robot")
        robot.write(NS, 0, struct.pack("<HBBB", 3, 0, 1, 0) + request, flags=F_EXT | F_REPORT | LATEST)
        answer = robot.wait(lambda got: got.kind == NS and got.body[:4] == struct.pack("<HH", 0x8003, 99))
        self.assertEqual(fields(answer.body[4:])[3], robot.id)
        for kind, flag, before in ((NS, F_KEYED, bytes(8)), (CTRL, F_FRAGMENT, struct.pack("<III", 1, 0, len(request))),
                                   (FLOW, F_EXT, bytes(2)), (LINK, F_EXT, bytes(2))):
            refused = self.stranger(hub)
            refused.write(kind, 0, before + request, flags=flag)
            self.assertEqual(self.goodbye(refused), 2)

    def test_limits(self):
        hub = self.hub("--limit", "services_per_node=1", "--limit", "subscriptions_per_node=1", "--limit", "watches_per_node=1")
        robot = self.stranger(hub, "robot")
        for operation, body, another in ((7, put(3, TEXT, "a"), put(3, TEXT, "b")), (10, put(3, TEXT, "r/a"), put(3, TEXT, "r/b")),
                                         (6, u32(3, 1), u32(3, 2))):
            robot.ask(NS, operation, body)
            with self.assertRaises(Denied) as denied:
                robot.ask(NS, operation, another)
            self.assertEqual(denied.exception.args[0], 6)

    def test_terms_of_zero_count_as_absent_and_others_out_of_range_are_bad_requests(self):
        hub = self.hub()
        robot, viewer = self.stranger(hub, "robot"), self.stranger(hub)
        for window, answered in ((0, 1), (1_024, 1_024)):
            robot.advertise("map", delivery=put(7, U8, 2), window=u32(10, window))
            self.assertEqual(viewer.subscribe("robot/map")[10], answered)
        for terms in (u32(4, 0), put(6, F64, 0.0), put(6, F64, 0.001), put(6, F64, 1_000.0), u32(5, 64)):
            self.assertEqual(viewer.subscribe("robot/map", terms)[10], 1_024)
        for terms in (u32(4, 1_025), u32(5, 0), u32(5, 65), put(6, F64, 0.0009), put(6, F64, 1_001.0), put(6, F64, -1.0)):
            with self.assertRaises(Denied) as denied:
                viewer.subscribe("robot/map", terms)
            self.assertEqual(denied.exception.args[0], 2)
        with self.assertRaises(Denied) as denied:
            robot.advertise("other", delivery=put(7, U8, 2), window=u32(10, 1_025))
        self.assertEqual(denied.exception.args[0], 2)

    def test_words_that_are_too_long(self):
        hub = self.hub()
        robot, admin = self.stranger(hub, "robot"), self.administrator(hub)
        for who, kind, operation, begin, key, most in ((admin, CTRL, 4, u32(3, robot.id + 9), 4, 256), (admin, CTRL, 8, b"", 3, 256),
                                                       (robot, NS, 5, b"", 3, 255), (robot, NS, 7, put(3, TEXT, "a"), 8, 4_096)):
            codes = []
            for size in (most, most + 1):
                try:
                    who.ask(kind, operation, begin + put(key, TEXT, "x" * size))
                    codes.append(0)
                except Denied as denied:
                    codes.append(denied.args[0])
            # No node has that id, no level that name: so far it was read.
            self.assertEqual(codes, [{4: 3, 8: 2}.get(operation, 0) if kind == CTRL else 0, 2])

    def test_rates(self):
        hub = self.hub("--limit", "declarations_burst=2", "--limit", "declarations_per_s=1", "--limit", "oddities_burst=2",
                       "--limit", "oddities_per_s=1", "--limit", "services_per_node=0", "--limit", "subscriptions_per_node=0")
        hasty = self.stranger(hub)
        with self.assertRaises(Denied) as denied:
            for number in range(10_000):
                hasty.ask(NS, 1, put(3, TEXT, f"name-{number}"))
        self.assertEqual(denied.exception.args[0], 7)
        with self.assertRaises(Refused) as refused:
            for _ in range(10_000):
                with self.assertRaises(Denied):
                    hasty.ask(NS, 999)
        self.assertEqual(refused.exception.args[0], 18)

    def test_a_name_is_taken_changed_and_given_back(self):
        hub = self.hub()
        one, two = self.stranger(hub), self.stranger(hub)
        answer = fields(one.ask(NS, 1, put(3, TEXT, "robot")))
        self.assertEqual((answer[3], answer.get(4, False)), ("robot", False))
        with self.assertRaises(Denied) as denied:
            two.ask(NS, 1, put(3, TEXT, "robot"))
        self.assertEqual(denied.exception.args[0], 4)
        one.close()
        again = self.stranger(hub, "robot", token=answer[5])
        self.assertEqual((again.id, again.welcome[18]), (one.id, "robot"))
        again.ask(NS, 2)
        self.assertEqual(fields(two.ask(NS, 1, put(3, TEXT, "robot")))[3], "robot")

    def watched(self, who, watch, wanted):
        """(kind, name) of the changes until `wanted` is among them; each WATCH_EVENTS is answered and follows the last."""
        found, version = [], None
        while wanted not in found:
            got = who.wait(lambda frame: frame.kind == NS and frame.body[:4] == struct.pack("<HH", 37, 0)).body[4:]
            events = fields(got)
            self.assertEqual((events[4], events[5]), (watch, 7))
            self.assertIn(events.get(7, 0), (version, events.get(7, 0) if version is None else None))
            version = events.get(8, 0)
            who.ask(NS, 13, u32(3, watch) + u32(4, 1))
            for change in every(got, 3):
                change = fields(change)
                record = fields(change.get(4) or change.get(5) or [])
                found.append((change.get(1, 0), record.get(2, "")))
        return found

    def test_a_watch_from_its_snapshot_to_its_end(self):
        hub = self.hub()
        robot, viewer = self.stranger(hub, "robot"), self.stranger(hub)
        robot.advertise("odom")
        self.assertTrue(fields(viewer.ask(NS, 6, u32(3, 5) + put(4, TEXT, "robot/**") + put(5, U8, 3))).get(3))
        self.assertEqual(self.watched(viewer, 5, (2, "")), [(0, ""), (1, "robot"), (1, "robot/odom"), (2, "")])
        group = robot.advertise("scan")[3]
        self.assertEqual(self.watched(viewer, 5, (9, "robot/scan")), [(9, "robot/scan")])
        robot.ask(NS, 8, u32(3, group))
        self.watched(viewer, 5, (10, "robot/scan"))
        self.stranger(hub, "robot/arm").leave()
        self.assertEqual(self.watched(viewer, 5, (4, "robot/arm")), [(3, "robot/arm"), (4, "robot/arm")])
        viewer.ask(NS, 12, u32(3, 5))


class Administration(Case):
    def test_reading(self):
        hub = self.hub(shards=2, hub_id=5)
        made = self.stranger(hub, "one")
        info = fields(made.ask(CTRL, 1))
        self.assertEqual((info[3], info[6], info[8]), (5, 2, 1))
        shards = [fields(record) for record in every(made.ask(CTRL, 2), 3)]
        self.assertEqual({0, 1} - {record[1] for record in shards}, set())
        self.assertIn("accepted", fields(shards[0][2]))
        records = [fields(record) for record in every(made.ask(CTRL, 3), 3)]
        self.assertEqual([(record[1], record[2], record[4]) for record in records], [(made.id, "one", "tcp")])
        hubs = [fields(record) for record in every(made.ask(CTRL, 9), 3)]
        self.assertEqual([(record[1], record[3], record[4]) for record in hubs], [(5, 5, 0)])
        self.assertEqual([(record[5], record[7], record[8], record[9]) for record in hubs], [(1, 0, True, False)])
        self.assertEqual(every(made.ask(CTRL, 9, put(4, U16, 5)), 3), [])
        self.assertEqual(every(made.ask(CTRL, 10), 3), [])

    def test_changing_is_denied_to_nodes(self):
        made = self.stranger(self.hub(), "one")
        for operation, body in ((4, u32(3, made.id)), (5, u32(3, made.id) + u32(4, made.id + 1)), (6, b""), (7, b""),
                                (8, put(3, TEXT, "debug")), (11, put(3, TEXT, "unix:/a")), (12, put(3, TEXT, "a")),
                                (13, put(3, TEXT, "a"))):
            with self.assertRaises(Denied) as denied:
                made.ask(CTRL, operation, body)
            self.assertEqual(denied.exception.args[0], 5)
            self.assertIn("Unix socket", denied.exception.args[1])

    def test_changing_is_for_administrators(self):
        hub = self.hub()
        one, two = self.stranger(hub, "one"), self.stranger(hub, "two")
        for operation, body in ((4, u32(3, two.id)), (5, u32(3, two.id) + u32(4, 7 << 20 | 500)), (6, b""), (7, b""),
                                (8, put(3, TEXT, "debug")), (11, put(3, TEXT, "unix:/a")), (12, put(3, TEXT, "a")),
                                (13, put(3, TEXT, "a"))):
            with self.assertRaises(Denied) as denied:
                one.ask(CTRL, operation, body)
            self.assertEqual(denied.exception.args[0], 5)
        admin = self.administrator(hub)
        self.assertTrue(fields(admin.ask(CTRL, 8, put(3, TEXT, "warning")))[3])
        admin.ask(CTRL, 7)
        admin.ask(CTRL, 5, u32(3, two.id) + u32(4, 7 << 20 | 500))
        self.assertEqual(self.goodbye(two), 17)
        again = self.stranger(hub, "two", token=two.welcome[2])
        self.assertEqual(again.id, 7 << 20 | 500)
        admin.ask(CTRL, 4, u32(3, one.id) + put(4, TEXT, "enough"))
        self.assertEqual(self.goodbye(one), 15)
        admin.ask(CTRL, 6)
        for who in (again, admin):
            self.assertEqual(self.goodbye(who), 7)
            who.close()
        self.assertEqual(hub.process.wait(), 0, hub.process.err)
