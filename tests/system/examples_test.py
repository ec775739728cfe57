#!/usr/bin/env python3
"""The programs of examples/, as a newcomer starts them, with a real hub."""

import os
import pathlib
import signal
import struct
import subprocess
import unittest

from support.processes import GIMNET, Hub, Process, run_gimnet
from support.waiting import wait_until
from support.wire import FLAG_KEYED, Client

EXAMPLES = os.path.join(os.path.dirname(GIMNET), "examples")
# All but SIGKILL and SIGSTOP, which nobody can block, and the two that belong to the C library.
ALL_SIGNALS = (1 << 64) - 1 & ~(1 << signal.SIGKILL - 1 | 1 << signal.SIGSTOP - 1 | 3 << 31)


def blocked_signals(process):
    """What the threads of a program block, without the first one, which is the program's own."""
    blocked = {}
    for task in pathlib.Path(f"/proc/{process.popen.pid}/task").iterdir():
        if task.name != str(process.popen.pid):
            line = next(line for line in (task / "status").read_text().splitlines() if line.startswith("SigBlk:"))
            blocked[task.name] = int(line.split()[1], 16)
    return blocked


def start(test, hub, name, *arguments, **pipes):
    process = Process([os.path.join(EXAMPLES, name), *arguments], env={"GIMNET_HUB": hub.url}, **pipes)
    test.addCleanup(process.end)
    return process


def gimi(key_type, sequence, data):
    """The payload of a KEYED message (docs/protocol.md, section 7)."""
    return struct.pack("<II", key_type, 0) + struct.pack("<IIBBH", 1, sequence, 0, 0, 0) + data


class Examples(unittest.TestCase):
    def restart(self, hub):
        hub.process.signal(signal.SIGKILL)
        hub.process.wait()
        return hub.again(self)

    def test_a_subscriber_prints_what_the_publisher_says(self):
        hub = Hub(self)
        subscriber = start(self, hub, "subscriber")
        publisher = start(self, hub, "publisher")
        wait_until(lambda: subscriber.out.count(b"\n") >= 3, f"three messages; it said: {subscriber.err}")
        self.assertRegex(subscriber.out.splitlines()[0].decode(), r"^7\.\d+ #\d+: x \d\.\d{6} y 0$")
        # Both go on when the hub is back, and the publisher says meanwhile why nothing arrives.
        hub.process.signal(signal.SIGKILL)
        hub.process.wait()
        wait_until(lambda: "cannot publish robot/odom: the hub has been away for " in publisher.err,
                   f"the reason; it said: {publisher.err}")
        before = subscriber.out.count(b"\n")
        hub.again(self)
        wait_until(lambda: subscriber.out.count(b"\n") >= before + 3, "messages by the hub that was started anew")
        self.assertIsNone(publisher.popen.poll(), publisher.err)
        # The hub is looked at when it is quiet.
        publisher.signal(signal.SIGKILL)
        publisher.wait()

    def test_an_executor_and_a_poll_loop_talk(self):
        hub = Hub(self)
        start(self, hub, "executor")
        hub.wait_for_node("robot")
        loop = start(self, hub, "poll_loop", stdin=subprocess.PIPE)
        wait_until(lambda: b"x 0.000000" in loop.out, f"a pose; it said: {loop.err}")
        loop.popen.stdin.write(b"fast\n2\n")
        loop.popen.stdin.flush()
        wait_until(lambda: b"'fast' is no speed\n" in loop.out and b"speed 2.000000\n" in loop.out, "the replies")
        wait_until(lambda: b"x 1." in loop.out, "a pose that moved")
        loop.popen.stdin.close()
        self.assertEqual(loop.wait(), 0, loop.err)

    def test_a_kicked_publisher_ends(self):
        hub = Hub(self)
        publisher = start(self, hub, "publisher")
        hub.wait_for_node("robot")
        kicked = run_gimnet(f"unix:{hub.socket_path}", "ctl", "kick", "robot")
        self.assertEqual((kicked.code, publisher.wait()), (0, 1), kicked.err)

    def test_each_question_has_its_answer_also_when_the_hub_was_away(self):
        hub = Hub(self)
        adder = start(self, hub, "adder")
        hub.wait_for_node("adder")
        ask = start(self, hub, "ask", stdin=subprocess.PIPE)
        ask.popen.stdin.write(b"1.5 2\n")
        ask.popen.stdin.flush()
        wait_until(lambda: ask.out == b"1.5 2: 3.500000\n", "the first answer")
        hub = self.restart(hub)
        hub.wait_for_node("adder")
        wait_until(lambda: len(hub.nodes()) == 2, "both are back")
        ask.feed(b"3\n4 5\n")
        self.assertEqual((ask.wait(), ask.out, ask.err),
                         (0, b"1.5 2: 3.500000\n3: 3.000000\n4 5: 9.000000\n", ""))
        self.assertEqual(adder.err, "")

    def test_a_late_answer_is_not_taken_for_that_to_the_next_question(self):
        hub = Hub(self)
        adder = Client(self, hub).join("adder")
        ask = start(self, hub, "ask", stdin=subprocess.PIPE).feed(b"1\n2\n")
        for question, answers in ((b"1 1", (b"1 one", b"1 late")), (b"2 2", (b"2 two",))):
            got = adder.next_data()
            self.assertEqual(got.payload[20:], question)
            for sequence, answer in enumerate(answers, 1):
                adder.send(adder.frame(got.src, gimi(2, int(question[:1]) * 10 + sequence, answer), flags=FLAG_KEYED))
        self.assertEqual((ask.wait(), ask.out, ask.err), (0, b"1: one\n2: two\n", ""))

    def test_nobody_to_ask_is_said(self):
        ask = start(self, Hub(self), "ask", stdin=subprocess.PIPE).feed(b"1\n")
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
        hub = self.restart(hub)
        hub.wait_for_node("mirror")
        hello = start(self, hub, "hello", "again")
        self.assertEqual((hello.wait(), hello.out, hello.err), (0, b"again\n", ""))
        self.assertEqual(mirror.err, "")

    def test_the_threads_of_the_libraries_take_no_signals(self):
        hub = Hub(self)
        for name, threads in (("mirror", 1), ("adder", 2)):  # of NIF; of GIMI, which adds the clerk
            with self.subTest(name=name):
                program = start(self, hub, name)
                hub.wait_for_node(name)
                blocked = wait_until(lambda: len(blocked_signals(program)) == threads and blocked_signals(program),
                                     "its threads")
                self.assertEqual([signals & ALL_SIGNALS for signals in blocked.values()], [ALL_SIGNALS] * threads)

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
