#!/usr/bin/env python3
"""Names across linked hubs: three in a chain, and strangers at its ends."""

import json
import signal
import time
import unittest

from stranger_parts.bitestream import TEXT, U32, U8, every, fields, put
from stranger_parts.case import PATIENT, Case
from stranger_parts.client import NS, UNICAST, Denied, Refused
from support.processes import run_gimnet, start_gimnet
from support.waiting import wait_until


class NetworkNames(Case):
    def setUp(self):
        self.first = self.hub("--accept-links", *PATIENT, hub_id=1)
        middle = self.hub("--accept-links", "--link", self.first.url, *PATIENT, hub_id=2)
        self.last = self.hub("--link", middle.url, *PATIENT, hub_id=3)

    def found(self, who, name):
        """The id of a name, as soon as it is known there."""

        def ask():
            try:
                return who.resolve(name)
            except Denied:
                return None

        return wait_until(ask, f"{name} is known")

    def test_a_node_at_one_end_is_found_and_reached_from_the_other(self):
        robot = self.stranger(self.first, "robot")
        viewer = self.stranger(self.last, "viewer")
        self.assertEqual(self.found(viewer, "robot"), robot.id)
        self.assertEqual(fields(viewer.ask(NS, 4, put(3, U32, robot.id)))[3], "robot")
        viewer.write(UNICAST, robot.id, b"hello")
        got = robot.data()
        self.assertEqual((got.src, got.body), (viewer.id, b"hello"))

    def test_a_new_name_is_known_soon_and_one_that_was_given_back_is_not(self):
        viewer = self.stranger(self.last, "viewer")
        self.found(self.stranger(self.first, "early"), "viewer")
        began = time.monotonic()
        robot = self.stranger(self.first, "robot")
        self.found(viewer, "robot")
        self.assertLess(time.monotonic() - began, 2.0)
        robot.leave()

        def is_gone():
            try:
                viewer.resolve("robot")
            except Denied as denied:
                return denied.args[0] == 3
            return False

        wait_until(is_gone, "robot is gone")

    def test_a_name_that_another_hub_holds_is_refused_with_its_holder(self):
        robot = self.stranger(self.first, "robot")
        viewer = self.stranger(self.last, "viewer")
        self.found(viewer, "robot")
        with self.assertRaises(Refused) as refused:
            self.stranger(self.last, "robot")
        self.assertEqual(refused.exception.args[0], 4)
        self.assertIn(f"node 1.{robot.id & 0xFFFFF} of hub 1", refused.exception.args[1])
        with self.assertRaises(Denied) as denied:
            viewer.ask(NS, 1, put(3, TEXT, "robot"))
        self.assertEqual(denied.exception.args[0], 4)

    def test_lists_and_watches_show_all_hubs(self):
        robot = self.stranger(self.first, "robot")
        viewer = self.stranger(self.last, "viewer")
        self.found(viewer, "robot")
        nodes = [fields(node) for node in every(viewer.ask(NS, 5), 3)]
        self.assertEqual([(node[1], node[2], node[3]) for node in nodes],
                         [(robot.id, "robot", 1), (viewer.id, "viewer", 3)])
        viewer.ask(NS, 6, put(3, U32, 1) + put(5, U8, 2))
        group = robot.advertise("scan")[3]
        seen = []
        while (group, "robot/scan") not in seen:
            events = viewer.wait(lambda got: got.kind == NS and got.body[:4] == b"\x25\0\0\0").body[4:]
            viewer.ask(NS, 13, put(3, U32, 1) + put(4, U32, 1))
            for change in every(events, 3):
                service = fields(fields(change).get(5) or [])
                seen.append((service.get(1), service.get(2)))
        services = [fields(service) for service in every(viewer.ask(NS, 9), 3)]
        self.assertEqual([(service[1], service[2], service[3]) for service in services], [(group, "robot/scan", robot.id)])


class Moves(Case):
    """Two linked hubs, and a node that goes from one to the other."""

    def setUp(self):
        self.first = self.hub("--accept-links", *PATIENT, hub_id=1)
        self.second = self.hub("--link", self.first.url, *PATIENT, hub_id=2)
        self.viewer = self.stranger(self.second, "viewer")

    def robot(self):
        robot = self.stranger(self.first, "robot")
        wait_until(lambda: self.is_held_by(robot.id), "the robot is known")
        return robot

    def holder(self, asker=None, name="robot"):
        """By what the hub of the asker knows, the second one; None: nobody."""
        try:
            return (asker or self.viewer).resolve(name)
        except Denied:
            return None

    def is_held_by(self, node):
        return self.holder() == node

    def link(self, what):
        """Adds or removes the link, and waits until the first hub has seen it."""
        done = run_gimnet(f"unix:{self.second.socket_path}", "ctl", "link", what, self.first.url)
        self.assertEqual(done.code, 0, done.err)
        seen = [2] if what == "add" else []

        def reached():
            hubs = json.loads(run_gimnet(self.first, "hubs", "--json").out or "[]")
            return [each["id"] for each in hubs if each["reachable"] and each["id"] != 1]

        wait_until(lambda: reached() == seen, f"link {what} is seen")

    def come(self, robot, token=None):
        """The robot at the second hub."""
        return self.stranger(self.second, "robot", token=token or robot.welcome[2], extra=put(13, U32, robot.id))

    def test_a_node_that_shows_its_token_has_its_name_at_once(self):
        robot = self.robot()
        moved = self.come(robot)
        self.assertEqual((moved.id >> 20, moved.welcome[18]), (2, "robot"))
        self.assertTrue(self.is_held_by(moved.id))
        self.assertEqual(self.goodbye(robot), 8)  # replaced
        watcher = self.stranger(self.first, "watcher")
        wait_until(lambda: self.holder(watcher) == moved.id, "the first hub knows it")
        with self.assertRaises(Refused) as refused:
            self.stranger(self.first, "robot", token=robot.welcome[2])
        self.assertEqual(refused.exception.args[0], 4, "the former token counts as none")
        back = self.stranger(self.first, "robot", token=moved.welcome[2], extra=put(13, U32, moved.id))
        self.assertEqual(back.id >> 20, 1)
        wait_until(lambda: self.is_held_by(back.id), "it is back")

    def test_a_wrong_token_moves_nobody(self):
        robot = self.robot()
        with self.assertRaises(Refused) as refused:
            self.come(robot, token=bytes(56))
        self.assertEqual(refused.exception.args[0], 4)
        self.assertTrue(self.is_held_by(robot.id))

    def test_a_node_whose_hub_was_killed_has_its_name_before_the_grace_time(self):
        robot = self.robot()
        self.first.process.signal(signal.SIGKILL)
        self.first.process.wait()
        with self.assertRaises(Refused):
            self.stranger(self.second, "robot")  # the name is unreachable, or not yet
        moved = self.come(robot)
        self.assertTrue(self.is_held_by(moved.id))

    def test_a_former_id_gives_a_name_only_until_the_hubs_talk_again(self):
        """And not if the node there is away by then: it may be the one that came."""
        for is_away in (False, True):
            name = f"robot/{is_away}"
            robot = self.stranger(self.second, name)
            watcher = self.stranger(self.first, "watcher")
            wait_until(lambda: self.holder(watcher, name) == robot.id, "the robot is known")
            self.link("remove")
            came = self.stranger(self.first, name, token=bytes(56), extra=put(13, U32, robot.id))
            self.assertEqual(self.holder(watcher, name), came.id)
            if is_away:
                robot.close()
                self.until_away(self.viewer, name)
            self.link("add")
            if is_away:
                wait_until(lambda: self.holder(self.viewer, name) == came.id, "it has moved")
                self.assertEqual(fields(watcher.ask(NS, 4, put(3, U32, came.id)))[3], name)
            else:
                lost = came.wait(lambda got: got.kind == NS and got.body[:4] == b"\x24\0\0\0")
                self.assertEqual(fields(lost.body[4:])[4], robot.id)
                for words in ("has the name, since its claim has rank 65536, and the one of this hub 65535",
                              "that hub is reached over the link to hub 2"):
                    wait_until(lambda words=words: words in self.first.process.err, f"a line with {words}")
                self.assertEqual(self.holder(watcher, name), robot.id)
                self.assertEqual(fields(self.viewer.ask(NS, 4, put(3, U32, robot.id)))[3], name)
            watcher.leave()

    def test_a_program_that_knows_both_hubs_goes_on_at_the_other_one(self):
        both = f"{self.first.url},{self.second.url}"
        receiver = start_gimnet(self, both, "recv", "--name", "robot", "--raw", "-n", "2")
        held = self.first.wait_for_node("robot")
        wait_until(self.holder, "the second hub knows it")
        sent = run_gimnet(self.second, "send", "robot", data=b"one\n")
        self.assertEqual(sent.code, 0, sent.err)
        self.first.process.signal(signal.SIGKILL)
        self.first.process.wait()

        def is_back():
            found = [node for node in self.second.nodes() if node["name"] == "robot" and node["connected"]]
            return found and found[0]["id"] != held["id"]

        wait_until(is_back, "the robot at the second hub")
        self.first = self.first.again(self)
        wait_until(lambda: run_gimnet(self.second, "status", "--hub-id", "1").code == 0, "the first hub again")
        for hub in (self.first, self.second):
            wait_until(lambda hub=hub: [node["hub_id"] for node in hub.nodes() if node["name"] == "robot"] == [2],
                       "the robot once, and not where it was, before the grace time", 20)
        sent = run_gimnet(f"tcp://127.0.0.1:1,{self.second.url}", "send", "robot", data=b"two\n")
        self.assertEqual(sent.code, 0, sent.err)
        self.assertEqual((receiver.wait(), receiver.out), (0, b"one\ntwo\n"), receiver.err)


class Losers(Case):
    def test_a_program_ends_if_its_name_went_to_another_hubs_node(self):
        first, second = self.hub("--accept-links", *PATIENT, hub_id=1), self.hub(*PATIENT, hub_id=2)
        keeps, loses = (start_gimnet(self, hub, "recv", "--name", "robot", "-n", "1") for hub in (first, second))
        for hub in (first, second):
            hub.wait_for_node("robot")
        added = run_gimnet(f"unix:{second.socket_path}", "ctl", "link", "add", first.url)
        self.assertEqual(added.code, 0, added.err)
        self.assertEqual(loses.wait(), 3)
        self.assertIn("has the name, since its id is the lower one", loses.err)
        self.assertIn("connect under another name", loses.err)
        sent = run_gimnet(second, "send", "robot", data=b"one\n")
        self.assertEqual((sent.code, keeps.wait()), (0, 0), sent.err + keeps.err)


if __name__ == "__main__":
    unittest.main()
