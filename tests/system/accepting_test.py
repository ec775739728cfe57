#!/usr/bin/env python3
"""Services that accept data: `gimnet send` sends to one, and whoever wants to read one is told what it is."""

import json
import signal
import subprocess
import unittest

from support.processes import BIN, Hub, Process, run_gimnet, start_gimnet
from support.waiting import wait_until
from support.wire import NS, Client, number, text

NOT_FOUND = 4
READERS = ("echo", "hz", "bw")


class Sending(unittest.TestCase):
    def setUp(self):
        self.hub = Hub(self)
        self.robot = self.start_robot()
        wait_until(lambda: run_gimnet(self.hub, "services", "bot/drive").code == 0, f"bot/drive; it said: {self.robot.err}")

    def start_robot(self):
        robot = Process([str(BIN / "gimnet-demo"), "robot", "--hub", self.hub.url, "--robot", "bot"])
        self.addCleanup(robot.end)
        return robot

    def test_a_service_acknowledges_what_is_sent_to_it(self):
        send = run_gimnet(self.hub, "send", "bot/drive", "--json", data=b"one\ntwo\n")
        self.assertEqual(send.code, 0, send.err)
        self.assertEqual(json.loads(send.out), {"sent": 2, "acknowledged": 2, "lost": 0, "waiting": 0})

    def test_a_service_that_is_away_is_waited_for_in_words(self):
        for size in (1, 1 << 20):  # in one frame, and in pieces
            with self.subTest(size=size):
                self.robot.signal(signal.SIGKILL)
                wait_until(lambda: any(not node["connected"] for node in self.hub.nodes()), "bot away")
                send = start_gimnet(self, self.hub, "send", "bot/drive", stdin=subprocess.PIPE).feed(b"x" * size + b"\n")
                wait_until(lambda send=send: "; waiting for it" in send.err, "the words")
                self.robot = self.start_robot()
                self.assertEqual(send.wait(), 0, send.err)
                self.assertRegex(send.err, r"\Agimnet: bot/drive is away( since \d+ s)?; waiting for it\n\Z")

    def test_a_service_that_gives_data_takes_none(self):
        send = run_gimnet(self.hub, "send", "bot/odom", data=b"one\n")
        self.assertEqual(send.code, NOT_FOUND, send.err)
        self.assertIn("cannot send to 'bot/odom': it gives data and takes none; use `gimnet echo bot/odom`", send.err)

    def test_a_service_that_a_node_does_not_have(self):
        send = run_gimnet(self.hub, "send", "bot/driv", data=b"one\n")
        self.assertEqual(send.code, NOT_FOUND, send.err)
        self.assertIn("there is no service 'bot/driv': the node 'bot' has none of that name; did you mean bot/drive?",
                      send.err)

    def test_no_node_gets_the_name_of_a_service(self):
        refused = run_gimnet(self.hub, "recv", "--name", "bot/drive")
        self.assertNotEqual(refused.code, 0)
        self.assertIn("bot/drive", refused.err)


class Accepting(unittest.TestCase):
    def setUp(self):
        self.hub = Hub(self)
        self.robot = Client(self, self.hub).join("robot")

    def advertise(self, accepts):
        self.robot.ask(NS, 7, text(3, "drive") + number(6, 2, int(accepts)))

    def test_who_reads_one_is_told(self):
        self.advertise(accepts=True)
        for command in READERS:
            with self.subTest(command=command):
                ended = run_gimnet(self.hub, command, "robot/drive")
                self.assertEqual(ended.code, NOT_FOUND, ended.err)
                self.assertIn("robot/drive", ended.err)
                self.assertIn("it takes data and gives none; use `gimnet send robot/drive`", ended.err)

    def test_who_waits_for_one_is_told_when_it_comes(self):
        readers = [start_gimnet(self, self.hub, command, "robot/drive") for command in READERS]
        for reader in readers:
            wait_until(lambda reader=reader: "nobody provides robot/drive yet" in reader.err, "the words that it waits")
        self.advertise(accepts=True)
        for reader in readers:
            self.assertEqual(reader.wait(), NOT_FOUND, reader.err)
            self.assertIn("robot/drive takes data and gives none; use `gimnet send robot/drive`", reader.err)

    def test_it_may_become_one_that_provides(self):
        self.advertise(accepts=True)
        self.advertise(accepts=False)
        echo = start_gimnet(self, self.hub, "echo", "robot/drive")
        wait_until(lambda: '"subscribers":1' in run_gimnet(self.hub, "services", "robot/*", "--json").out.decode(), "echo")
        self.assertEqual(echo.err, "")
        echo.signal(2)
        echo.wait()


if __name__ == "__main__":
    unittest.main()
