#!/usr/bin/env python3
"""A node that always has something to read, and says nothing by itself, is not silent to its hub."""

import subprocess
import threading
import time
import unittest

from support.processes import Hub, start_gimnet
from support.waiting import wait_until
from support.wire import GROUP, NS, Client, text

KEEP_ALIVE_MS, SILENT_MS = 250, 1000
ADVERTISE, SUBSCRIBE = 7, 10
# Some silent times.
FLOOD_S = 3.5


class BusyReader(unittest.TestCase):
    def setUp(self):
        self.hub = Hub(self, "--limit", f"keep_alive_ms={KEEP_ALIVE_MS}", "--limit", f"silent_ms={SILENT_MS}")

    def flood(self):
        """A service P/odom of which messages come all the time. Returns what ends it, and the number of messages."""
        provider = Client(self, self.hub).join("P")
        group = provider.ask(NS, ADVERTISE, text(3, "odom"))[3]
        batch = b"".join(provider.frame(group, b"m" * 100, kind=GROUP) for _ in range(200))
        sent, over = [0], threading.Event()

        def run():
            while not over.is_set():
                provider.send(batch)
                sent[0] += 200
        thread = threading.Thread(target=run, daemon=True)
        thread.start()

        def end():
            over.set()
            thread.join()
            return sent[0]
        self.addCleanup(end)
        return end

    def test_programs_that_read_a_flood_stay_connected(self):
        end = self.flood()
        echoes = [start_gimnet(self, self.hub, "echo", "P/odom", "--json", stdout=subprocess.DEVNULL) for _ in range(2)]
        until = time.monotonic() + FLOOD_S
        wait_until(lambda: time.monotonic() > until and self.hub.counter("delivered") > 1000, "a long flood")
        self.assertGreater(end(), 1000)
        self.assertEqual(self.hub.counter("silent"), 0)
        for echo in echoes:
            self.assertIsNone(echo.popen.poll(), echo.err)
            self.assertNotRegex(echo.err, "connection broke|lost the connection|connected again|silent")

    def test_a_library_that_only_answers_is_asked_in_time(self):
        """One of 0.9.0 counts a wake-up as a write: it sends nothing by itself, but answers a PING."""
        end = self.flood()
        reader = Client(self, self.hub).join()
        reader.ask(NS, SUBSCRIBE, text(3, "P/odom"))
        until = time.monotonic() + FLOOD_S
        while time.monotonic() < until:
            reader.next()  # answers PINGs
        end()
        self.assertGreater(reader.pinged, FLOOD_S * 1000 / SILENT_MS)
        self.assertEqual(self.hub.counter("silent"), 0)


if __name__ == "__main__":
    unittest.main()
