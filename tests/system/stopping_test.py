#!/usr/bin/env python3
"""Ctrl-C and SIGTERM end every command of gimnet within 0.2 s, also while the hub stands still: while the command joins, while it
waits, and while it has much to write."""

import os
import pathlib
import re
import signal
import statistics
import subprocess
import time
import unittest

from support.processes import Hub, start_gimnet, start_recv
from support.waiting import PATIENCE_S, wait_until

# Beside other tests only a hang shows: ten times the limit. `./dev stress` checks the limit itself, by the median.
FULL = os.environ.get("GIMNET_STRESS") == "full"
WITHIN_S = 0.2 if FULL else 2.0
TRIES = 5 if FULL else 1
COMMANDS = [["send", "A"], ["recv", "--name", "B"], ["pub", "C/data"], ["echo", "A/x"], ["request", "Q/add", "1", "--timeout", "600"],
            ["answer", "D/add", "--echo"], ["hz", "A/x"], ["bw", "**"], ["ping", "A"], ["trace", "A"], ["watch"], ["nodes"],
            ["services"], ["status"], ["status", "--all"], ["hubs"], ["links"], ["graph"], ["routes", "A"], ["ctl", "connections"],
            ["ctl", "kick", "A"]]
# They go on until they are ended.
LASTING = [["send", "A"], ["recv", "--name", "B"], ["pub", "C/data"], ["echo", "A/x"], ["request", "Q/add", "1", "--timeout", "600"],
           ["answer", "D/add", "--echo"], ["hz", "A/x"], ["bw", "**"], ["ping", "A", "-c", "1000"],
           ["trace", "A", "-c", "1000"], ["watch"]]


def waits(process, threads=2):
    """It sees to signals by itself, and its first thread waits. The library has a third thread once it has joined."""
    folder = pathlib.Path(f"/proc/{process.popen.pid}")
    if len(list((folder / "task").iterdir())) < threads:
        return False
    blocked = int(re.search(r"^SigBlk:\s*(\w+)", (folder / "status").read_text(), re.M)[1], 16)
    return blocked & 1 << signal.SIGINT - 1 and (folder / "stat").read_text().rsplit(")", 1)[1].split()[0] == "S"


class Stopping(unittest.TestCase):
    def setUp(self):
        self.hub = Hub(self)
        self.receiver = start_recv(self, self.hub, "A", stdout=subprocess.DEVNULL)
        silent = start_gimnet(self, self.hub, "answer", "Q/add", "--echo")
        self.hub.wait_for_node("Q")
        silent.signal(signal.SIGSTOP)

    def assert_ends(self, start, what):
        for number in (signal.SIGINT, signal.SIGTERM):
            times = []
            while len(times) < TRIES:
                process = start()
                begun = time.monotonic()
                process.signal(number)
                process.popen.wait(PATIENCE_S)
                times.append(time.monotonic() - begun)
                self.assertEqual(process.wait(), 128 + number, f"{what}: {process.err}")
                self.hub.process.signal(signal.SIGCONT)
            self.assertLess(statistics.median(times), WITHIN_S, f"{what}: {times}")

    def test_while_they_join(self):
        def start(arguments):
            self.hub.process.signal(signal.SIGSTOP)
            process = start_gimnet(self, self.hub, *arguments, stdin=subprocess.PIPE)
            wait_until(lambda: waits(process), f"{arguments} waits")
            return process
        for arguments in COMMANDS:
            with self.subTest(" ".join(arguments)):
                self.assert_ends(lambda words=arguments: start(words), arguments)

    def test_while_they_wait(self):
        def start(arguments):
            process = start_gimnet(self, self.hub, *arguments, stdin=subprocess.PIPE)
            wait_until(lambda: waits(process, 3), f"{arguments} waits; it said: {process.err}")
            self.hub.process.signal(signal.SIGSTOP)
            return process
        for arguments in LASTING:
            with self.subTest(" ".join(arguments)):
                self.assert_ends(lambda words=arguments: start(words), arguments)

    def test_while_they_have_much_to_write(self):
        def start(arguments):
            lines = subprocess.Popen(["yes", "x" * 1000], stdout=subprocess.PIPE)
            self.addCleanup(lines.wait)
            self.addCleanup(lines.kill)
            self.addCleanup(lines.stdout.close)
            process = start_gimnet(self, self.hub, *arguments, stdin=lines.stdout)
            wait_until(lambda: waits(process, 3), f"{arguments} has joined; it said: {process.err}")
            self.hub.process.signal(signal.SIGSTOP)
            wait_until(lambda: waits(process, 3), f"{arguments} waits")
            return process
        echo = start_gimnet(self, self.hub, "echo", "C/data", stdout=subprocess.DEVNULL)
        wait_until(lambda: "waiting" in echo.err, "the subscriber")
        for arguments in (["send", "A"], ["pub", "C/data", "--wait", "1"]):
            with self.subTest(" ".join(arguments)):
                self.assert_ends(lambda words=arguments: start(words), arguments)


if __name__ == "__main__":
    unittest.main()
