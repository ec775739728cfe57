#!/usr/bin/env python3
"""A ring of four hubs whose links are slow and full: each node sends with BLOCK to the one opposite. Nobody stands still, and
nothing is lost."""

import json
import os
import subprocess
import threading
import time
import unittest

from support.processes import GIMNET, Hub, Process, run_gimnet, start_gimnet
from support.waiting import wait_until

FULL = os.environ.get("GIMNET_STRESS") == "full"
HUBS = 4
RATE = "1MB"
LINE = b"x" * 29_999 + b"\n"  # `gimnet send` has 64 on the way: more than a lane takes


class Feeder(threading.Thread):
    """Writes lines to a program as fast as it takes them, until it is stopped."""

    def __init__(self, into):
        super().__init__(daemon=True)
        self.into, self.lines, self._stopped = into, 0, threading.Event()

    def run(self):
        while not self._stopped.is_set():
            self.into.write(LINE)
            self.lines += 1
        self.into.close()

    def stop(self):
        self._stopped.set()


class Ring(unittest.TestCase):
    def start(self):
        """Hub N dials hub N + 1 through a slow network."""
        hubs = [Hub(self, "--accept-links", hub_id=number + 1) for number in range(HUBS)]
        for number, hub in enumerate(hubs):
            following = hubs[(number + 1) % HUBS]
            network = Process([GIMNET, "impair", "tcp://127.0.0.1:0", following.url, "--rate", RATE, "--delay", "5ms"])
            self.addCleanup(network.end)
            wait_until(lambda network=network: network.out.startswith(b"ready "), f"the network; it said: {network.err}")
            added = run_gimnet(f"unix:{hub.socket_path}", "ctl", "link", "add", network.out.decode().split()[1],
                               "--cost", "10")
            self.assertEqual(added.code, 0, added.err)
        for hub in hubs:
            wait_until(lambda hub=hub: self.is_linked(hub), "a link to each neighbour, and the way to the hub opposite")
        return hubs

    @staticmethod
    def is_linked(hub):
        links = json.loads(run_gimnet(hub, "links", "--json").out or "[]")
        others = json.loads(run_gimnet(hub, "hubs", "--json").out or "[]")
        return [link["state"] for link in links] == ["up", "up"] and [other["distance"] for other in others].count(2) == 1

    def test_nobody_stands_still_and_nothing_is_lost(self):
        hubs = self.start()
        receivers = [start_gimnet(self, hub, "recv", "--name", f"node{number}", "--raw") for number, hub in enumerate(hubs)]
        senders, feeders = [], []
        for number, hub in enumerate(hubs):
            name = f"node{(number + 2) % HUBS}"
            wait_until(lambda hub=hub, name=name: run_gimnet(hub, "nodes", name).code == 0, f"{name} at hub {number + 1}")
        for number, hub in enumerate(hubs):
            sender = start_gimnet(self, hub, "send", f"node{(number + 2) % HUBS}", stdin=subprocess.PIPE)
            senders.append(sender)
            feeders.append(Feeder(sender.popen.stdin))
            feeders[-1].start()
        end = time.monotonic() + (60 if FULL else 3)
        while time.monotonic() < end:
            before = [receiver.out_size for receiver in receivers]

            def all_go_on(before=before):
                return all(receiver.out_size > size + 10 * len(LINE) for receiver, size in zip(receivers, before))
            wait_until(all_go_on, "ten lines at each node", 30)
        wait_until(lambda: all(hub.counter("pauses") > 0 for hub in hubs[:2]), "a full lane")
        for feeder in feeders:
            feeder.stop()
        for sender in senders:
            self.assertEqual(sender.wait(120), 0, sender.err)
        for number, receiver in enumerate(receivers):
            wanted = feeders[(number + 2) % HUBS].lines * len(LINE)
            wait_until(lambda receiver=receiver, wanted=wanted: receiver.out_size == wanted, "all lines")
        self.assertEqual([hub.counter("dropped.queue_full") for hub in hubs], [0] * HUBS)


if __name__ == "__main__":
    unittest.main()
