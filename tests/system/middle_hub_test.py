#!/usr/bin/env python3
"""A chain of three hubs whose middle one is killed and comes back, again and again, while a node sends. Each frame arrives
once or is reported to its sender."""

import os
import shutil
import signal
import struct
import threading
import unittest

from support.processes import Hub
from support.waiting import wait_until
from support.wire import FLAG_REPORT, REPORT, Client, Closed

DEATHS = 20 if os.environ.get("GIMNET_STRESS") == "full" else 5
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


class MiddleHub(unittest.TestCase):
    def test_each_frame_arrives_once_or_is_reported(self):
        patient = ("--limit", "silent_ms=600000")
        first = Hub(self, "--accept-links", *patient, hub_id=1)
        middle = Hub(self, "--accept-links", "--link", first.url, hub_id=2)
        last = Hub(self, "--link", middle.url, *patient, hub_id=3)
        receiver, sender = Reader(Client(self, first).join("B")), Reader(Client(self, last).join("A"))
        stream = Sender(sender.client, receiver.client.id)
        for thread in (receiver, sender, stream):
            thread.start()
        for death in range(DEATHS):
            begin = len(receiver.numbers)
            wait_until(lambda: len(receiver.numbers) > begin + 20, "frames that arrive")
            middle.process.signal(signal.SIGKILL)
            middle.process.wait()
            if death % 2:  # as another hub
                shutil.rmtree(middle.state)
            middle = middle.again(self)
        begin = len(receiver.numbers)
        wait_until(lambda: len(receiver.numbers) > begin + 20, "frames that arrive")
        stream.stop()
        numbers = receiver.numbers

        def all_told():
            return stream.sent - len(numbers) <= sum(sender.reported.values())
        wait_until(all_told, f"the fate of {stream.sent} frames: {len(numbers)} came, {sender.reported} reported")
        self.assertEqual(numbers, sorted(set(numbers)), "each once, in order")
        self.assertLess(len(numbers), stream.sent, "no death cost anything: this test sees nothing")
        # Those reported `link_unsure` may have arrived, no others.
        unsure = sender.reported.get(LINK_UNSURE, 0)
        self.assertLessEqual(sum(sender.reported.values()), stream.sent - len(numbers) + unsure, sender.reported)


if __name__ == "__main__":
    unittest.main()
