#!/usr/bin/env python3
"""send(confirm=True): the receiver has the message, or the sender hears why not."""

import pathlib
import signal
import threading
import unittest

import gimnet
from support.processes import Hub
from support.waiting import PATIENCE_S, wait_until
from two_nodes import OneHub, TwoNodes, program

RECEIVER = """
drive = node.accept("drive")
print("ready", flush=True)
for message in drive: print(message.text, flush=True)
"""


def stop(process):
    process.send_signal(signal.SIGSTOP)
    states = [stat.parent / "stat" for stat in pathlib.Path(f"/proc/{process.pid}/task").glob("*/stat")]
    wait_until(lambda: all(state.read_text(encoding="utf-8").rpartition(")")[2].split()[0] == "T" for state in states),
               "all threads of the receiver to stand still")


class Confirmed(TwoNodes):
    def test_stands_in_the_stream_of_all_others(self):
        drive = self.robot.accept("drive")
        for number in range(90):
            self.viewer.send("robot/drive", str(number), PATIENCE_S, confirm=number % 3 == 2)
        got = [drive.receive(0) for _ in range(64)]  # the queue of the service has overwritten the others
        self.assertEqual([message.text for message in got], [str(number) for number in range(26, 90)])
        self.assertEqual([message.sequence for message in got], list(range(27, 91)))

    def test_is_there_when_the_call_returns(self):
        drive, name = self.robot.accept("drive"), self.viewer.find("robot")
        for value in ({"v": 0.5}, "stop", bytearray(b"\x07" * 3_000_000)):
            self.viewer.send("robot/drive", value, PATIENCE_S, confirm=True)
            self.assertEqual(bytes(drive.receive(0).data), bytes(gimnet.messages.payload(value)[2]))
        self.viewer.send(name, "hello", confirm=True)
        self.assertEqual(self.robot.receive(0).text, "hello")

    def test_each_of_many_threads_hears_of_its_own_message(self):
        drive = self.robot.accept("drive", queue=2000)
        failures = []

        def send(thread):
            try:
                for number in range(100):
                    self.viewer.send("robot/drive", f"{thread} {number}", PATIENCE_S, confirm=number % 2 == 0)
            except gimnet.GimnetError as error:
                failures.append(error)
        threads = [threading.Thread(target=send, args=(number,)) for number in range(8)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(2 * PATIENCE_S)
        self.assertEqual(failures, [])
        self.viewer.send("robot/drive", "last", PATIENCE_S, confirm=True)
        got = [drive.receive(0).text for _ in range(801)]
        for thread in range(8):
            self.assertEqual([text for text in got if text.startswith(f"{thread} ")], [f"{thread} {number}" for number in range(100)])

    def test_a_message_larger_than_the_receiver_takes_is_told(self):
        self.robot.accept("drive")
        with self.assertRaises((gimnet.NotDelivered, gimnet.TooLarge)):
            self.viewer.send("robot/drive", bytes(70 << 20), 2 * PATIENCE_S, confirm=True)

    def test_takes_a_time_and_tells_what_is_none(self):
        self.robot.accept("drive")
        for timeout, wrong in (("1", TypeError), (-1.0, gimnet.BadArgument)):
            with self.assertRaises(wrong):
                self.viewer.send(self.robot.id, "x", timeout, confirm=True)

    def test_waits_without_a_limit(self):
        drive = self.robot.accept("drive")
        self.viewer.send("robot/drive", "first", None, confirm=True)
        self.assertEqual(drive.receive(0).text, "first")
        stop = self.robot.accept("stop")
        self.viewer.send("robot/stop", "second", None)
        self.assertEqual(stop.receive(PATIENCE_S).text, "second")


class OneReceiver(OneHub):
    """The receiver is another process."""

    LIMITS = ("--limit", "grace_ms=200", "--limit", "silent_ms=600000")

    def setUp(self):
        self.hub = Hub(self, *self.LIMITS)
        self.viewer = gimnet.connect("viewer", hub=self.hub.url)
        self.addCleanup(self.viewer.close)

    def receiver(self):
        process = program(RECEIVER, self.hub, "robot")
        self.addCleanup(process.communicate)
        self.addCleanup(process.kill)
        self.assertEqual(process.stdout.readline(), "ready\n")
        self.viewer.send("robot/drive", "first", PATIENCE_S, confirm=True)
        self.assertEqual(process.stdout.readline(), "first\n")
        return process

    def confirming(self, text, timeout=2 * PATIENCE_S):
        """A thread, and the list of what its call raised."""
        raised = []

        def send():
            try:
                self.viewer.send("robot/drive", text, timeout, confirm=True)
            except gimnet.GimnetError as error:
                raised.append(error)
        thread = threading.Thread(target=send)
        thread.start()
        self.addCleanup(thread.join, PATIENCE_S)
        return thread, raised

    def queued(self):
        """Bytes that wait for the receiver at the hub."""
        return next(each["queued_bytes"] for each in self.hub.status()["connections"] if each["name"] == "robot")

    def accepted(self):
        """Frames that the hub has of the viewer."""
        return next(each["accepted"] for each in self.hub.status()["connections"] if each["name"] == "viewer")


class Stopped(OneReceiver):
    def test_a_receiver_that_stands_still_and_goes_on(self):
        process = self.receiver()
        stop(process)
        with self.assertRaisesRegex(gimnet.Timeout, "was sent, and not acknowledged .* may still arrive"):
            self.viewer.send("robot/drive", "second", 0.2, confirm=True)
        thread, raised = self.confirming("third")
        process.send_signal(signal.SIGCONT)
        thread.join(PATIENCE_S)
        self.assertEqual((raised, process.stdout.readline(), process.stdout.readline()), ([], "second\n", "third\n"))

    def test_a_receiver_that_was_killed(self):
        process = self.receiver()
        stop(process)
        calls = [self.confirming(str(number)) for number in range(3)]
        sent = 4  # with the first one
        wait_until(lambda: self.accepted() >= sent, "the messages at the hub")
        process.kill()
        for thread, raised in calls:
            thread.join(PATIENCE_S)
            self.assertEqual([type(error) for error in raised], [gimnet.NotDelivered])
            self.assertRegex(str(raised[0]), "the message to robot/drive was not acknowledged: \\w")

    def test_ctrl_c_ends_the_wait(self):
        process = self.receiver()
        stop(process)
        sender = program("try:\n print('ready', flush=True)\n node.send('robot/drive', 'x', 1000, confirm=True)\n"
                         "except KeyboardInterrupt: print('ended')", self.hub, "sender")
        self.assertEqual(sender.stdout.readline(), "ready\n")
        sender.send_signal(signal.SIGINT)
        self.assertEqual(self.ends(sender, 0), "ended\n")


class FullQueue(OneReceiver):
    """Of the receiver at the hub."""

    LIMITS = (*OneReceiver.LIMITS, "--limit", "lane1_bytes=65536", "--limit", "socket_send_bytes=4096", "--limit", "block_ms=300",
              "--limit", "slow_consumer_ms=600000")

    def test_is_told_and_passes(self):
        process = self.receiver()
        stop(process)

        def is_full():
            try:
                self.viewer.send("robot/drive", bytes(30_000), 0.01)
            except gimnet.Timeout:  # the hub has paused its way
                pass
            return self.queued() > 30_000
        wait_until(is_full, "a full queue")
        for _ in range(5):
            with self.assertRaises((gimnet.Timeout, gimnet.NotDelivered)):
                self.viewer.send("robot/drive", bytes(30_000), 0.1, confirm=True)
        process.send_signal(signal.SIGCONT)
        self.viewer.send("robot/drive", "last", PATIENCE_S, confirm=True)


class Linked(OneHub):
    def test_over_a_link_and_after_its_hub_died(self):
        near = Hub(self, "--accept-links", hub_id=1)
        far = Hub(self, "--accept-links", "--link", near.url, hub_id=2)
        robot, viewer = gimnet.connect("robot", hub=near.url), gimnet.connect("viewer", hub=far.url)
        self.addCleanup(robot.close)
        self.addCleanup(viewer.close)
        drive = robot.accept("drive")
        wait_until(lambda: viewer.services("robot/drive"), "the service behind the link")
        for number in range(70):
            viewer.send("robot/drive", str(number), PATIENCE_S, confirm=number % 2 == 1)
        self.assertEqual(drive.receive(0).text, "6")
        near.process.signal(signal.SIGSTOP)
        raised = []

        def send():
            try:
                viewer.send("robot/drive", "last", 2 * PATIENCE_S, confirm=True)
            except gimnet.GimnetError as error:
                raised.append(error)
        thread = threading.Thread(target=send)
        thread.start()
        near.process.signal(signal.SIGKILL)
        thread.join(2 * PATIENCE_S)
        self.assertEqual([type(error) for error in raised], [gimnet.NotDelivered], raised)
        self.assertRegex(str(raised[0]), "was not acknowledged: ")


if __name__ == "__main__":
    unittest.main()
