#!/usr/bin/env python3
"""Hubs that link into one network: frames across several hubs, breaks, and links that cannot be."""

import json
import os
import pathlib
import shutil
import signal
import socket
import subprocess
import tempfile
import time
import unittest

from support.logs import robot_logs
from support.processes import GIMNET, Hub, Process, run_gimnet, start_gimnet, start_recv
from support.tap import Tap
from support.waiting import wait_until
from support.wire import OPENING, hello


def linked(hub, to, within="a route"):
    """Waits until `hub` knows a way to the hub with that id."""
    def there():
        hubs = json.loads(run_gimnet(hub, "hubs", "--json").out or "[]")
        return any(each["id"] == to and each["reachable"] for each in hubs)
    wait_until(there, f"{within} to hub {to}")


def until_closed(connection, far_end):
    """Reads until the other end closes the connection, or not at all."""
    try:
        while far_end and connection.recv(4096):
            pass
    except ConnectionResetError:
        pass


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
        for hub in (closed, dialler):
            wait_until(lambda hub=hub: "start it with --accept-links" in hub.process.err, "the remedy in both logs")

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

    def test_a_hub_that_dials_itself_by_another_name_too(self):
        hub = Hub(self, "--accept-links", hub_id=1)
        for host in ("127.0.0.1", "localhost"):
            added = run_gimnet(f"unix:{hub.socket_path}", "ctl", "link", "add", f"tcp://{host}:{hub.port}", "--name", "self")
            self.assertEqual(added.code, 0, added.err)
            self.error_of(hub, f"tcp://{host}:", "the link leads back to the same hub; name another one")
            run_gimnet(f"unix:{hub.socket_path}", "ctl", "link", "remove", "self")

    def test_robots_that_were_started_from_one_state_folder(self):
        lab = Hub(self, "--accept-links", hub_id=1)
        card = Hub(self, "--link", lab.url, hub_id=None)
        linked(lab, card.status()["hub"]["id"])
        card.process.signal(signal.SIGTERM)
        card.process.wait()
        robots = []
        for _ in range(10):
            state = os.path.join(self.enterContext(tempfile.TemporaryDirectory(prefix="gimnet-test-")), "state")
            shutil.copytree(card.state, state)
            robots.append(Hub(self, "--link", lab.url, hub_id=None, state=state))
        remedy = "delete the state folder on one of the machines that have a copy of it"
        wait_until(lambda: sum(remedy in robot.process.err for robot in robots) == 9, "the remedy in the logs of all but one")
        self.assertIn(remedy, lab.process.err)
        self.assertEqual(len(json.loads(run_gimnet(lab, "hubs", "--json").out)), 2, "one of them is in the network")

    def test_things_that_are_no_hub(self):
        """A web server, garbage, and an end that sends back what it gets, as a node's port would."""
        talks = {"web": (b"HTTP/1.1 400 Bad Request\r\n\r\n", "does not speak GIMnet; is it a hub?"),
                 "garbage": (bytes(range(256)) * 100, "does not speak GIMnet; is it a hub?"),
                 "half": (OPENING + b"\xff" * 400, "something else than WELCOME; is it a hub?"),
                 "node": (OPENING + hello("robot"), "is it a hub?"),
                 "closed": (b"", "closed the connection before it said WELCOME; is it a hub?")}
        hub = Hub(self, hub_id=1)
        for name, (answer, _) in talks.items():
            server = self.enterContext(socket.create_server(("127.0.0.1", 0)))
            url = f"tcp://127.0.0.1:{server.getsockname()[1]}"
            added = run_gimnet(f"unix:{hub.socket_path}", "ctl", "link", "add", url, "--name", name)
            self.assertEqual(added.code, 0, added.err)
            with server.accept()[0] as connection:
                connection.sendall(answer)
                until_closed(connection, bool(answer))
        wait_until(lambda: all(f"link {name}: " in hub.process.err for name in talks), "a line of each")
        for name, (_, words) in talks.items():
            line = next(line for line in hub.process.err.splitlines() if f"link {name}: " in line)
            self.assertIn(words, line)
        self.assertEqual(run_gimnet(hub, "status").code, 0, "the rest goes on")

    def test_nobody_listens(self):
        with socket.create_server(("127.0.0.1", 0)) as place:
            port = place.getsockname()[1]
        hub = Hub(self, "--link", f"tcp://127.0.0.1:{port}", hub_id=1)
        self.error_of(hub, "refused")
        self.assertEqual(run_gimnet(hub, "status").code, 0, "the rest goes on")


class Between(unittest.TestCase):
    """What a link of two hubs does."""

    def states(self, hub):
        return {link["name"]: link["state"] for link in json.loads(run_gimnet(hub, "links", "--json").out or "[]")}

    def test_two_hubs_that_dial_each_other(self):
        first = Hub(self, "--accept-links", hub_id=1)
        second = Hub(self, "--accept-links", "--link", first.url, hub_id=2)
        added = run_gimnet(f"unix:{first.socket_path}", "ctl", "link", "add", second.url, "--cost", "500")
        self.assertEqual(added.code, 0, added.err)
        wanted = {first.url: "up", second.url: "standby"}
        for hub in (first, second):
            wait_until(lambda hub=hub: self.states(hub) == wanted, "the cheaper link is up, the other one stands by")
        receiver = start_recv(self, first, "B", "-n", "2")
        wait_until(lambda: run_gimnet(second, "nodes", "B").code == 0, "B at the other hub")
        self.assertEqual(run_gimnet(second, "send", "B", data=b"one\n").code, 0)
        removed = run_gimnet(f"unix:{second.socket_path}", "ctl", "link", "remove", first.url)
        self.assertEqual(removed.code, 0, removed.err)
        wait_until(lambda: self.states(second) == {second.url: "up"}, "the other link takes over")
        wait_until(lambda: run_gimnet(second, "ping", "B", "-c", "1").code == 0, "the other link carries frames")
        sent = run_gimnet(second, "send", "B", data=b"two\n")
        self.assertEqual(sent.code, 0, sent.err)
        self.assertEqual((receiver.wait(), receiver.out), (0, b"one\ntwo\n"), receiver.err)

    def test_a_link_that_may_not_speak_for_a_hub(self):
        """Its frames are dropped, counted, logged and reported, and it stays."""
        file = os.path.join(self.enterContext(tempfile.TemporaryDirectory(prefix="gimnet-test-")), "hub.toml")
        with open(file, "w", encoding="utf-8") as text:
            text.write("[links]\naccept_links = true\nallow = [3]\n")
        first = Hub(self, "--config", file, hub_id=1)
        second = Hub(self, "--accept-links", "--link", first.url, hub_id=2)
        third = Hub(self, "--link", second.url, hub_id=3)
        linked(third, 1)
        linked(first, 3, "a route back")
        start_recv(self, first, "B")
        there = first.wait_for_node("B")["id"]
        self.assertEqual(run_gimnet(third, "ping", there, "-c", "1").code, 0)
        start_gimnet(self, first, "answer", "C/mirror", "--echo")
        wait_until(lambda: run_gimnet(second, "services", "C/mirror").code == 0, "C/mirror at the other hub")
        for words in (["send", there], ["ping", there, "-c", "1"], ["trace", there, "-c", "1"], ["request", "C/mirror", "hello"]):
            denied = run_gimnet(second, *words, data=b"hello\n")
            self.assertEqual(denied.code, 6, denied.err)
            self.assertIn("the hub reports not_allowed: a link between hubs may not carry it: see `allow`", denied.err)
        self.assertEqual(first.counter("dropped.not_allowed"), 4)
        wait_until(lambda: "link to hub 2: dropped a frame of kind 0 whose source is at hub 2: that link may not speak for hub 2"
                   in first.process.err, "the line of its log")
        self.assertEqual(self.states(first), {first.url: "up"})

    def test_a_link_whose_way_back_is_restricted(self):
        """What cannot be acknowledged or answered is refused at once, and not sent."""
        file = os.path.join(self.enterContext(tempfile.TemporaryDirectory(prefix="gimnet-test-")), "hub.toml")
        with open(file, "w", encoding="utf-8") as text:
            text.write("[links]\naccept_links = true\nallow = [3]\n")
        first = Hub(self, "--config", file, hub_id=1)
        second = Hub(self, "--link", first.url, hub_id=2)
        linked(first, 2)
        receiver = start_recv(self, second, "B")
        start_gimnet(self, second, "answer", "C/mirror", "--echo")
        for words in (("nodes", "B"), ("services", "C/mirror")):
            wait_until(lambda words=words: run_gimnet(first, *words).code == 0, f"{words} at the other hub")
        for words in (("send", "B"), ("request", "C/mirror", "hello"), ("ping", "B", "-c", "1")):
            denied = run_gimnet(first, *words, data=b"hello\n")
            self.assertNotEqual(denied.code, 0, words)
            self.assertRegex(denied.err, "not_allowed|may not carry it", words)
        self.assertGreaterEqual(first.counter("dropped.not_allowed"), 3)
        self.assertEqual((receiver.out, second.status()["counters"]["dropped.not_allowed"]), (b"", 0))

    def test_a_hub_that_does_not_answer_costs_the_same_exit_code_everywhere(self):
        file = os.path.join(self.enterContext(tempfile.TemporaryDirectory(prefix="gimnet-test-")), "hub.toml")
        with open(file, "w", encoding="utf-8") as text:
            text.write("[links]\naccept_links = true\nsilent_ms = 60000\n")
        first = Hub(self, "--config", file, hub_id=1)
        second = Hub(self, "--link", first.url, hub_id=2)
        linked(first, 2)
        second.process.signal(signal.SIGSTOP)
        asked = [start_gimnet(self, first, command, "--hub-id", "2") for command in ("links", "status", "hubs")]
        for each in asked:
            self.assertEqual(each.wait(), 5, each.err)
            self.assertEqual(each.err, "gimnet: hub 2 did not answer within 4.9 s; see gimnet hubs\n")
        second.process.signal(signal.SIGCONT)

    def test_a_hub_drains_beside_a_silent_link(self):
        first = Hub(self, "--accept-links", hub_id=1)
        network = Process([GIMNET, "impair", "tcp://127.0.0.1:0", first.url], stdin=subprocess.PIPE)
        self.addCleanup(network.end)
        wait_until(lambda: network.out.startswith(b"ready "), f"the network; it said: {network.err}")
        second = Hub(self, "--link", network.out.decode().split()[1], hub_id=2)
        linked(second, 1)
        network.popen.stdin.write(b"stall\n")
        network.popen.stdin.flush()
        wait_until(lambda: b"ok" in network.out, "silence")
        second.process.signal(signal.SIGTERM)
        self.assertEqual(second.process.wait(), 0, second.process.err)
        wait_until(lambda: not self.reaches(first, 2), "that it is gone")

    def reaches(self, hub, other):
        return any(each["id"] == other and each["reachable"] for each in json.loads(run_gimnet(hub, "hubs", "--json").out))

    def test_three_idle_hubs_in_a_ring(self):
        first = Hub(self, "--accept-links", hub_id=1)
        taps = [Tap(self, first), Tap(self, first)]
        second = Hub(self, "--accept-links", "--link", taps[0].url, hub_id=2)
        taps.append(Tap(self, second))
        third = Hub(self, "--link", taps[1].url, "--link", taps[2].url, hub_id=3)
        hubs = (first, second, third)

        def is_ring():
            edges = json.loads(run_gimnet(first, "graph", "--json").out)["links"]
            return len(edges) == 3 and all(edge["agreed"] for edge in edges)
        wait_until(is_ring, "the ring")

        def used_ns():
            tasks = (task for hub in hubs for task in pathlib.Path(f"/proc/{hub.process.popen.pid}/task").iterdir())
            return sum(int((task / "schedstat").read_text().split()[0]) for task in tasks)

        def rates(length_s):
            """Frames a second of each link, and the share of a processor that the hubs use."""
            began, before, used = time.monotonic(), [tap.all_frames() for tap in taps], used_ns()
            wait_until(lambda: time.monotonic() > began + length_s, "the end of the time", pause_s=length_s)
            passed = time.monotonic() - began
            return [(tap.all_frames() - count) / passed for tap, count in zip(taps, before)], (used_ns() - used) / passed / 1e9
        # Costs fall for a moment after the start, and each fall is told.
        seen = wait_until(lambda: (lambda found: found if max(found[0]) <= 10 else None)(rates(2)), "at most 10 frames a second", 20)
        self.assertTrue(all(rate > 4 for rate in seen[0]), seen)
        self.assertLess(seen[1], 0.1, "of a core: ten times the limit, since other tests run beside this one")

    def test_nodes_of_a_hub_that_is_gone_are_unreachable(self):
        first = Hub(self, "--accept-links", hub_id=1)
        second = Hub(self, "--link", first.url, hub_id=2)
        start_gimnet(self, first, "answer", "B/add", "--echo")

        def state():
            found = [json.loads(run_gimnet(second, *words, "--json").out or "[]") for words in (("nodes", "B"), ("services", "B/add"))]
            node, service = [each[0]["state"] if each else None for each in found]
            return node if node == service else None
        wait_until(lambda: state() == "connected", "B at the other hub")
        watch = start_gimnet(self, second, "watch", "--json")
        pings = start_gimnet(self, second, "ping", "B", "-i", "0.1", "-c", "1000")
        wait_until(lambda: b'"B"' in watch.out and b"answer from" in pings.out, "B for all")
        first.process.signal(signal.SIGKILL)
        first.process.wait()
        wait_until(lambda: state() == "unreachable", "that B cannot be reached")
        wait_until(lambda: b'"change":"unreachable","hub_id":1,"hub":"hub-1"' in watch.out, "the line of the watch")
        wait_until(lambda: pings.out.count(b" cannot be reached: the hub reports no_route") > 1, "pings that go on")
        present = run_gimnet(second, "watch", "B", "-n", "1")
        self.assertRegex(present.out.decode(), "  present      node B 1[.][0-9]+, unreachable")
        echo = run_gimnet(second, "echo", "B/add", "--seconds", "0.1")
        self.assertIn("there is no way to the hub of B/add; waiting for one", echo.err)
        asked = run_gimnet(second, "request", "B/add", "1")
        self.assertEqual((asked.code, asked.err), (4, "gimnet: cannot ask B/add: there is no way to its hub at the moment\n"))
        ping = run_gimnet(second, "ping", "B", "-c", "1")
        self.assertEqual(ping.code, 4)
        self.assertIn("the node 'B' is unreachable: there is no way to its hub hub-1; `gimnet hubs` shows when", ping.err)
        taken = run_gimnet(second, "recv", "--name", "B")
        self.assertEqual(taken.code, 6)
        self.assertRegex(taken.err, "the name 'B' is that of node 1[.][0-9]+ of hub 1, which cannot be reached; it is free in [0-9]+ s")
        (hub,) = [hub for hub in json.loads(run_gimnet(second, "hubs", "--json").out) if hub["id"] == 1]
        self.assertEqual((hub["reachable"], hub["distance"], hub["cost"], hub["via"]), (False, None, None, None))
        status = json.loads(run_gimnet(second, "status", "--all", "--json").out)
        self.assertEqual((status["exact"], status["hubs"][0]), (False, {"id": 1, "name": "hub-1", "error": "unreachable"}))
        pings.end()  # the hub has to be quiet at its end
        first.again(self)
        wait_until(lambda: b'"change":"reachable","hub_id":1' in watch.out, "that the hub can be reached again")


if __name__ == "__main__":
    unittest.main()
