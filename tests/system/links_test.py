#!/usr/bin/env python3
"""Hubs that link into one network: frames across several hubs, breaks, and links that cannot be."""

import json
import os
import signal
import socket
import subprocess
import unittest

from support.logs import robot_logs
from support.processes import Hub, run_gimnet, start_gimnet, start_recv
from support.waiting import wait_until


def linked(hub, to, within="a route"):
    """Waits until `hub` knows a way to the hub with that id."""
    def there():
        hubs = json.loads(run_gimnet(hub, "hubs", "--json").out or "[]")
        return any(each["id"] == to and each["reachable"] for each in hubs)
    wait_until(there, f"{within} to hub {to}")


class Chain(unittest.TestCase):
    """Hub 1 <- hub 2 <- hub 3: each dials the one before it."""

    def setUp(self):
        self.hubs = [Hub(self, "--accept-links", hub_id=1)]
        for number in (2, 3):
            self.hubs.append(Hub(self, "--accept-links", "--link", self.hubs[-1].url, hub_id=number))
        linked(self.hubs[0], 3)
        linked(self.hubs[2], 1)

    def node_id(self, hub, name):
        return hub.wait_for_node(name)["id"]

    def test_a_robots_log_goes_through_three_hubs_byte_for_byte(self):
        log = robot_logs()[0]
        receiver = start_recv(self, self.hubs[0], "B", "-n", str(log.count(b"\n")))
        sent = run_gimnet(self.hubs[2], "send", self.node_id(self.hubs[0], "B"), data=log)
        self.assertEqual(sent.code, 0, sent.err)
        self.assertEqual((receiver.wait(), receiver.out == log), (0, True), receiver.err)

    def test_messages_in_fragments_arrive_whole_both_ways(self):
        for here, there in ((0, 2), (2, 0)):
            big = b"x" * 3_000_000 + b"\n"
            receiver = start_recv(self, self.hubs[there], f"B{here}", "-n", "1")
            sent = run_gimnet(self.hubs[here], "send", self.node_id(self.hubs[there], f"B{here}"), data=big)
            self.assertEqual(sent.code, 0, sent.err)
            self.assertEqual((receiver.wait(), receiver.out == big), (0, True), receiver.err)

    def test_ping_reaches_a_node_two_links_away(self):
        start_recv(self, self.hubs[0], "B")
        ping = run_gimnet(self.hubs[2], "ping", self.node_id(self.hubs[0], "B"), "-c", "3", "-i", "0", "--json")
        self.assertEqual(ping.code, 0, ping.err)
        self.assertGreater(json.loads(ping.out)["min"], 0, ping.out)

    def test_a_node_that_is_not_there_is_reported_from_afar(self):
        sent = run_gimnet(self.hubs[2], "send", "1.77", data=b"hello\n")
        self.assertNotEqual(sent.code, 0)
        self.assertIn("no such node", sent.err.replace("_", " "))

    def test_an_unknown_hub_is_no_route(self):
        sent = run_gimnet(self.hubs[2], "send", "9.1", data=b"hello\n")
        self.assertNotEqual(sent.code, 0)
        self.assertIn("route", sent.err)

    def test_a_hub_that_is_cut_off_serves_its_own_nodes_and_reports_the_others(self):
        start_recv(self, self.hubs[0], "far")
        far = self.node_id(self.hubs[0], "far")
        near = start_recv(self, self.hubs[2], "near", "-n", "1")
        self.hubs[1].process.popen.send_signal(signal.SIGKILL)
        self.hubs[1].process.wait()

        def told():
            sent = run_gimnet(self.hubs[2], "send", far, data=b"lost\n")
            return sent.code != 0 and "route" in sent.err
        wait_until(told, "the word that there is no route")
        self.assertEqual(run_gimnet(self.hubs[2], "send", "near", data=b"here\n").code, 0)
        self.assertEqual((near.wait(), near.out), (0, b"here\n"))

    def test_a_receiver_that_stands_still_loses_nothing_behind_two_links(self):
        receiver = start_recv(self, self.hubs[0], "B", "-n", "400")
        there = self.node_id(self.hubs[0], "B")
        os.kill(receiver.popen.pid, signal.SIGSTOP)
        lines = b"".join(b"%06d%s\n" % (number, b"y" * 60_000) for number in range(400))
        sender = start_gimnet(self, self.hubs[2], "send", there, stdin=subprocess.PIPE)
        sender.feed(lines)
        wait_until(lambda: self.hubs[0].status()["ledger"]["accepted"] > 10, "messages that wait for it")
        os.kill(receiver.popen.pid, signal.SIGCONT)
        self.assertEqual(sender.wait(), 0, sender.err)
        self.assertEqual((receiver.wait(), receiver.out == lines), (0, True), receiver.err)


class Refused(unittest.TestCase):
    """Links that cannot be, and what is said at both ends."""

    def error_of(self, hub, *words):
        def error():
            links = json.loads(run_gimnet(hub, "links", "--json").out or "[]")
            said = links[0]["last_error"] if links else None
            return said if said and all(word in said for word in words) else None
        return wait_until(error, f"a link's error with {words}")

    def test_a_hub_takes_no_links_unless_it_says_so(self):
        closed = Hub(self, hub_id=1)
        dialler = Hub(self, "--link", closed.url, hub_id=2)
        self.error_of(dialler, "--accept-links")

    def test_two_hubs_with_one_id(self):
        first = Hub(self, "--accept-links", hub_id=1)
        second = Hub(self, "--link", first.url, hub_id=1)
        self.error_of(second, "hub id 1", "--hub-id")

    def test_two_stand_alone_hubs_with_the_default_id_are_linked(self):
        hubs = [Hub(self, "--accept-links", hub_id=None) for _ in range(2)]
        receivers = [start_recv(self, hub, name) for hub, name in zip(hubs, ("north", "south"))]
        added = run_gimnet(f"unix:{hubs[0].socket_path}", "ctl", "link", "add", hubs[1].url)
        self.assertEqual(added.code, 0, added.err)
        # One of them begins anew under another id, at its addresses and with its link; its node comes back by itself.
        for hub, name in zip(hubs, ("south", "north")):
            wait_until(lambda hub=hub, name=name: run_gimnet(hub, "send", name, data=b"hello\n").code == 0,
                       f"{name} at the other hub")
        for receiver in receivers:
            wait_until(lambda receiver=receiver: receiver.out.endswith(b"hello\n"), "its message")
        ids = {hub["id"] for hub in json.loads(run_gimnet(hubs[0], "hubs", "--json").out)}
        self.assertTrue(len(ids) == 2 and max(ids) >= 1024, ids)

    def test_a_hub_that_dials_itself(self):
        with socket.create_server(("127.0.0.1", 0)) as place:
            port = place.getsockname()[1]
        hub = Hub(self, "--accept-links", "--link", f"tcp://127.0.0.1:{port}",
                  listen=[f"tcp://127.0.0.1:{port}"], hub_id=1)
        self.error_of(hub, "same hub")

    def test_something_that_is_no_hub(self):
        with socket.create_server(("127.0.0.1", 0)) as server:
            hub = Hub(self, "--link", f"tcp://127.0.0.1:{server.getsockname()[1]}", hub_id=1)
            connection, _ = server.accept()
            connection.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n")
            self.error_of(hub, "does not speak GIMnet")
            connection.close()

    def test_nobody_listens(self):
        with socket.create_server(("127.0.0.1", 0)) as place:
            port = place.getsockname()[1]
        hub = Hub(self, "--link", f"tcp://127.0.0.1:{port}", hub_id=1)
        self.error_of(hub, "refused")
        self.assertEqual(run_gimnet(hub, "status").code, 0, "the rest goes on")


if __name__ == "__main__":
    unittest.main()
