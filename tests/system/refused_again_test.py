#!/usr/bin/env python3
"""A hub that does not take again what a node had, after a break: `gimnet` says so. Real processes."""

import signal
import subprocess
import unittest

from support.processes import Hub, run_gimnet, start_gimnet
from support.waiting import wait_until

NO_SERVICES = ("--limit", "services_per_node=0")
NO_SUBSCRIPTIONS = ("--limit", "subscriptions_per_node=0")


class RefusedAgain(unittest.TestCase):
    def restart(self, hub, *arguments):
        hub.process.signal(signal.SIGKILL)
        hub.process.wait()
        return Hub(self, *arguments, listen=hub.addresses, state=hub.state)

    def test_a_service(self):
        for stays in (True, False):
            with self.subTest(stays=stays):
                hub = Hub(self)
                pub = start_gimnet(self, hub, "pub", "robot/map", "--retain", "--stay", stdin=subprocess.PIPE)
                if stays:
                    pub.feed(b"one\n")
                    wait_until(lambda: "stays until Ctrl-C" in pub.err, "the end of its input")
                wait_until(lambda: run_gimnet(hub, "services", "robot/map").code == 0, "the service")
                self.restart(hub, *NO_SERVICES)
                self.assertEqual(pub.wait(), 1, pub.err)
                self.assertIn("robot/map: the hub did not take the service again", pub.err)
                self.assertIn("services_per_node", pub.err)

    def test_a_subscription(self):
        for command in ("echo", "hz", "bw"):
            with self.subTest(command=command):
                hub = Hub(self)
                reader = start_gimnet(self, hub, command, "robot/map")
                wait_until(lambda: "nobody provides" in reader.err, "its subscription")
                self.restart(hub, *NO_SUBSCRIPTIONS)
                self.assertEqual(reader.wait(), 1, reader.err)
                self.assertIn("robot/map: the hub did not take the subscription again", reader.err)
                self.assertIn("subscriptions_per_node", reader.err)

    def test_those_of_a_pattern(self):
        hub = Hub(self)
        pubs = [start_gimnet(self, hub, "pub", f"robot{i}/map", "--retain", "--stay",
                             stdin=subprocess.PIPE).feed(b"one\n") for i in range(2)]
        for pub in pubs:
            wait_until(lambda: "stays until Ctrl-C" in pub.err, "the end of its input")
        reader = start_gimnet(self, hub, "echo", "*/map", "--raw")
        wait_until(lambda: reader.out == b"one\none\n", "both messages")
        self.restart(hub, *NO_SUBSCRIPTIONS)
        wait_until(lambda: "the hub did not take the subscription again" in reader.err, "what it says")
        self.assertIn("going on without", reader.err)
        self.assertIsNone(reader.popen.poll(), reader.err)
        reader.signal(signal.SIGINT)
        self.assertEqual(reader.wait(), 130, reader.err)
        # Each once, however long it looks.
        self.assertLessEqual(reader.err.count("did not take the subscription again"), 2)


if __name__ == "__main__":
    unittest.main()
