#!/usr/bin/env python3
"""Services that accept data: who wants to read one with `gimnet` is told so, and does not wait for ever."""

import unittest

from support.processes import Hub, run_gimnet, start_gimnet
from support.waiting import wait_until
from support.wire import NS, Client, number, text

NOT_FOUND = 4
READERS = ("echo", "hz", "bw")


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
                self.assertIn("it takes data and gives none; send to it", ended.err)

    def test_who_waits_for_one_is_told_when_it_comes(self):
        readers = [start_gimnet(self, self.hub, command, "robot/drive") for command in READERS]
        for reader in readers:
            wait_until(lambda reader=reader: "nobody provides robot/drive yet" in reader.err, "the words that it waits")
        self.advertise(accepts=True)
        for reader in readers:
            self.assertEqual(reader.wait(), NOT_FOUND, reader.err)
            self.assertIn("robot/drive takes data and gives none; send to it", reader.err)

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
