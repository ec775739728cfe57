#!/usr/bin/env python3
"""The demo with recordings of real robots in which lines are damaged."""

import gzip
import os
import pathlib
import tempfile
import unittest

from support.logs import robot_logs
from support.processes import BIN, Process

DEMO = str(BIN / "gimnet-demo")
LINES = 4_000
EVERY = 500


def damaged(log):
    """The first lines of a log, of which one in EVERY is cut in its middle, and how many those are."""
    lines = log.splitlines()[:LINES]
    # Only these need all of their words.
    whole = [number for number, line in enumerate(lines) if line.startswith((b"ODOM", b"FLASER"))]
    cut = whole[10::EVERY]
    for number in cut:
        lines[number] = lines[number][:len(lines[number]) // 2]
    return b"\n".join(lines) + b"\n", [number + 1 for number in cut]


class Demo(unittest.TestCase):
    def test_a_recording_plays_without_the_lines_that_cannot_be_read(self):
        folder = tempfile.TemporaryDirectory(prefix="gimnet-test-")
        self.addCleanup(folder.cleanup)
        for number, log in enumerate(robot_logs()):
            with self.subTest(log=number):
                path = pathlib.Path(folder.name) / f"{number}.log.gz"
                content, cut = damaged(log)
                path.write_bytes(gzip.compress(content))
                demo = Process([DEMO, "--log", os.fspath(path), "--seconds", "2", "--speed", "10"])
                self.addCleanup(demo.end)
                self.assertEqual(demo.wait(), 0, demo.out.decode() + demo.err)
                self.assertIn(f"skipped {len(cut)} lines of the log that cannot be read; the first is {path}:{cut[0]}: ",
                              demo.err)
                self.assertIn(b"Nothing was lost.", demo.out)


if __name__ == "__main__":
    unittest.main()
