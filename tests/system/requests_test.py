#!/usr/bin/env python3
"""Requests by the command line: `gimnet request` asks, `gimnet answer --echo` answers."""

import json
import signal
import tempfile
import unittest

from support.processes import Hub, run_gimnet, start_gimnet
from support.waiting import wait_until

USAGE, NOT_FOUND, TIMEOUT = 2, 4, 5


class Requests(unittest.TestCase):
    def setUp(self):
        self.hub = Hub(self, "--accept-links")

    def answer(self, *options):
        answer = start_gimnet(self, self.hub, "answer", "B/mirror", "--echo", *options)
        wait_until(lambda: run_gimnet(self.hub, "services", "B/mirror").code == 0, f"B/mirror; it said: {answer.err}")
        self.assertRegex(run_gimnet(self.hub, "services", "B/mirror").out, rb"  -  +answers ")  # no type of messages
        return answer

    def request(self, *arguments):
        return run_gimnet(self.hub, "request", "B/mirror", *arguments)

    def test_the_answer_is_printed(self):
        answer = self.answer("-n", "5")
        self.assertEqual((self.request("hello").out, self.request().out), (b"hello\n", b"\n"))
        self.assertEqual(self.request("a\tb", "--raw").out, b"a\tb\n")
        told = json.loads(self.request("1 2", "--json").out)
        self.assertEqual((told["size"], told["text"]), (3, "1 2"))
        with tempfile.NamedTemporaryFile() as file:
            file.write(b"x" * 100_000)
            file.flush()
            self.assertEqual(self.request("--file", file.name, "--raw", "--timeout", "20").out, b"x" * 100_000 + b"\n")
        self.assertEqual(answer.wait(), 0, answer.err)
        self.assertIn("answering B/mirror (", answer.err)

    def test_nobody_answers_there(self):
        self.answer()
        for service in ("B/other", "nobody/mirror"):
            ended = run_gimnet(self.hub, "request", service, "hello")
            self.assertEqual(ended.code, NOT_FOUND, ended.err)
            self.assertIn(service, ended.err)

    def test_a_hub_that_has_just_started_waits_for_the_names_of_others(self):
        self.answer()
        far = Hub(self, "--link", self.hub.url, hub_id=8)
        for _ in range(2):
            asked = run_gimnet(far, "request", "B/mirror", "hello")
            self.assertEqual((asked.code, asked.out), (0, b"hello\n"), asked.err)
            far.process.signal(signal.SIGKILL)
            far.process.wait()
            far = far.again(self)

    def test_no_answer_in_time(self):
        answer = self.answer()
        answer.signal(signal.SIGSTOP)
        ended = self.request("hello", "--timeout", "0.2")
        answer.signal(signal.SIGCONT)
        self.assertEqual(ended.code, TIMEOUT, ended.err)
        self.assertIn("B/mirror did not answer within the time given", ended.err)

    def test_one_service_is_asked(self):
        for arguments in (("request", "B/*"), ("request", "mirror"), ("answer", "B/mirror")):
            self.assertEqual(run_gimnet(self.hub, *arguments).code, USAGE, arguments)


if __name__ == "__main__":
    unittest.main()
