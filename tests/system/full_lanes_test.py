#!/usr/bin/env python3
"""Lanes that one node fills: who loses messages, and what the reader is told."""

import json
import pathlib
import re
import signal
import struct
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "support"))

from support.processes import Hub, run_gimnet, start_gimnet
from support.waiting import wait_until
from support.wire import FLAG_KEYED, GROUP, NS, Client, text

KEY = 8


class Flooded(unittest.TestCase):
    def test_echo_of_a_flooded_reader_names_who_floods(self):
        """The reader stands still while another node fills half of its lane, and its stream more than the rest."""
        # However long that takes, the hub neither closes the reader nor drops what the other node sent with BLOCK.
        times = [word for name in ("silent_ms", "block_ms", "slow_consumer_ms") for word in ("--limit", f"{name}=600000")]
        hub = Hub(self, "--limit", "lane1_bytes=65536", "--limit", "socket_send_bytes=4096", *times)
        provider = Client(self, hub).join("r")
        group = provider.ask(NS, 7, text(3, "s"))[3]
        # A Unix socket that has refused bytes takes none before the reader reads. TCP may take more at any time.
        echo = start_gimnet(self, f"unix:{hub.socket_path}", "echo", "r/s", "--raw")
        wait_until(lambda: json.loads(run_gimnet(hub, "services", "r/s", "--json").out)[0]["subscribers"] == 1,
                   "the subscriber")
        connections = json.loads(run_gimnet(hub, "ctl", "connections", "--json").out)
        reader = next(each["id"] for each in connections if not each["name"])  # the other one is this question's
        hub_id, index = map(int, reader.split("."))
        sequence = 0

        def publish(size):
            nonlocal sequence
            sequence += 1
            data = bytes(KEY) + struct.pack("<IIBBH", 1, sequence, 0, 0, 0) + bytes(size)
            provider.send(provider.frame(group, data, kind=GROUP, flags=FLAG_KEYED))
        publish(1)
        wait_until(lambda: echo.out, "the first message")
        echo.signal(signal.SIGSTOP)
        flooder = Client(self, hub).join("flooder")

        def waiting():
            return next(each["queued_bytes"] for each in hub.status()["connections"] if each["id"] == reader)

        while waiting() < 30000:  # of the lane's 65536: less of the stream than of the flooder finds room behind it
            flooder.send(flooder.frame(hub_id << 20 | index, bytes(16000)))
        for _ in range(4):
            publish(20000)
        wait_until(lambda: hub.counter("dropped.queue_full") > 0, "a full lane")
        whose = rf"dropped\.queue_full: (\d+)\n    for node {re.escape(reader)}: \1\n"
        wait_until(lambda: re.search(whose, run_gimnet(hub, "status").out.decode()), "the status to name the reader")
        echo.signal(signal.SIGCONT)
        flooder_id = f"{flooder.id >> 20}.{flooder.id & 0xFFFFF}"
        said = ("messages of r/s did not come: the queue of this reader at the hub was full, mostly of what "
                f"{re.escape(flooder_id)} sent\n")

        def is_said():
            publish(1)
            return re.search(said, echo.err)
        try:
            wait_until(is_said, "the sentence")
        except AssertionError as late:
            raise AssertionError(f"{late}. Told: {echo.err}; {hub.status()}") from None
        echo.signal(signal.SIGINT)
        self.assertEqual(echo.wait(), 130, echo.err)
        self.assertNotIn("too slow", echo.err)


if __name__ == "__main__":
    unittest.main()
