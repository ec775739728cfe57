#!/usr/bin/env python3
"""Files of all sizes by `gimnet send --file`, up to the largest message that there can be, byte for byte."""

import os
import tempfile
import unittest

from support.processes import Hub, run_gimnet, start_recv
from support.tap import Tap
from support.waiting import PATIENCE_S
from support.wire import varied_bytes

FULL = os.environ.get("GIMNET_STRESS") == "full"
MIB = 1 << 20
SIZES = [0, 1, 8193, MIB, 16 * MIB, 64 * MIB] + ([1024 * MIB] if FULL else [])
PIECE = 8 * MIB


class Files(unittest.TestCase):
    def write(self, file, size):
        for begin in range(0, size, PIECE):
            file.write(varied_bytes(min(PIECE, size - begin), begin))
        file.flush()

    def expect_content(self, file, size):
        """What write() wrote, and the newline of `recv --raw`."""
        self.assertEqual(os.fstat(file.fileno()).st_size, size + 1)
        file.seek(0)
        for begin in range(0, size, PIECE):
            wanted = varied_bytes(min(PIECE, size - begin), begin)
            self.assertTrue(file.read(len(wanted)) == wanted, f"other bytes from {begin} on")
        self.assertEqual(file.read(), b"\n")

    def send_file(self, hub, size):
        with tempfile.NamedTemporaryFile() as file, tempfile.TemporaryFile() as arrived:
            self.write(file, size)
            receiver = start_recv(self, hub, "B", "-n", "1", "--max-size", str(max(size, 1)), stdout=arrived)
            sent = run_gimnet(hub, "send", "B", "--file", file.name, patience_s=30 * PATIENCE_S)
            self.assertEqual(sent.code, 0, sent.err)
            self.assertEqual(receiver.wait(30 * PATIENCE_S), 0, receiver.err)
            self.expect_content(arrived, size)

    def test_arrive_byte_for_byte(self):
        for shards in (1, 2):
            hub = Hub(self, shards=shards)
            tap = Tap(self, hub)
            for size in SIZES:
                with self.subTest(shards=shards, size=size):
                    self.send_file(tap, size)
            # A sender that waits long asks whether its receiver is still there, which may have everything by then, and end.
            vain = {reason: lambda name=reason: hub.counter(f"dropped.{name}") for reason in ("link_lost", "link_unsure", "no_such_node")}
            status = hub.expect_ledger(self, accepted=tap.sent, dropped=vain,
                                       delivered=lambda: tap.sent() - sum(count() for count in vain.values()))
            delivered, dropped = status["ledger"]["delivered"], status["ledger"]["dropped"]
            self.assertLessEqual(dropped, len(SIZES))
            self.assertTrue(delivered <= tap.got() <= delivered + dropped, (delivered, tap.got(), dropped))


if __name__ == "__main__":
    unittest.main()
