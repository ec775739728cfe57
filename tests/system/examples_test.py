#!/usr/bin/env python3
"""The programs of examples/, as a newcomer starts them, with a real hub."""

import os
import signal
import unittest

from support.processes import GIMNET, Hub, Process
from support.waiting import wait_until

EXAMPLES = os.path.join(os.path.dirname(GIMNET), "examples")


def start(test, hub, name, *arguments):
    process = Process([os.path.join(EXAMPLES, name), *arguments], env={"GIMNET_HUB": hub.url})
    test.addCleanup(process.end)
    return process


class Examples(unittest.TestCase):
    def test_a_subscriber_prints_what_the_publisher_says(self):
        hub = Hub(self)
        subscriber = start(self, hub, "subscriber")
        publisher = start(self, hub, "publisher")
        wait_until(lambda: subscriber.out.count(b"\n") >= 3, f"three messages; it said: {subscriber.err}")
        self.assertRegex(subscriber.out.splitlines()[0].decode(), r"^7\.\d+ #\d+: x \d\.\d{6} y 0$")
        # Both go on where the hub was away.
        hub.process.signal(signal.SIGKILL)
        hub.process.wait()
        before = subscriber.out.count(b"\n")
        hub.again(self)
        wait_until(lambda: subscriber.out.count(b"\n") >= before + 3, "messages by the hub that was started anew")
        self.assertIsNone(publisher.popen.poll(), publisher.err)
        # The hub is looked at when it is quiet.
        publisher.signal(signal.SIGKILL)
        publisher.wait()

    def test_a_question_has_its_answer(self):
        hub = Hub(self)
        adder = start(self, hub, "adder")
        hub.wait_for_node("adder")
        ask = start(self, hub, "ask")
        self.assertEqual((ask.wait(), ask.out, ask.err), (0, b"1.5 + 2 = 3.500000\n", ""))
        self.assertEqual(adder.err, "")

    def test_nobody_to_ask_is_said(self):
        ask = start(self, Hub(self), "ask")
        self.assertEqual(ask.wait(), 1)
        self.assertIn("adder", ask.err)

    def test_the_mirror_sends_back_what_hello_says(self):
        hub = Hub(self)
        hello = start(self, hub, "hello")
        self.assertEqual(hello.wait(), 1)
        self.assertIn("cannot find the node mirror", hello.err)
        mirror = start(self, hub, "mirror")
        hub.wait_for_node("mirror")
        hello = start(self, hub, "hello", "hallo")
        self.assertEqual((hello.wait(), hello.out, hello.err), (0, b"hallo\n", ""))
        self.assertEqual(mirror.err, "")

    def test_values_go_into_a_message_and_out_again(self):
        pose = start(self, Hub(self), "pose")
        self.assertEqual((pose.wait(), pose.out, pose.err),
                         (0, b"robot is at x 0.5\nrange 1\nrange 0.5\nrange 0.25\n", ""))

    def test_without_a_hub_they_say_so(self):
        hub = Hub(self)
        hub.process.end()
        for name in ("publisher", "subscriber", "adder", "ask", "mirror", "hello"):
            with self.subTest(name=name):
                process = start(self, hub, name)
                self.assertEqual(process.wait(), 1)
                self.assertIn(hub.url, process.err)


if __name__ == "__main__":
    unittest.main()
