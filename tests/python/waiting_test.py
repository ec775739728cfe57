#!/usr/bin/env python3
"""Waiting in Python: with a WaitSet, by descriptors in other loops, and what ends it."""

import asyncio
import fractions
import os
import pathlib
import select
import signal
import sys
import threading
import time
import unittest
import unittest.mock

import gimnet
from support.processes import Hub
from support.waiting import PATIENCE_S, wait_until
from two_nodes import TwoNodes, program


class Waiting(TwoNodes):
    def assert_readable(self, source, expected=True, patience=0.0):
        self.assertEqual(select.select([source], [], [], patience)[0], [source] if expected else [])

    def test_a_set_tells_of_each_kind_of_member(self):
        publisher, subscription = self.pair("pose")
        drive, add = self.robot.accept("drive"), self.robot.answer("add")
        with gimnet.WaitSet() as waits:
            for source, value in ((subscription, None), (drive, "drive"), (add, 3)):
                waits.add(source, value)
            publisher.publish("a")
            publisher.publish("b")
            for expected in "ab":
                self.assertEqual(waits.wait(PATIENCE_S), [subscription])
                self.assertEqual(subscription.receive(PATIENCE_S).text, expected)
            self.viewer.send("robot/drive", "left")
            self.assertEqual(waits.wait(PATIENCE_S), ["drive"])
            drive.receive(0)
            pending = self.viewer.request_later("robot/add", "1 2", PATIENCE_S)
            self.assertEqual(waits.wait(PATIENCE_S), [3])
            waits.add(pending, "reply")
            add.receive(0).reply("3")
            self.assertEqual(waits.wait(PATIENCE_S), ["reply"])
            self.assertEqual(pending.receive(0).text, "3")
            watch = self.viewer.watch("robot/*")
            waits.add(watch, "watch")
            self.assertEqual(waits.wait(PATIENCE_S), ["watch"])
            watch.close()
            with self.assertRaisesRegex(gimnet.Timeout, "within 0.01 s"):
                waits.wait(0.01)
            waits.wake()
            self.assertEqual(waits.wait(), [])
            for wrong in (-1, float("nan")):
                with self.assertRaises(gimnet.BadArgument):
                    waits.wait(wrong)
        with self.assertRaises(gimnet.Closed):
            waits.wait(0)

    def test_a_publisher_tells_how_many_subscribers_there_are(self):
        publisher, subscription = self.pair("pose")
        with gimnet.WaitSet() as waits:
            waits.add(publisher, "pose")
            for count in (1, 0):
                self.assertEqual(waits.wait(PATIENCE_S), ["pose"])
                self.assertEqual(publisher.subscribers_changed(0), count)
                with self.assertRaises(gimnet.Timeout):
                    waits.wait(0)
                with self.assertRaisesRegex(gimnet.Timeout, "not 2 subscribers within 0.01 s"):
                    publisher.wait_for_subscribers(2, 0.01)
                subscription.close()
        self.assert_readable(publisher, False)
        subscription = self.viewer.subscribe("robot/pose")
        self.assert_readable(publisher, patience=PATIENCE_S)

    def test_a_long_request_is_waited_for_without_asking_again_and_again(self):
        add = self.robot.answer("add")
        asked = unittest.mock.Mock(side_effect=gimnet._c.lib.gimi_wait_for_reply)
        with unittest.mock.patch.object(gimnet._c.lib, "gimi_wait_for_reply", asked):
            with self.viewer.request_later("robot/add", "1", PATIENCE_S) as pending:
                with self.assertRaisesRegex(gimnet.Timeout, "within 0.3 s") as raised:
                    pending.receive(0.3)
                self.assertEqual(raised.exception.ran, "")
                self.assertLessEqual(asked.call_count, 6)
                add.receive(PATIENCE_S).reply("2")
                self.assertEqual(pending.receive().text, "2")
                with self.assertRaises(gimnet.Closed):
                    pending.receive(1)
            with self.assertRaisesRegex(gimnet.Timeout, "robot/add") as raised:
                self.viewer.request("robot/add", "2", timeout=0.2)
            self.assertIn(raised.exception.ran, ("no", "maybe"))

    def test_a_source_is_in_one_set(self):
        _, subscription = self.pair("pose")
        first, second = gimnet.WaitSet(), gimnet.WaitSet()
        first.add(subscription)
        for wrong in (lambda: second.add(subscription), lambda: first.add(subscription), subscription.fileno):
            with self.assertRaisesRegex(gimnet.Taken, "wait set"):
                wrong()
        with self.assertRaises(gimnet.NotFound):
            second.remove(subscription)
        first.remove(subscription)
        second.add(subscription)
        second.close()
        self.assert_readable(subscription, False)
        with self.assertRaises(gimnet.Taken):
            first.add(subscription)
        subscription.close()
        with self.assertRaises(gimnet.Closed):
            first.add(self.pair_that_is_closed())

    def pair_that_is_closed(self):
        closed = self.viewer.subscribe("robot/closed")
        closed.close()
        return closed

    def test_messages_that_were_fetched_ahead_are_told(self):
        for how in ("set", "descriptor"):
            publisher, subscription = self.pair(how)
            for number in range(3):
                publisher.publish(str(number))
            waits = gimnet.WaitSet()
            self.assertEqual(subscription.receive(PATIENCE_S).text, "0")
            if how == "set":
                waits.add(subscription)
            else:
                self.assert_readable(subscription, patience=PATIENCE_S)
            for number in (1, 2):
                if how == "set":
                    self.assertEqual(waits.wait(PATIENCE_S), [subscription])
                else:
                    self.assert_readable(subscription, patience=PATIENCE_S)
                self.assertEqual(subscription.receive(PATIENCE_S).text, str(number))
            if how == "set":
                with self.assertRaises(gimnet.Timeout):
                    waits.wait(0)
            else:
                self.assert_readable(subscription, False)

    def test_any_real_number_is_a_time(self):
        publisher, subscription = self.pair("pose")
        for wait in (1, 0.001, fractions.Fraction(1, 1000)):
            begun = time.monotonic()
            with self.assertRaises(gimnet.NoHub):
                gimnet.connect(hub="unix:/none", wait_for_hub=wait, timeout=PATIENCE_S)
            self.assertGreaterEqual(time.monotonic() - begun, wait)
            with self.assertRaises(gimnet.Timeout):
                subscription.receive(wait)
        gimnet.connect(hub=self.hub.url, wait_for_hub=PATIENCE_S, timeout=0.0).close()
        gimnet.connect(hub=self.hub.url, wait_for_hub=0.0).close()
        minute = fractions.Fraction(60)
        self.robot.advertise("a", age_max=minute, timeout=minute)
        self.robot.subscribe("x/y", silence=minute, timeout=minute)
        publisher.wait_for_subscribers(timeout=minute)
        for wrong in ("1", None):
            with self.assertRaises(TypeError):
                self.robot.nodes(timeout=wrong)

    def test_silence_ends_a_wait(self):
        subscription = self.viewer.subscribe("robot/nothing", silence=0.02)
        with self.assertRaises(gimnet.Silence):
            subscription.receive()
        self.assert_readable(subscription, patience=PATIENCE_S)
        with self.assertRaises(gimnet.Silence):
            subscription.receive(0)

    def test_asyncio_waits_by_the_descriptor(self):
        publisher, subscription = self.pair("pose")

        async def first():
            came = asyncio.get_running_loop().create_future()
            asyncio.get_running_loop().add_reader(subscription, lambda: came.done() or came.set_result(subscription.receive(0)))
            publisher.publish("x")
            try:
                return await asyncio.wait_for(came, PATIENCE_S)
            finally:
                asyncio.get_running_loop().remove_reader(subscription)

        self.assertEqual(asyncio.run(first()).text, "x")

    def test_closing_ends_the_waits_of_other_threads(self):
        _, subscription = self.pair("pose")
        waits, node = gimnet.WaitSet(), self.node("third")
        begun = [threading.Event() for _ in range(3)]
        ended = []

        def wait(number, call):
            begun[number].set()
            try:
                call()
            except gimnet.Closed:
                ended.append(number)

        threads = [threading.Thread(target=wait, args=each)
                   for each in ((0, subscription.receive), (1, waits.wait), (2, node.receive))]
        for thread, event in zip(threads, begun):
            thread.start()
            event.wait(PATIENCE_S)
        for source in (subscription, waits, node):
            source.close()
        for thread in threads:
            thread.join(PATIENCE_S)
        self.assertEqual(sorted(ended), [0, 1, 2])

    def test_a_thread_that_waits_goes_on_when_its_source_joins_a_set(self):
        publisher, subscription = self.pair("pose")
        for number in range(50):  # it joins at another moment each time
            got = []
            thread = threading.Thread(target=lambda got=got: got.append(subscription.receive(PATIENCE_S).text))
            thread.start()
            with gimnet.WaitSet() as waits:
                waits.add(subscription)
                publisher.publish(str(number))
                thread.join(PATIENCE_S)
            self.assertEqual(got, [str(number)])

    def test_waits_leave_no_descriptor(self):
        def descriptors():
            return len(os.listdir("/proc/self/fd"))

        publisher, _ = self.pair("pose")
        before = descriptors()
        for _ in range(100):
            subscription = self.viewer.subscribe("robot/pose")
            with self.assertRaises(gimnet.Timeout):
                subscription.receive(0.001)
            with gimnet.WaitSet() as waits:
                waits.add(self.viewer)
        del subscription, waits
        self.assertEqual(descriptors(), before)

    def test_a_camera_gives_arrays(self):
        try:
            import numpy
        except ImportError:
            print("SKIPPED: numpy is not installed, and message.array() is not tested", file=sys.stderr)
            self.skipTest("numpy is not installed")
        publisher, subscription = self.pair("camera", delivery="latest")
        image = numpy.arange(480 * 640, dtype="f4").reshape(480, 640)
        publisher.publish(image)
        message = subscription.receive(PATIENCE_S)
        seen = message.array("f4", (480, 640))
        del message
        self.assertTrue((seen == image).all())
        self.assertFalse(seen.flags.writeable)
        with self.assertRaises(ValueError):
            publisher.publish(image)
            subscription.receive(PATIENCE_S).array("f4", (1, 2))


class Endings(unittest.TestCase):
    def setUp(self):
        self.hub = Hub(self)

    def test_ctrl_c_ends_every_wait(self):
        waits = ("node.receive()", "node.subscribe('a/b').receive()", "node.answer('add').receive()", "node.accept('c').receive()",
                 "list(node.watch('nobody/*'))", "gimnet.WaitSet().wait()", "node.advertise('d').wait_for_subscribers()",
                 "node.request('a0/add', 'x', 1000)")
        processes = []
        for number, wait in enumerate(waits):
            before = "answers = node.answer('add')\nimport gc\n" if "request" in wait else ""
            wait = wait.replace("a0", f"a{number}")
            lines = f"{before}try:\n print('ready', flush=True)\n {wait}\nexcept KeyboardInterrupt: print('ended')"
            processes.append((wait, program(lines, self.hub, f"a{number}")))
        for _, process in processes:
            self.assertEqual(process.stdout.readline(), "ready\n")
        for wait, process in processes:
            process.send_signal(signal.SIGINT)
            out, err = process.communicate(timeout=PATIENCE_S)
            self.assertEqual((out, err, process.returncode), ("ended\n", "", 0), wait)

    def test_ctrl_c_ends_calls_that_ask_the_hub(self):
        """The hub says nothing, so that each would wait for long; what the call still brings is ended later."""
        calls = ["node.find('zz', timeout=T)", "node.nodes(timeout=T)", "node.services(timeout=T)", "node.advertise('p', timeout=T)",
                 "node.subscribe('x/y', timeout=T)", "node.accept('c', timeout=T)", "node.answer('q', timeout=T)",
                 "node.watch(timeout=T)", "node.send('x/y', 'm', timeout=T)", "node.request('x/q', 'm', timeout=T)",
                 "gimnet.connect('late', hub=hub, timeout=T)", "gimnet.connect(hub='unix:/none', wait_for_hub=True, timeout=T)"]
        processes = []
        for number, call in enumerate(calls):
            lines = ("print('connected', flush=True)\nsys.stdin.readline()\ntry:\n print('ready', flush=True)\n"
                     f" {call.replace('timeout=T', f'timeout={2 * PATIENCE_S}')}\n"
                     "except KeyboardInterrupt: print('ended', flush=True)\n"
                     f"node.nodes(timeout={PATIENCE_S})\nprint('answered', flush=True)\nsys.stdin.read()")
            processes.append((call, program(lines, self.hub, f"b{number}")))
            self.assertEqual(processes[-1][1].stdout.readline(), "connected\n", call)
        self.hub.process.signal(signal.SIGSTOP)
        for call, process in processes:
            process.stdin.write("\n")
            process.stdin.flush()
            self.assertEqual(process.stdout.readline(), "ready\n")
            stat = pathlib.Path(f"/proc/{process.pid}/stat")
            wait_until(lambda stat=stat: stat.read_text(encoding="utf-8").split()[2] == "S", f"waiting in {call}")
            process.send_signal(signal.SIGINT)
            begun = time.monotonic()
            self.assertEqual(process.stdout.readline(), "ended\n", call)
            self.assertLess(time.monotonic() - begun, PATIENCE_S, call)
        self.hub.process.signal(signal.SIGCONT)
        for call, process in processes:
            self.assertEqual(process.stdout.readline(), "answered\n", call)
        with gimnet.connect(hub=self.hub.url) as viewer:
            wait_until(lambda: not viewer.services("*/p") + viewer.services("*/q"), "the end of the services")
            wait_until(lambda: "late" not in [node.name for node in viewer.nodes()], "the end of the late node")
        for call, process in processes:
            self.assertEqual((process.communicate(timeout=PATIENCE_S), process.returncode), (("", ""), 0), call)

    def test_a_program_ends_while_threads_wait(self):
        lines = """
waits, subscription = gimnet.WaitSet(), node.subscribe("x/y")
waits.add(node)
for call in (waits.wait, subscription.receive, gimnet.WaitSet().wait, node.watch("nobody/*").__iter__().__next__):
    threading.Thread(target=lambda call=call: [call() for _ in range(9)]).start()
def late(make, wait):
    threading.main_thread().join()  # until its part of the end is over
    wait(make())
threading.Thread(target=late, args=(gimnet.WaitSet, gimnet.WaitSet.wait)).start()
threading.Thread(target=late, args=(lambda: gimnet.connect("b", hub=hub), gimnet.Node.receive)).start()
"""
        process = program(lines, self.hub, "a")
        self.assertEqual((process.communicate(timeout=PATIENCE_S), process.returncode), (("", ""), 0))


if __name__ == "__main__":
    unittest.main()
