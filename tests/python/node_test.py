#!/usr/bin/env python3
"""Nodes in Python, through a hub: what is published, sent and told arrives; waiting ends as it should."""

import collections
import copy
import gc
import os
import pathlib
import pickle
import signal
import sys
import threading
import time
import unittest
import weakref

import gimnet
from support.waiting import PATIENCE_S, wait_until
from two_nodes import OneHub, TwoNodes, program


class Nodes(TwoNodes):
    def test_publishes_dictionaries_text_and_buffers(self):
        publisher, subscription = self.pair("pose")
        large = bytearray(b"\x07" * 200_000)
        for value in ({"x": 1.5}, "ä", b"\x00\x01", bytearray(b"ab"), memoryview(large), memoryview(b"abcd")[::2], b""):
            self.assertIs(publisher.publish(value), True)
        got = [subscription.receive(PATIENCE_S) for _ in range(7)]
        self.assertEqual(got[0].value, {"x": 1.5})
        self.assertEqual(got[1].text, "ä")
        self.assertEqual([bytes(message.data) for message in got[2:]], [b"\x00\x01", b"ab", bytes(large), b"ac", b""])
        self.assertEqual((got[0].service, got[0].sender, got[0].sequence), ("robot/pose", self.robot.id, 1))
        self.assertLess(abs(got[0].arrival - time.time()), PATIENCE_S)
        self.assertLessEqual(got[0].sent, got[0].arrival)
        with self.assertRaises(TypeError):
            publisher.publish(1)
        with self.assertRaises(gimnet.BitestreamError):
            publisher.publish({"x": None})

    def test_data_outlive_message_subscription_and_node(self):
        publisher, subscription = self.pair("image")
        for number in range(20):
            publisher.publish(bytes([number]) * (100 if number % 2 else 100_000))
        views = [subscription.receive(PATIENCE_S).data for _ in range(20)]
        kept = views[::3]
        self.viewer.close()
        del views, subscription
        gc.collect()
        self.assertEqual([(view[0], view[-1], view.readonly) for view in kept],
                         [(number, number, True) for number in range(0, 20, 3)])

    def test_a_message_that_is_larger_than_its_receiver_takes_is_refused(self):
        with gimnet.connect("small", hub=self.hub.url, message_bytes_max=1 << 20) as small:
            drive = small.accept("drive")
            with self.assertRaisesRegex(gimnet.TooLarge, "at most 1048576 bytes, and this one is larger"):
                self.robot.send("small/drive", bytes(48 << 20), timeout=PATIENCE_S)
            self.robot.send("small/drive", b"small")
            self.assertEqual(bytes(drive.receive(PATIENCE_S).data), b"small")

    def test_silence_is_told_from_the_end(self):
        publisher = self.robot.advertise("pulse", age_max=10.0)
        subscription = self.viewer.subscribe("robot/pulse", silence=0.05)
        publisher.wait_for_subscribers(1, PATIENCE_S)
        with self.assertRaises(gimnet.Silence):
            subscription.receive()
        publisher.publish("beat")
        self.assertEqual(subscription.receive(PATIENCE_S).text, "beat")
        with self.assertRaises(gimnet.Silence):
            subscription.receive()
        self.viewer.close()
        with self.assertRaises(gimnet.Closed):
            subscription.receive()

    def test_the_age_of_a_message(self):
        publisher, subscription = self.pair("pulse", age_max=60.0)

        def received():
            publisher.publish("beat")
            return subscription.receive(PATIENCE_S)
        # The library knows the hub's clock once a PING was answered.
        message = wait_until(lambda: next(filter(lambda each: each.age, [received()]), None), "the age of a message")
        first, second = message.age, message.age
        self.assertTrue(0 < first.seconds < second.seconds < PATIENCE_S and 0 < first.error < PATIENCE_S, (first, second))
        publisher, subscription = self.pair("plain")
        self.assertIsNone(received().age)

    def test_joins_under_the_next_number(self):
        with gimnet.connect("robot", hub=self.hub.url, number_if_taken=True) as second:
            self.assertEqual(second.name, "robot-2")

    def test_sends_commands_to_a_service_and_to_a_peer(self):
        drive = self.robot.accept("drive")
        for _ in range(2):
            self.viewer.send("robot/drive", {"v": 0.5}, lane="real_time")
            message = drive.receive(PATIENCE_S)
            self.assertEqual((message.value, message.lane), ({"v": 0.5}, "real_time"))
        with self.assertRaisesRegex(gimnet.BadArgument, "take the same ones"):
            self.viewer.send("robot/drive", {"v": 0.5})
        self.viewer.send(self.viewer.find("robot"), "hello", lane="bulk")
        message = self.robot.receive(PATIENCE_S)
        self.assertEqual((message.text, message.service, message.sender, message.lane), ("hello", "", self.viewer.id, "bulk"))
        with self.assertRaises(gimnet.NotFound):
            self.viewer.send("robot/nothing", "x")

    def test_accepted_services_have_their_own_messages_and_end(self):
        drive, stop = self.robot.accept("drive"), self.robot.accept("stop")
        for text in ("stop", "drive"):
            self.viewer.send(f"robot/{text}", text)
        for accepted, text in ((drive, "drive"), (stop, "stop")):
            message = accepted.receive(PATIENCE_S)
            self.assertEqual((message.text, message.service), (text, f"robot/{text}"))
        drive.close()
        self.assertEqual([service.name for service in self.viewer.services("robot/*")], ["robot/stop"])
        again = self.robot.accept("drive")
        with self.assertRaises(gimnet.Taken):
            self.robot.accept("drive")
        with gimnet.connect(hub=self.hub.url) as other:
            other.send("robot/drive", "again")
        self.assertEqual(again.receive(PATIENCE_S).text, "again")

    def test_asks_and_answers(self):
        add = self.robot.answer("add")

        def handle(request):
            if "fail" in request.value:
                request.fail(7, "no numbers")
            elif "let go" not in request.value:
                request.reply({"sum": sum(request.value["numbers"])})

        server = threading.Thread(target=lambda: collections.deque(map(handle, add), 0))
        server.start()
        reply = self.viewer.request("robot/add", {"numbers": [1, 2]}, PATIENCE_S, lane="real_time")
        self.assertEqual((reply.value, reply.sender), ({"sum": 3}, self.robot.id))
        for question, wrong, ran, code in (({"fail": True}, gimnet.Failed, "yes", 7), ({"let go": True}, gimnet.Gone, "maybe", 0)):
            with self.assertRaises(wrong) as raised:
                self.viewer.request("robot/add", question, PATIENCE_S)
            self.assertEqual((raised.exception.ran, raised.exception.code), (ran, code))
        pending = [self.viewer.request_later("robot/add", {"numbers": [number]}, PATIENCE_S) for number in range(10)]
        self.assertEqual([one.receive(PATIENCE_S).value["sum"] for one in pending], list(range(10)))
        add.close()
        server.join(PATIENCE_S)
        self.assertFalse(server.is_alive())

    def test_a_request_that_nobody_takes_times_out(self):
        answers = self.robot.answer("add")
        with self.viewer.request_later("robot/add", "x", 0.3) as pending:
            with self.assertRaises(gimnet.Timeout) as raised:
                pending.receive(0)
            self.assertEqual(raised.exception.ran, "")
            with self.assertRaises(gimnet.Timeout) as raised:
                pending.receive()
            self.assertEqual(raised.exception.ran, "maybe")
        answers.close()
        with self.assertRaises(gimnet.NotFound) as raised:
            self.viewer.request("robot/nothing", "x", 0.3)
        self.assertEqual(raised.exception.ran, "no")

    def test_lists_and_watches_nodes_and_services(self):
        watch = self.viewer.watch("robot/*")
        self.pair("pose", delivery="sync", window=2, metadata="m")
        event = next(event for event in watch if event.service)
        self.assertEqual((event.service.name, event.service.delivery, event.service.window), ("robot/pose", "sync", 2))
        self.assertEqual([node.name for node in self.viewer.nodes()], ["robot", "viewer"])
        service, = self.viewer.services("robot/**")
        self.assertEqual((service.metadata, service.accepts, service.node), ("m", False, self.robot.id))
        state = self.viewer.state()
        self.assertEqual((state.name, state.connected, state.ended), ("viewer", True, False))

    def test_tells_what_becomes_of_the_connection_and_of_subscribers(self):
        connection, waits = self.viewer.watch_connection(), gimnet.WaitSet()
        waits.add(connection)
        self.assertEqual(waits.wait(PATIENCE_S), [connection])
        event = connection.receive(0)
        self.assertEqual((event.change, event.skipped), ("connected", 0))
        self.assertIn("connected to the hub", event.why)
        eye = self.robot.advertise("eye")
        self.assertEqual(eye.subscribers_changed(0), 0)
        with self.assertRaises(gimnet.Timeout):
            eye.subscribers_changed(0)
        seen = self.viewer.subscribe("robot/eye")
        self.assertEqual(eye.subscribers_changed(PATIENCE_S), 1)
        seen.close()
        self.viewer.close()
        self.assertEqual(waits.wait(PATIENCE_S), [connection])
        self.assertEqual(list(connection), [])

    def test_errors_are_classes_with_sentences(self):
        for wrong, call in ((gimnet.NameTaken, lambda: gimnet.connect("robot", hub=self.hub.url)),
                            (gimnet.NoHub, lambda: gimnet.connect(hub="tcp://127.0.0.1:1")),
                            (gimnet.BadName, lambda: gimnet.connect("a b", hub=self.hub.url)),
                            (gimnet.BadName, lambda: self.robot.advertise("x" * 300)),
                            (gimnet.BadArgument, lambda: gimnet.connect("a\0b", hub=self.hub.url)),
                            (gimnet.BadArgument, lambda: self.viewer.subscribe("robot/a", timeout=float("nan"))),
                            (gimnet.BadArgument, lambda: self.viewer.receive(-1)),
                            (gimnet.BadArgument, lambda: self.viewer.receive(float("nan"))),
                            (gimnet.BadArgument, lambda: self.viewer.subscribe("robot/a", rate_hz=float("nan"))),
                            (gimnet.BadArgument, lambda: self.robot.advertise("a", delivery="often")),
                            (gimnet.BadArgument, lambda: self.robot.advertise("a", lane="fast")),
                            (gimnet.BadArgument, lambda: self.robot.send("viewer/a", "x", lane="fast")),
                            (gimnet.BadArgument, lambda: self.robot.request("viewer/a", "x", lane="fast")),
                            (gimnet.NotFound, lambda: self.viewer.find("nobody"))):
            with self.assertRaises(wrong) as raised:
                call()
            self.assertGreater(len(str(raised.exception)), 15)
        self.assertIsInstance(raised.exception, LookupError)

    def test_receive_raises_timeout_and_closed(self):
        _, subscription = self.pair("pose")
        with self.assertRaisesRegex(gimnet.Timeout, "within 0.06 s"):
            subscription.receive(0.06)
        with self.assertRaises(TimeoutError):
            subscription.receive(0)
        waiting = threading.Thread(target=lambda: list(subscription))
        waiting.start()
        subscription.close()
        subscription.close()
        waiting.join(PATIENCE_S)
        self.assertFalse(waiting.is_alive())
        with self.assertRaises(gimnet.Closed):
            subscription.receive(0)

    def test_publish_returns_false_while_the_hub_is_away(self):
        publisher, _ = self.pair("pose")
        self.hub.process.signal(signal.SIGKILL)
        self.hub.process.wait()
        wait_until(lambda: not publisher.publish("x", timeout=0), "a message that was not sent")
        self.assertFalse(self.robot.state().connected)

    def test_nodes_that_nobody_has_leave(self):
        node = gimnet.connect("short", hub=self.hub.url)
        publisher = node.advertise("a")
        gone = weakref.ref(node)
        peer = node.id
        del node
        self.assertEqual(self.viewer.find("short"), peer, "its publisher holds it")
        del publisher
        gc.collect()
        self.assertIsNone(gone())
        with self.assertRaises(gimnet.NotFound):
            wait_until(lambda: self.viewer.find("short") is None, "never")

    def test_mistakes_are_told_with_a_sentence(self):
        pose, accepted = self.robot.advertise("pose"), self.robot.accept("drive")
        answers = self.robot.answer("add")
        left = gimnet.connect(hub=self.hub.url)
        subscription, waits = left.subscribe("robot/pose"), gimnet.WaitSet()
        left.close()
        pending = self.viewer.request_later("robot/add", "1", PATIENCE_S)
        request = answers.receive(PATIENCE_S)
        mistakes = [
            (TypeError, "None is a NoneType", lambda: gimnet.connect(None)),
            (TypeError, "a str is needed", lambda: self.robot.advertise(b"x")),
            (TypeError, "a str is needed", lambda: self.viewer.request(17, "x")),
            (TypeError, "a str is needed", lambda: self.robot.advertise("y", metadata=None)),
            (TypeError, "queue cannot be a str: '1'", lambda: self.viewer.subscribe("robot/pose", queue="1")),
            (gimnet.BadArgument, "queue cannot be -1", lambda: self.viewer.subscribe("robot/pose", queue=-1)),
            (gimnet.BadArgument, f"window cannot be {1 << 32}", lambda: self.viewer.subscribe("robot/pose", window=1 << 32)),
            (gimnet.BadArgument, "rate", lambda: self.viewer.subscribe("robot/pose", rate_hz=float("nan"))),
            (gimnet.BadArgument, "rate_hz is 0", lambda: self.viewer.subscribe("robot/pose", rate_hz=0)),
            (gimnet.BadArgument, "queue is 0", lambda: self.viewer.subscribe("robot/pose", queue=0)),
            (gimnet.NotFound, "that of a service of the node 'robot'", lambda: self.viewer.find("robot/pose")),
            (TypeError, "such as (1, 0)", lambda: self.robot.advertise("y", key=1)),
            (gimnet.BadArgument, "(-1, 0)", lambda: self.robot.advertise("y", key=(-1, 0))),
            (gimnet.BadArgument, "a time of -1 s", lambda: accepted.receive(-1)),
            (gimnet.BadArgument, "a time of nan s", lambda: pose.publish("x", timeout=float("nan"))),
            (gimnet.BadArgument, "a time of inf s", lambda: self.viewer.find("robot", timeout=float("inf"))),
            (TypeError, "number of seconds", lambda: accepted.receive("1")),
            (TypeError, "number of seconds", lambda: self.viewer.find("robot", timeout=None)),
            (TypeError, "from a Request", lambda: waits.add(request)),
            (gimnet.BadArgument, "2147483647", lambda: request.fail(1 << 40)),
            (TypeError, "a str is needed", lambda: request.fail(1, None)),
            (gimnet.Closed, "this Node was closed", left.state),
            (gimnet.Closed, "this Node was closed", lambda: left.subscribe("robot/pose")),
            (gimnet.Closed, "the node was closed", lambda: subscription.receive(PATIENCE_S)),
            (TypeError, "handle", gimnet.Node),
            (gimnet.BadArgument, "is no node", lambda: self.viewer.send(gimnet.Peer((1 << 40) + 1), "x")),
            (gimnet.BadArgument, "is no node", lambda: self.viewer.send(gimnet.Peer(-1), "x")),
            (TypeError, "this is a str", lambda: pose.wait_for_subscribers("a")),
            (gimnet.BadArgument, "-1 subscribers", lambda: pose.wait_for_subscribers(-1)),
            (gimnet.BadArgument, "subscribers", lambda: pose.wait_for_subscribers(1 << 64)),
            (gimnet.BadArgument, "not Unicode", lambda: pose.publish("\ud800")),
            (gimnet.BadArgument, "not Unicode", lambda: gimnet.connect("\ud800")),
            (gimnet.BadArgument, "not Unicode", lambda: self.viewer.request("robot/add", "\ud800")),
            *((TypeError, "cannot be copied", lambda call=call, one=one: call(one))
              for call in (copy.copy, copy.deepcopy, pickle.dumps)
              for one in (pose, accepted, answers, self.robot, waits, pending, request)),
        ]
        for number, (error, words, call) in enumerate(mistakes):
            with self.subTest(number, words=words), self.assertRaises(error) as raised:
                call()
            self.assertIn(words, str(raised.exception))
        request.reply("2")
        self.assertEqual(pending.receive(PATIENCE_S).text, "2")


class Endings(OneHub):
    def test_ctrl_c_ends_a_wait(self):
        process = program("try:\n print('ready', flush=True)\n node.receive()\nexcept KeyboardInterrupt: print('ended')", self.hub, "a")
        self.assertEqual(process.stdout.readline(), "ready\n")
        process.send_signal(signal.SIGINT)
        self.assertEqual(self.ends(process, 0), "ended\n")

    def test_a_program_may_end_without_close_and_with_threads_that_wait(self):
        waits = "s = node.subscribe('x/y')\nt = threading.Thread(target=s.receive)\nt.start()\n"
        ended = [program(waits, self.hub, "a"), program(waits + "sys.exit(3)", self.hub, "b"),
                 program(waits + "t.daemon\nraise KeyError('k')", self.hub, "c")]
        self.ends(ended[0], 0)
        self.ends(ended[1], 3)
        self.assertIn("KeyError: 'k'", ended[2].communicate(timeout=PATIENCE_S)[1])
        with gimnet.connect("viewer", hub=self.hub.url) as viewer:
            self.assertEqual([node.name for node in viewer.nodes()], ["viewer"])

    def test_programs_that_start_and_end_leave_nothing(self):
        """A third of them is killed; the next one of that name takes its place."""
        full, begun = os.environ.get("GIMNET_STRESS") == "full", time.time()
        for number in range(1000 if full else 20):
            process = program("print('ready', flush=True)\nsys.stdin.read()", self.hub, "n")
            self.assertEqual(process.stdout.readline(), "ready\n", process.stderr)
            if number % 3 == 0:
                process.kill()
                process.communicate(timeout=PATIENCE_S)
            else:
                process.stdin.close()
                self.assertEqual((process.wait(PATIENCE_S), process.stderr.read()), (0, ""))
                process.stdout.close()
                process.stderr.close()
        lines = f"""
node.close()
for number in range({1 if full else 80}):  # those begin with Python running
    if os.fork() == 0:
        node = gimnet.connect("n", hub={self.hub.url!r})
        waits = threading.Thread(target=node.subscribe("x/y").receive)
        waits.start()
        if number % 3 == 0: os.kill(os.getpid(), 9)
        sys.exit(0)
    os.wait()
print(len(os.listdir("/proc/self/task")), len(os.listdir("/proc/self/fd")))
"""
        self.assertEqual(self.ends(program(lines, self.hub, "first"), 0, patience=4 * PATIENCE_S), "1 4\n")
        with gimnet.connect("n", hub=self.hub.url) as last:
            self.assertEqual([node.name for node in last.nodes()], ["n"])
        self.assertEqual([path for path in pathlib.Path(os.environ["XDG_RUNTIME_DIR"]).rglob("*") if path.stat().st_mtime >= begun
                          and path.is_file() and self.hub.url in path.read_text(errors="replace")], [])

    def test_messages_kept_and_dropped_in_any_order_leave_no_memory(self):
        """A hundred are kept, each in the place of one from before; an eighth is large and holds its batch."""
        full = os.environ.get("GIMNET_STRESS") == "full"
        lines = f"""
import random, resource
views = gimnet.connect("views", hub=hub)
publisher, subscription = node.advertise("image"), views.subscribe("a/image")
publisher.wait_for_subscribers(1, {PATIENCE_S})
content = lambda number: number.to_bytes(8, "little") * (12_500 if number % 8 == 0 else 2)
kept = {{}}
for begin in range(0, {1_000_000 if full else 16_000}, 50):
    for number in range(begin, begin + 50):
        publisher.publish(content(number))
    for number in range(begin, begin + 50):
        data, place = subscription.receive({PATIENCE_S}).data, random.randrange(100)
        before, old = kept.get(place, (0, content(0)))
        if old != content(before): sys.exit(f"{{before}} was overwritten")
        kept[place] = number, data
    if begin == 4_000:
        pages = int(open("/proc/self/statm").read().split()[0])
        resource.setrlimit(resource.RLIMIT_AS, [pages * resource.getpagesize() + (64 << 20)] * 2)
"""
        self.ends(program(lines, self.hub, "a"), 0, patience=(100 if full else 4) * PATIENCE_S)

    def test_a_thousand_handles_leave_no_thread_or_descriptor(self):
        with gimnet.connect("n", hub=self.hub.url) as node:
            count = lambda: [len(os.listdir(f"/proc/self/{kind}")) for kind in ("task", "fd")]
            before = count()
            for number in range(1000):
                node.advertise(f"s{number % 10}").close()
            for number in range(20):
                gimnet.connect(hub=self.hub.url).close()
            # The thread of a connect() may end behind it, that of the first one after it was counted.
            wait_until(lambda: all(after <= then for after, then in zip(count(), before)), "the end of all")


if __name__ == "__main__":
    unittest.main()
