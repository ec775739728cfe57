#!/usr/bin/env python3
"""Programs that are started without standard streams, with full ones, or where files may not grow: each goes on or says why not,
and nothing that is meant for a person gets into a file or a socket."""

import os
import resource
import signal
import subprocess
import tempfile
import unittest

from support.processes import GIMNET, TCPHUB, Hub, Process, run_gimnet, start_recv
from support.waiting import wait_until

FAILED = 1
# `sh` starts the program with these streams closed.
WITHOUT = ["sh", "-c", 'closed="$1"; shift; eval "exec \\"\\$@\\" $closed"', "sh"]


def run_without(closed, program, *arguments):
    """The exit code, and the words on standard error."""
    process = Process([*WITHOUT, closed, program, *arguments])
    try:
        return process.wait(), process.err
    finally:
        process.end()


class ClosedStreams(unittest.TestCase):
    def test_a_hub_without_any_serves_and_its_files_stay_its_own(self):
        with tempfile.TemporaryDirectory() as folder:
            state, place = os.path.join(folder, "state"), f"unix:{folder}/hub.sock"
            hub = Process([*WITHOUT, "<&- >&- 2>&-", TCPHUB, "--listen", place, "--state-dir", state, "--log-level", "debug"])
            self.addCleanup(hub.end)
            # Its file is there before it listens.
            wait_until(lambda: run_gimnet(place, "nodes").code == 0, "the hub serves")
            for _ in range(2):
                self.assertEqual(run_gimnet(place, "nodes").code, 0)
            streams = [os.readlink(f"/proc/{hub.popen.pid}/fd/{number}") for number in range(3)]
            self.assertEqual(streams, ["/dev/null"] * 3)
            hub.signal(signal.SIGTERM)
            self.assertEqual(hub.wait(), 0)
            with open(os.path.join(state, "lock"), "rb") as lock:
                self.assertEqual(lock.read(), b"%d\n" % hub.popen.pid)

    def test_what_needs_one_says_so(self):
        hub = Hub(self)
        start_recv(self, hub, "B")
        for arguments in (["send", "B"], ["pub", "a/b"]):
            with self.subTest(arguments=arguments):
                ended = run_without("<&-", GIMNET, "--hub", hub.url, *arguments)
                self.assertEqual(ended, (FAILED, "gimnet: cannot read standard input: Bad file descriptor\n"))
        for program, arguments in ((GIMNET, ["--hub", hub.url, "nodes"]), (TCPHUB, ["--print-config"])):
            with self.subTest(program=program):
                ended = run_without(">&-", program, *arguments)
                said = f"{os.path.basename(program)}: cannot write to standard output: Bad file descriptor\n"
                self.assertEqual(ended, (FAILED, said))


class FullStreams(unittest.TestCase):
    def test_a_hub_says_what_it_could_not(self):
        for arguments in (["--help"], ["--help-limits"], ["--version"], ["--print-config"]):
            with self.subTest(arguments=arguments), open("/dev/full", "wb") as full:
                process = Process([TCPHUB, *arguments], stdout=full)
                self.addCleanup(process.end)
                self.assertEqual(process.wait(), FAILED)
                self.assertEqual(process.err, "tcphub: cannot write to standard output: No space left on device\n")

    def test_a_hub_serves_without_its_ready_line(self):
        with tempfile.TemporaryDirectory() as folder, open("/dev/full", "wb") as full:
            place = f"unix:{folder}/hub.sock"
            hub = Process([TCPHUB, "--listen", place, "--state-dir", os.path.join(folder, "state")], stdout=full)
            self.addCleanup(hub.end)
            wait_until(lambda: "the ready line cannot be written to standard output: No space left" in hub.err, "the warning")
            self.assertEqual(run_gimnet(place, "nodes").code, 0)


class FilesMayNotGrow(unittest.TestCase):
    def start_hub(self, folder):
        hub = subprocess.Popen([TCPHUB, "--listen", f"unix:{folder}/hub.sock", "--state-dir", os.path.join(folder, "state")],
                               stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
                               preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100)))
        self.addCleanup(hub.wait)
        self.addCleanup(hub.stderr.close)
        self.addCleanup(hub.kill)
        return hub

    def test_the_hub_says_that_it_cannot_keep_its_state(self):
        with tempfile.TemporaryDirectory() as folder:
            hub = self.start_hub(folder)
            said = hub.stderr.read()
            self.assertEqual(hub.wait(), FAILED, said)
            self.assertIn("File too large", said)
            self.assertIn(os.path.join(folder, "state"), said)


if __name__ == "__main__":
    unittest.main()
