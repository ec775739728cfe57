#!/usr/bin/env python3
"""Commands to a robot whose connection breaks, or that dies: each is refused, or comes once, or is asked for again."""

import os
import subprocess
import threading
import unittest

import gimnet
from support.processes import Hub, start_gimnet
from support.proxy import Proxy
from support.waiting import PATIENCE_S, wait_until
from two_nodes import program

BREAKS = 1_000 if os.environ.get("GIMNET_STRESS") == "full" else 20
BREAK_S = 0.05
AWAY = "robot/drive is away"

ROBOT = """
drive = node.accept("drive")
print("ready", flush=True)
while True:
    print(drive.receive().text, flush=True)
"""
# It joins, and accepts when it is told so.
SLOW_ROBOT = """
print("joined", flush=True)
sys.stdin.readline()
""" + ROBOT
ANSWERING = """
add = node.answer("add")
print("ready", flush=True)
while True:
    request = add.receive()
    request.reply("done: " + request.text)
"""


class Away(unittest.TestCase):
    """One hub; Linked has two with a link between them."""

    def setUp(self):
        self.hub = self.far = Hub(self)

    def node(self, hub_url, name=""):
        node = gimnet.connect(name, hub=hub_url)
        self.addCleanup(node.close)
        return node

    def start(self, lines, first_line):
        robot = program(lines, self.hub, "robot")
        self.addCleanup(self.end, robot)
        self.assertEqual(robot.stdout.readline(), first_line + "\n")
        return robot

    @staticmethod
    def end(robot):
        robot.kill()
        robot.communicate()

    def is_refused(self, sender):
        """Also while the service has not come to this hub."""
        try:
            sender.send("robot/drive", "too early")
            return False
        except gimnet.NotFound as refusal:
            return AWAY in str(refusal)

    def wait_for(self, sender, service):
        wait_until(lambda: any(each.name == service for each in sender.services("robot/*")), service)

    def test_a_connection_that_breaks_loses_no_command(self):
        proxy = Proxy(self, self.hub.port)
        robot = self.node(proxy.url, "robot")
        drive = robot.accept("drive")
        sender = self.node(self.far.url)
        self.wait_for(sender, "robot/drive")
        self.came = refused = 0
        breaking = threading.Thread(target=self.break_again_and_again, args=(proxy, robot))
        breaking.start()
        while breaking.is_alive():
            try:
                sender.send("robot/drive", str(self.came), PATIENCE_S)
            except gimnet.NotFound as refusal:
                self.assertIn(AWAY, str(refusal))
                refused += 1
                continue
            self.assertEqual(drive.receive(PATIENCE_S).text, str(self.came))
            self.came += 1
        breaking.join()
        self.assertGreaterEqual(self.came, BREAKS)
        self.assertGreater(refused, 0)
        sender.send("robot/drive", "last", PATIENCE_S, wait_if_away=True)
        self.assertEqual(drive.receive(PATIENCE_S).text, "last")
        self.assertEqual(robot.state().reconnects, proxy.dropped)

    def break_again_and_again(self, proxy, robot):
        for number in range(BREAKS):
            proxy.break_for(BREAK_S)
            wait_until(lambda number=number: robot.state().reconnects > number, "the connection after a break")
            came = self.came
            wait_until(lambda came=came: self.came > came, "the next command", pause_s=0.001)

    def test_a_program_that_was_started_again_gets_no_command_of_before(self):
        robot = self.start(ROBOT, "ready")
        sender = self.node(self.far.url)
        self.wait_for(sender, "robot/drive")
        sender.send("robot/drive", "first")
        self.assertEqual(robot.stdout.readline(), "first\n")
        robot.kill()
        wait_until(lambda: self.is_refused(sender), "the refusal of a command")
        robot = self.start(SLOW_ROBOT, "joined")
        self.assertTrue(self.is_refused(sender), "it has not accepted it again")
        waiting = start_gimnet(self, self.far, "send", "robot/drive", stdin=subprocess.PIPE)
        waiting.feed(b"of the shell\n")
        wait_until(lambda: AWAY in waiting.err, "the words that it waits")
        self.assertTrue(self.is_refused(sender), "it has not accepted it again")
        robot.stdin.write("accept\n")
        robot.stdin.flush()
        self.assertEqual(robot.stdout.readline(), "ready\n")
        self.assertEqual(waiting.wait(), 0, waiting.err)
        self.assertEqual(robot.stdout.readline(), "of the shell\n")
        sender.send("robot/drive", "last", PATIENCE_S, wait_if_away=True)
        self.assertEqual(robot.stdout.readline(), "last\n")

    def test_who_waits_gives_up_when_the_time_is_over(self):
        robot = self.start(ROBOT, "ready")
        sender = self.node(self.far.url)
        self.wait_for(sender, "robot/drive")
        sender.send("robot/drive", "first")
        robot.kill()
        wait_until(lambda: self.is_refused(sender), "the refusal of a command")
        with self.assertRaises(gimnet.Timeout) as over:
            sender.send("robot/drive", "second", 0.1, wait_if_away=True)
        self.assertIn(AWAY + " since ", str(over.exception))

    def test_a_request_waits_for_the_program(self):
        robot = self.start(ANSWERING, "ready")
        asker = self.node(self.far.url)
        self.wait_for(asker, "robot/add")
        self.assertEqual(asker.request("robot/add", "1", PATIENCE_S).text, "done: 1")
        robot.kill()
        wait_until(lambda: not any(each.connected for each in asker.nodes("robot")), "the end of the robot")
        with asker.request_later("robot/add", "2", PATIENCE_S) as pending:
            self.start(ANSWERING, "ready")
            self.assertEqual(pending.receive().text, "done: 2")


class Linked(Away):
    def setUp(self):
        self.hub = Hub(self, "--accept-links", hub_id=1)
        self.far = Hub(self, "--link", self.hub.url, hub_id=2)


if __name__ == "__main__":
    unittest.main()
