#!/usr/bin/env python3
"""Services across linked hubs: a provider at one end of a chain of three, subscribers at the others."""

import json
import pathlib
import struct
import tempfile
import unittest

from stranger_parts.bitestream import BOOL, F64, TEXT, U32, every, fields, put
from stranger_parts.case import PATIENT, Case
from stranger_parts.client import BROADCAST, CTRL, GROUP, LIST, MISSED, NS, UNICAST
from support.processes import run_gimnet
from support.waiting import wait_until

UNSUBSCRIBE, SERVICE_MOVED, SUBSCRIBERS = 11, 32, 33
EVERYBODY = 0xFFFFFFFF


class Chain(Case):
    """Hub 1 - hub 2 - hub 3."""

    def setUp(self):
        self.first = self.hub("--accept-links", *PATIENT, hub_id=1)
        self.middle = self.hub("--accept-links", "--link", self.first.url, *PATIENT, hub_id=2)
        self.last = self.hub("--link", self.middle.url, *PATIENT, hub_id=3)
        self.robot = self.stranger(self.first, "robot")

    def known(self, who, name, provided=True):
        """Waits until that hub has heard of the service."""
        def ask():
            return any(fields(service)[2] == name for service in every(who.ask(NS, 9), 3))
        wait_until(lambda: ask() == provided, f"{name} is known")

    def viewer(self, hub, name, service="robot/scan", more=b""):
        made = self.stranger(hub, name)
        self.known(made, service)
        made.state = made.subscribe(service, more)
        return made

    def publish(self, group, body, **how):
        self.robot.write(GROUP, group, body, **how)

    def until_subscribed(self, group, count=1):
        """The provider has heard of so many subscribers."""
        heard = {}
        while (heard.get(3), heard.get(4)) != (group, count):
            heard = self.robot.event(SUBSCRIBERS)

    def links(self, hub):
        return {link["hub"]: link for link in json.loads(run_gimnet(hub, "links", "--json").out)}

    def exact(self):
        def all_exact():
            return json.loads(run_gimnet(self.first, "status", "--all", "--json").out)["exact"]
        wait_until(all_exact, "the ledgers agree")


class Groups(Chain):
    def test_messages_reach_subscribers_at_all_hubs_once(self):
        group = self.robot.advertise("scan")[3]
        viewers = [self.viewer(self.last, "a"), self.viewer(self.last, "b"), self.viewer(self.middle, "c"),
                   self.viewer(self.first, "d")]
        self.assertEqual([viewer.state[4] for viewer in viewers], [group] * 4)
        self.assertEqual([viewer.state[5] for viewer in viewers], [self.robot.id] * 4)
        for number in range(5):
            self.publish(group, bytes([number]))
        for viewer in viewers:
            got = [viewer.data(GROUP) for _ in range(5)]
            self.assertEqual([each.body for each in got], [bytes([number]) for number in range(5)])
            self.assertEqual({(each.src, each.dst) for each in got}, {(self.robot.id, group)})
        self.assertEqual(viewers[0].taken, 5)
        self.exact()

    def services(self, hub):
        shown = run_gimnet(hub, "services", "--json")
        self.assertEqual((shown.code, shown.err), (0, ""))
        return json.loads(shown.out)

    def test_the_provider_counts_the_subscribers_at_all_hubs(self):
        group = self.robot.advertise("scan")[3]
        viewers = [self.viewer(self.last, name) for name in "ab"]
        self.viewer(self.middle, "c")
        self.stranger(self.first, "d").subscribe("robot/scan")
        self.until_subscribed(group, 4)
        self.assertEqual([self.services(hub)[0]["subscribers"] for hub in (self.first, self.last)], [4, 4])
        viewers[0].ask(NS, UNSUBSCRIBE, put(3, TEXT, "robot/scan"))
        self.until_subscribed(group, 3)
        viewers[1].ask(NS, UNSUBSCRIBE, put(3, TEXT, "robot/scan"))
        self.until_subscribed(group, 2)

    def test_services_shows_what_subscribers_of_all_hubs_missed(self):
        group = self.robot.advertise("scan")[3]
        near, far, most = self.viewer(self.first, "a"), self.viewer(self.last, "b"), self.viewer(self.last, "c")
        for viewer, missed in ((near, 3), (far, 5), (most, 80)):
            viewer.flow(MISSED, struct.pack("<IQ", group, missed))
        wanted = 88, f"3.{most.id & 0xFFFFF}"

        def shown(hub):
            (service,) = self.services(hub)
            return service["missed"], service.get("missed_most")
        for hub in (self.first, self.middle, self.last):
            wait_until(lambda hub=hub: shown(hub) == wanted, "what was missed at all hubs")
        self.assertIn("88 (most: " + wanted[1], run_gimnet(self.middle, "services").out.decode())

    def test_a_subscriber_that_was_there_before_the_service(self):
        viewer = self.stranger(self.last, "viewer")
        self.assertEqual(viewer.subscribe("robot/scan")[4], 0)
        group = self.robot.advertise("scan")[3]
        moved = viewer.event(SERVICE_MOVED)
        self.assertEqual((moved[3], moved[4]), ("robot/scan", group))
        self.until_subscribed(group)
        self.publish(group, b"first")
        self.assertEqual(viewer.data(GROUP).body, b"first")

    def test_the_last_message_is_for_new_subscribers_at_any_hub(self):
        group = self.robot.advertise("scan", retain=put(11, BOOL, True))[3]
        self.publish(group, b"old")
        self.publish(group, b"kept")
        for hub, name in ((self.last, "a"), (self.last, "b"), (self.middle, "c"), (self.first, "d")):
            self.assertEqual(self.viewer(hub, name).data(GROUP).body, b"kept", name)

    def test_a_link_carries_what_those_behind_it_want(self):
        group = self.robot.advertise("scan")[3]
        slow = self.viewer(self.last, "slow", more=put(6, F64, 1.0))
        before = self.links(self.first)[2]["sent_bytes"]
        for number in range(100):
            self.publish(group, bytes([number]) * 1000)
        self.assertEqual(slow.data(GROUP).body, bytes([0]) * 1000)
        self.assertEqual(slow.data(GROUP).body, bytes([99]) * 1000, "the newest one, a second later")
        self.assertLess(self.links(self.first)[2]["sent_bytes"] - before, 50_000)
        fast = self.viewer(self.last, "fast")
        wait_until(lambda: self.stream_through(group, fast), "everything comes again")

    def stream_through(self, group, fast):
        """Do ten messages in one go all come?"""
        for number in range(10):
            self.publish(group, bytes([number]))
        return fast.data(GROUP).body == b"\0" and [fast.data(GROUP).body for _ in range(9)] == [bytes([n]) for n in range(1, 10)]

    def test_bytes_on_a_link_are_the_same_for_one_and_for_many_subscribers(self):
        group = self.robot.advertise("scan")[3]

        def bytes_of_twenty(viewer):
            before = self.links(self.first)[2]["sent_bytes"]
            for _ in range(20):
                self.publish(group, bytes(5000))
            for _ in range(20):
                viewer.data(GROUP)
            return self.links(self.first)[2]["sent_bytes"] - before

        viewer = self.viewer(self.last, "viewer")
        of_one = bytes_of_twenty(viewer)
        for number in range(99):
            self.stranger(self.last, f"more-{number}").subscribe("robot/scan")
        # Signs of life of the link come between: less than half a message.
        self.assertLess(abs(bytes_of_twenty(viewer) - of_one), 2500)

    def test_a_service_moves_to_another_group(self):
        group = self.robot.advertise("scan")[3]
        viewer = self.viewer(self.last, "viewer")
        other = self.robot.advertise("scan", type=put(4, U32, 77))[3]
        self.assertNotEqual(group, other)
        moved = viewer.event(SERVICE_MOVED)
        self.assertEqual(moved[4], other)
        self.until_subscribed(other)
        self.publish(other, b"new")
        self.assertEqual(viewer.data(GROUP).body, b"new")

    def test_the_owner_starts_again(self):
        group = self.robot.advertise("scan")[3]
        viewer = self.viewer(self.last, "viewer")
        self.publish(group, b"before")
        self.assertEqual(viewer.data(GROUP).body, b"before")
        self.first.process.end()
        self.first = self.first.again(self)
        self.robot = self.stranger(self.first, "robot")
        group = self.robot.advertise("scan")[3]
        self.until_subscribed(group)
        self.publish(group, b"after")
        self.assertEqual(viewer.data(GROUP).body, b"after")

    def test_the_middle_hub_dies_and_starts_again(self):
        group = self.robot.advertise("scan", retain=put(11, BOOL, True))[3]
        viewer = self.viewer(self.last, "viewer")
        self.publish(group, b"before")
        self.assertEqual(viewer.data(GROUP).body, b"before")
        self.middle.process.signal(9)
        self.middle.process.wait()
        self.until_subscribed(group, 0)
        self.publish(group, b"meanwhile")
        self.middle = self.middle.again(self)
        self.assertEqual(viewer.data(GROUP).body, b"meanwhile", "the last message, since it joined anew")
        self.publish(group, b"after")
        self.assertEqual(viewer.data(GROUP).body, b"after")


class Ring(Case):
    """Four hubs in a ring, and a link across it."""

    def linked(self, hub_id, *others):
        """A hub that dials the others. The costs are fixed: measured ones change the routes of a busy machine."""
        file = pathlib.Path(self.enterContext(tempfile.TemporaryDirectory())) / "hub.toml"
        file.write_text("".join(f'[[link]]\nurl = "{other.url}"\ncost = 10\n' for other in others))
        return self.hub("--accept-links", "--config", str(file), *PATIENT, hub_id=hub_id)

    def setUp(self):
        first = self.linked(1)
        second = self.linked(2, first)
        third = self.linked(3, second, first)
        fourth = self.linked(4, third, first)
        self.hubs = [first, second, third, fourth]
        self.nodes = [self.stranger(hub, f"node-{hub_id}") for hub_id, hub in enumerate(self.hubs, 1)]

        self.until_linked(5)

    def until_linked(self, count):
        def all_links():
            graphs = [json.loads(run_gimnet(hub, "graph", "--json").out)["links"] for hub in self.hubs]
            return all(len(edges) == count and all(edge["agreed"] for edge in edges) for edges in graphs)

        def all_ways():  # they follow the records a moment later
            hubs = [json.loads(run_gimnet(hub, "hubs", "--json").out) for hub in self.hubs]
            return all(sum(each["reachable"] for each in known) == len(self.hubs) for known in hubs)
        wait_until(lambda: all_links() and all_ways(), "all links and ways")

    def test_a_broadcast_reaches_each_node_once(self):
        for sender in self.nodes:
            for number in range(3):
                sender.write(BROADCAST, EVERYBODY, bytes([number]))
        for node in self.nodes:
            got = [node.data(BROADCAST) for _ in range(9)]
            expected = {(each.id, bytes([n])) for each in self.nodes if each is not node for n in range(3)}
            self.assertEqual({(each.src, each.body) for each in got}, expected)
            node.ping()
            self.assertEqual(node.taken, 9)

    def test_a_broadcast_to_one_hub_reaches_its_nodes_alone(self):
        self.nodes[0].write(BROADCAST, 3 << 20 | 0xFFFFF, b"third")
        self.assertEqual(self.nodes[2].data(BROADCAST).body, b"third")
        self.nodes[2].write(UNICAST, self.nodes[1].id, b"next")
        self.assertEqual(self.nodes[1].data().body, b"next")

    def test_a_list_with_ids_of_five_hubs_reaches_each_once(self):
        self.hubs.append(self.linked(5, self.hubs[2], self.hubs[3]))
        nodes = [*self.nodes, self.stranger(self.hubs[4], "node-5"), self.stranger(self.hubs[1], "another-2")]
        self.until_linked(7)
        ids = sorted(node.id for node in nodes[1:])
        for number in range(3):
            nodes[0].write(LIST, len(ids), struct.pack(f"<{len(ids)}I", *ids) + bytes([number]))
        for node in nodes[1:]:
            got = [node.data(LIST) for _ in range(3)]
            self.assertEqual([(each.src, each.body) for each in got], [(nodes[0].id, bytes([n])) for n in range(3)])
            node.ping()
            self.assertEqual(node.taken, 3)

    def test_a_group_crosses_each_link_once_and_finds_another_way(self):
        group = self.nodes[0].advertise("scan")[3]
        for node in self.nodes[1:]:
            wait_until(lambda: any(fields(s)[2] == "node-1/scan" for s in every(node.ask(NS, 9), 3)), "known")
            node.subscribe("node-1/scan")
        for number in range(5):
            self.nodes[0].write(GROUP, group, bytes([number]))
        for node in self.nodes[1:]:
            self.assertEqual([node.data(GROUP).body for _ in range(5)], [bytes([number]) for number in range(5)])
            self.assertEqual(node.taken, 5)
        # Hub 4 loses its link to hub 1, and hears the group from hub 3.
        hub = self.connected(self.hubs[3], local=True).join(role=2)
        names = [link["name"] for link in json.loads(run_gimnet(self.hubs[3], "links", "--json").out) if link["hub"] == 1]
        hub.ask(CTRL, 12, put(3, TEXT, names[0]))

        def comes():
            self.nodes[0].write(GROUP, group, b"again")
            self.nodes[3].ping()
            return any(got.body == b"again" for got in self.nodes[3].waiting)
        wait_until(comes, "it comes another way")


if __name__ == "__main__":
    unittest.main()
