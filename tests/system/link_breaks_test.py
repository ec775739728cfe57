#!/usr/bin/env python3
"""A link breaks again and again while a node sends over it: the hub in the middle of three is killed, the network cuts or
stalls the connection, a hub stands still. Each frame arrives once or is reported to its sender. A link is removed: each
frame arrives if another way leads there."""

import json
import os
import shutil
import signal
import socket
import struct
import subprocess
import tempfile
import threading
import unittest

from support.processes import GIMNET, Hub, Process, run_gimnet
from support.waiting import wait_until
from support.wire import FLAG_REPORT, REPORT, Client, Closed

FULL = os.environ.get("GIMNET_STRESS") == "full"
PATIENT = ("--limit", "silent_ms=600000")  # the nodes here send no signs of life
LINK_UNSURE = 22


class Reader(threading.Thread):
    """Reads all that comes to a node: numbered frames, and what is reported."""

    def __init__(self, client):
        super().__init__(daemon=True)
        self.client, self.numbers, self.reported = client, [], {}

    def run(self):
        try:
            while True:
                got = self.client.next()
                if got.kind == REPORT:
                    reason, count = struct.unpack_from("<B3xI", got.payload)
                    self.reported[reason] = self.reported.get(reason, 0) + count
                elif got.kind < REPORT:
                    self.numbers.append(struct.unpack("<I", got.payload)[0])
        except (Closed, OSError):
            pass


class Sender(threading.Thread):
    """Sends numbered frames, some hundred a second, until it is stopped."""

    def __init__(self, client, to):
        super().__init__(daemon=True)
        self.client, self.to, self.sent, self._stopped = client, to, 0, threading.Event()

    def run(self):
        while not self._stopped.wait(0.003):
            self.client.send(self.client.frame(self.to, struct.pack("<I", self.sent), flags=FLAG_REPORT))
            self.sent += 1

    def stop(self):
        self._stopped.set()
        self.join()


class OneSided:
    """Carries a link. cut() ends the connection of the hub that dials; the other one sees nothing of it, and waits."""

    def __init__(self, test, port):
        self._port, self._near, self._all, self._cut = port, [], [], False
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"tcp://127.0.0.1:{self._listener.getsockname()[1]}"
        test.addCleanup(self._end)
        threading.Thread(target=self._accept, daemon=True).start()

    def cut(self):
        self._cut = True
        for near in self._near:
            near.shutdown(socket.SHUT_RDWR)
        self._near.clear()

    def mend(self):
        self._cut = False

    def _accept(self):
        try:
            while True:
                near = self._listener.accept()[0]
                if self._cut:
                    near.close()
                    continue
                far = socket.create_connection(("127.0.0.1", self._port))
                self._near.append(near)
                self._all += [near, far]
                for ends in ((near, far), (far, near)):
                    threading.Thread(target=self._carry, args=ends, daemon=True).start()
        except OSError:
            pass  # the test ends

    @staticmethod
    def _carry(source, target):
        try:
            while data := source.recv(1 << 16):
                target.sendall(data)
        except OSError:
            pass  # the other end is told nothing

    def _end(self):
        for end in (self._listener, *self._all):
            end.close()


class Breaks(unittest.TestCase):
    def begin(self, source, target):
        """A stream of frames from a node at one hub to one at another."""
        self.receiver, self.sender = Reader(Client(self, target).join("B")), Reader(Client(self, source).join("A"))
        self.stream = Sender(self.sender.client, self.receiver.client.id)
        for thread in (self.receiver, self.sender, self.stream):
            thread.start()
        self.until_more()

    def until_more(self):
        begin = len(self.receiver.numbers)
        wait_until(lambda: len(self.receiver.numbers) > begin + 20, "frames that arrive")

    def expect_all_told(self):
        self.stream.stop()
        sent, numbers, reported = self.stream.sent, self.receiver.numbers, self.sender.reported
        wait_until(lambda: sent - len(numbers) <= sum(reported.values()),
                   f"the fate of {sent} frames: {len(numbers)} came, {reported} reported")
        self.assertEqual(numbers, sorted(set(numbers)), "each once, in order")
        # Those reported `link_unsure` may have arrived, no others.
        self.assertLessEqual(sum(reported.values()), sent - len(numbers) + reported.get(LINK_UNSURE, 0), reported)

    def test_the_hub_in_the_middle_is_killed(self):
        first = Hub(self, "--accept-links", *PATIENT, hub_id=1)
        middle = Hub(self, "--accept-links", "--link", first.url, hub_id=2)
        last = Hub(self, "--link", middle.url, *PATIENT, hub_id=3)
        self.begin(last, first)
        for death in range(20 if FULL else 5):
            middle.process.signal(signal.SIGKILL)
            middle.process.wait()
            if death % 2:  # as another hub
                shutil.rmtree(middle.state)
            middle = middle.again(self)
            self.until_more()
        self.expect_all_told()
        self.assertTrue(self.sender.reported, "no death cost anything: this test sees nothing")

    def test_the_network_cuts_and_stalls_and_a_hub_stands_still(self):
        first = Hub(self, "--accept-links", *PATIENT, hub_id=1)
        network = Process([GIMNET, "impair", "tcp://127.0.0.1:0", first.url], stdin=subprocess.PIPE)
        self.addCleanup(network.end)
        wait_until(lambda: network.out.startswith(b"ready "), f"the network; it said: {network.err}")
        last = Hub(self, "--link", network.out.decode().split()[1], *PATIENT, hub_id=3)

        def order(line):
            network.popen.stdin.write(line.encode() + b"\n")
            network.popen.stdin.flush()
        self.begin(last, first)
        for _ in range(5 if FULL else 1):
            order("cut")
            self.until_more()
            order("stall")  # until the link was silent too long: its next connection stands still, too, and is seen
            self.until_silent(last)
            order("go")
            self.until_more()
            first.process.signal(signal.SIGSTOP)
            self.until_silent(last)
            first.process.signal(signal.SIGCONT)
            self.until_more()
        self.expect_all_told()

    def test_the_counts_agree_after_one_end_alone_withdrew_the_link(self):
        file = os.path.join(self.enterContext(tempfile.TemporaryDirectory(prefix="gimnet-test-")), "hub.toml")
        with open(file, "w", encoding="utf-8") as text:
            text.write("[links]\naccept_links = true\nsilent_ms = 60000\n")
        first = Hub(self, "--config", file, *PATIENT, hub_id=1)
        wire = OneSided(self, first.port)
        last = Hub(self, "--link", wire.url, *PATIENT, hub_id=3)
        self.begin(last, first)
        for _ in range(2):
            wire.cut()
            self.until_silent(last, ("dialling",))
            self.assertEqual(self.link_of(first)["state"], "up", "it saw nothing")
            wire.mend()
            self.until_more()
        self.expect_all_told()
        status = json.loads(run_gimnet(first, "status", "--all", "--json").out)
        self.assertTrue(status["exact"], status)
        near, far = self.link_of(last), self.link_of(first)
        self.assertEqual(near["unsure"], self.sender.reported[LINK_UNSURE])
        self.assertGreater(near["unsure"], 0)
        told = near["delivered"] + near["dropped"] + last.counter("dropped.no_route")
        self.assertEqual(told, self.stream.sent, "the counts of all three sessions")
        self.assertLessEqual(near["delivered"], far["accepted"])

    def link_of(self, hub):
        links = json.loads(run_gimnet(hub, "links", "--json").out or "[]")
        return links[0] if links else {"state": "none"}

    def until_silent(self, hub, states=("dialling", "away")):
        """The link of the hub has no connection any more."""
        wait_until(lambda: self.link_of(hub)["state"] in states, "the end of a silent link")


class Removed(unittest.TestCase):
    def test_a_link_beside_another_one_is_removed_while_frames_flow_both_ways(self):
        first = Hub(self, "--accept-links", *PATIENT, hub_id=1)
        network = Process([GIMNET, "impair", "tcp://127.0.0.1:0", first.url, "--delay", "20ms"], stdin=subprocess.PIPE)
        self.addCleanup(network.end)
        wait_until(lambda: network.out.startswith(b"ready "), f"the network; it said: {network.err}")
        far = network.out.decode().split()[1]
        last = Hub(self, "--link", far, *PATIENT, hub_id=3)
        administrator = f"unix:{last.socket_path}"
        added = run_gimnet(administrator, "ctl", "link", "add", first.url, "--cost", "900")
        self.assertEqual(added.code, 0, added.err)

        def states():
            return {link["name"]: link["state"] for link in json.loads(run_gimnet(last, "links", "--json").out)}
        wait_until(lambda: states() == {far: "up", first.url: "standby"}, "both links")
        ends = [Reader(Client(self, hub).join(name)) for hub, name in ((first, "A"), (last, "B"))]
        streams = [Sender(here.client, there.client.id) for here, there in (ends, ends[::-1])]
        for thread in ends + streams:
            thread.start()
        wait_until(lambda: all(len(end.numbers) > 50 for end in ends), "frames both ways")
        removed = run_gimnet(administrator, "ctl", "link", "remove", far)
        self.assertEqual(removed.code, 0, removed.err)
        wait_until(lambda: states() == {first.url: "up"}, "the other link alone")
        for stream in streams:
            stream.stop()
        for stream, end in zip(streams, ends[::-1]):
            wait_until(lambda stream=stream, end=end: len(end.numbers) >= stream.sent, f"{stream.sent} frames")
            self.assertEqual(sorted(end.numbers), list(range(stream.sent)))
        self.assertEqual([end.reported for end in ends], [{}, {}])

    def test_a_hub_between_two_others_ends_while_frames_flow_through_it(self):
        first = Hub(self, "--accept-links", *PATIENT, hub_id=1)
        middle = Hub(self, "--accept-links", "--link", first.url, hub_id=2)
        last = Hub(self, "--link", middle.url, *PATIENT, hub_id=3)
        added = run_gimnet(f"unix:{last.socket_path}", "ctl", "link", "add", first.url, "--cost", "900")
        self.assertEqual(added.code, 0, added.err)

        def way_to(hub, other):
            hubs = {each["id"]: each for each in json.loads(run_gimnet(hub, "hubs", "--json").out)}
            return hubs[other]["via"] if other in hubs else None
        wait_until(lambda: (way_to(last, 1), way_to(first, 3)) == (2, 2), "the way through hub 2")
        ends = [Reader(Client(self, hub).join(name)) for hub, name in ((first, "A"), (last, "B"))]
        streams = [Sender(here.client, there.client.id) for here, there in (ends, ends[::-1])]
        for thread in ends + streams:
            thread.start()
        wait_until(lambda: all(len(end.numbers) > 50 for end in ends), "frames both ways")
        middle.process.signal(signal.SIGTERM)
        self.assertEqual(middle.process.wait(), 0, middle.process.err)
        for stream in streams:
            stream.stop()
        for stream, end in zip(streams, ends[::-1]):
            wait_until(lambda stream=stream, end=end: len(end.numbers) >= stream.sent, f"{stream.sent} frames")
            self.assertEqual(sorted(end.numbers), list(range(stream.sent)))
        self.assertEqual([end.reported for end in ends], [{}, {}])


if __name__ == "__main__":
    unittest.main()
