#!/usr/bin/env python3
"""A robot's log by `gimnet send` arrives in `gimnet recv` in order, byte for byte, and the ledger is exact."""

import json
import signal
import struct
import subprocess
import tempfile
import threading
import unittest

from support.logs import robot_logs
from support.processes import Hub, run_gimnet, start_gimnet, start_recv
from support.tap import FrameCount, Tap
from support.waiting import wait_until
from support.wire import FLAG_FRAGMENT, FLAG_KEYED, GROUP, NS, UNICAST, Client, text, varied_bytes


class Chatter:
    """Nodes that send small messages to each other in a ring, and count them, until stop()."""

    def __init__(self, test, hub, nodes=100, shards=1):
        self.clients = [Client(test, hub).join(shard=number % shards) for number in range(nodes)]
        self.sent = 0
        self._rest = [b""] * nodes  # of a frame that was sent in part
        self._got = [FrameCount(opening=0) for _ in range(nodes)]
        self._stopping, self._ending = threading.Event(), threading.Event()
        self._sending = threading.Thread(target=self._send)
        self._receiving = threading.Thread(target=self._receive)
        for client, got in zip(self.clients, self._got):
            got.feed(client.read_ahead())
            client.socket.setblocking(False)
        self._sending.start()
        self._receiving.start()
        test.addCleanup(self._end)

    @property
    def got(self):
        return sum(got.frames for got in self._got)

    def _send(self):
        while not self._stopping.wait(0.002):
            for number, client in enumerate(self.clients):
                if not self._rest[number]:
                    peer = self.clients[(number + 1) % len(self.clients)]
                    self._rest[number] = client.frame(peer.id, b"chatter")
                    self.sent += 1
                self._flush(number)

    def _flush(self, number):
        try:
            self._rest[number] = self._rest[number][self.clients[number].socket.send(self._rest[number]):]
        except BlockingIOError:
            pass

    def _receive(self):
        while not self._ending.wait(0.005):
            for client, got in zip(self.clients, self._got):
                try:
                    got.feed(client.socket.recv(1 << 16))
                except BlockingIOError:
                    continue

    def stop(self):
        """Sends no more, and waits until all that was sent has come."""
        self._stopping.set()
        self._sending.join()

        def flushed():
            for number, rest in enumerate(self._rest):
                if rest:
                    self._flush(number)
            return not any(self._rest)
        wait_until(flushed, "room for what was begun")
        wait_until(lambda: self.got == self.sent, "all of the chatter")

    def _end(self):
        self._stopping.set()
        self._ending.set()
        self._sending.join()
        self._receiving.join()


class Delivery(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.logs = robot_logs()
        cls.lines = sum(log.count(b"\n") for log in cls.logs)

    def send_logs(self, hub, sender_shard, receiver_shard):
        """Returns what counted the frames of both ends."""
        tap = Tap(self, hub)
        for log in self.logs:
            lines = log.count(b"\n")
            receiver = start_recv(self, tap, "B", "-n", str(lines), "--shard", str(receiver_shard))
            sent = run_gimnet(tap, "send", "B", "--json", "--shard", str(sender_shard), data=log)
            self.assertEqual(sent.code, 0, sent.err)
            self.assertIn(f'"acknowledged":{lines}'.encode(), sent.out)
            self.assertEqual(receiver.wait(), 0, receiver.err)
            self.assertEqual(receiver.out, log)
        self.assertGreater(tap.sent(), self.lines, "each line was a frame, and there were acknowledgements")
        return tap

    def test_through_one_shard(self):
        hub = Hub(self, shards=1)
        tap = self.send_logs(hub, 0, 0)
        status = hub.expect_ledger(self, accepted=tap.sent, delivered=tap.got)
        self.assertEqual(status["counters"]["mailbox_entries"], 0)

    def test_through_two_shards_from_one_to_the_other(self):
        hub = Hub(self, shards=2)
        tap = self.send_logs(hub, 0, 1)
        status = hub.expect_ledger(self, accepted=tap.sent, delivered=tap.got)
        self.assertEqual(status["counters"]["mailbox_frames"], tap.sent(), "every frame had to change the shard")
        self.assertGreater(status["counters"]["mailbox_entries"], 0)

    def test_on_the_same_of_two_shards(self):
        hub = Hub(self, shards=2)
        tap = self.send_logs(hub, 1, 1)
        status = hub.expect_ledger(self, accepted=tap.sent, delivered=tap.got)
        self.assertEqual(status["counters"]["mailbox_entries"], 0)
        self.assertEqual(status["shards"][0]["ledger"]["accepted"], 0)

    def test_with_a_hundred_others_chattering(self):
        for shards, receiver_shard in ((1, 0), (2, 0), (2, 1)):
            with self.subTest(shards=shards, receiver_shard=receiver_shard):
                hub = Hub(self, "--limit", "silent_ms=600000", shards=shards)
                chatter = Chatter(self, hub, shards=shards)
                tap = self.send_logs(hub, 0, receiver_shard)
                chatter.stop()
                self.assertGreater(chatter.sent, 0)
                hub.expect_ledger(self, accepted=lambda ends=(chatter, tap): ends[0].sent + ends[1].sent(),
                                  delivered=lambda ends=(chatter, tap): ends[0].got + ends[1].got())

    def test_through_a_unix_socket(self):
        hub = Hub(self)
        hub.url = hub.addresses[1]
        self.assertTrue(hub.url.startswith("unix:"))
        tap = self.send_logs(hub, 0, 0)
        hub.expect_ledger(self, accepted=tap.sent, delivered=tap.got)


class Sizes(unittest.TestCase):
    def test_lines_of_all_sizes_near_the_limits(self):
        hub = Hub(self, shards=2)
        sizes = [0, 1, 15, 16, 17, 4095, 4096, 4097, 8191, 8192, 8193, *range(65519, 65538), 0]
        lines = [varied_bytes(size, number).replace(b"\n", b" ") for number, size in enumerate(sizes)]
        data = b"".join(line + b"\n" for line in lines)
        tap = Tap(self, hub)
        receiver = start_recv(self, tap, "B", "-n", str(len(lines)), "--shard", "1")
        sent = run_gimnet(tap, "send", "B", "--shard", "0", data=data)
        self.assertEqual((sent.code, receiver.wait()), (0, 0), sent.err)
        self.assertEqual(receiver.out == data, True, f"{receiver.out_size} of {len(data)} bytes arrived, or others")
        hub.expect_ledger(self, accepted=tap.sent, delivered=tap.got)

    def test_the_largest_message_that_is_taken_and_one_byte_more(self):
        hub = Hub(self)
        for number, limit in enumerate((10, 8192, 65536, 1 << 20)):
            with self.subTest(limit=limit), tempfile.NamedTemporaryFile() as file:
                name = f"B{number}"
                receiver = start_recv(self, hub, name, "-n", "1", "--max-size", str(limit))
                file.write(bytes(limit + 1))
                file.flush()
                sent = run_gimnet(hub, "send", name, "--file", file.name)
                self.assertEqual(sent.code, 1)
                self.assertIn(f"it takes messages of at most {limit} bytes, and this one has {limit + 1}", sent.err)
                file.truncate(limit)
                sent = run_gimnet(hub, "send", name, "--file", file.name)
                self.assertEqual((sent.code, receiver.wait()), (0, 0), sent.err)
                self.assertEqual(receiver.out_size, limit + 1, "the payload and a newline")

    def test_a_line_that_the_receiver_does_not_take(self):
        hub = Hub(self)
        receiver = start_recv(self, hub, "B", "--max-size", "100000")
        lines = b"one\ntwo\n" + b"x" * (2 << 20) + b"\n" + b"late\n" * 1000
        sent = run_gimnet(hub, "send", "B", "--json", data=lines)
        self.assertEqual(sent.code, 1)
        self.assertEqual(json.loads(sent.out), {"sent": 2, "acknowledged": 2, "lost": 0, "waiting": 0})
        for words in ("it is larger than it takes (`gimnet recv` takes larger ones with --max-size)",
                      "of 2 messages before it 2 were acknowledged, and nothing behind it was sent"):
            self.assertIn(words, sent.err)
        receiver.end()
        self.assertEqual(receiver.out.splitlines(), [b"one", b"two"])

    def test_a_file_that_the_receiver_does_not_take(self):
        hub = Hub(self)
        receiver = start_recv(self, hub, "B", "--max-size", "100000")
        with tempfile.NamedTemporaryFile() as file:
            file.write(bytes(2 << 20))
            file.flush()
            sent = run_gimnet(hub, "send", "B", "--file", file.name)
        self.assertEqual(sent.code, 1)
        self.assertIn("refuse", sent.err)
        self.assertEqual(receiver.out_size, 0)


class Losses(unittest.TestCase):
    def test_send_says_when_the_receiver_goes(self):
        hub = Hub(self)
        receiver = start_recv(self, hub, "B", "-n", "10")
        sent = run_gimnet(hub, "send", "B", data=b"line\n" * 10000)
        self.assertEqual(receiver.wait(), 0)
        self.assertEqual(receiver.out, b"line\n" * 10)
        self.assertEqual(sent.code, 1)
        self.assertIn("not acknowledged", sent.err)
        self.assertIn("the hub reports", sent.err)

    def test_send_gives_the_hubs_reason_for_messages_of_every_size(self):
        """The receiver stands still until the hub has given up what waited for it."""
        hub = Hub(self, "--limit", "block_ms=300", "--limit", "slow_consumer_ms=600000", "--limit", "silent_ms=600000",
                  "--limit", "socket_send_bytes=16384")
        for size in (4000, 6000, 60000):
            with self.subTest(size=size):
                before = hub.counter("dropped.timed_out")
                receiver = start_recv(self, hub, f"B{size}")
                receiver.signal(signal.SIGSTOP)
                sender = start_gimnet(self, hub, "send", f"B{size}", stdin=subprocess.PIPE)
                sender.feed((b"x" * size + b"\n") * 200)
                wait_until(lambda: hub.counter("dropped.timed_out") > before, "the hub to give up")
                receiver.signal(signal.SIGCONT)
                self.assertEqual(sender.wait(), 1, sender.err)
                self.assertIn("the hub reports timed_out", sender.err)

    def test_recv_and_echo_say_what_did_not_become_whole(self):
        hub = Hub(self)
        provider = Client(self, hub).join("A")
        group = provider.ask(NS, 7, text(3, "B"))[3]
        recv = start_gimnet(self, hub, "recv", "--name", "R", "--json", "-n", "1")
        echo = start_gimnet(self, hub, "echo", "A/B", "--json", "-n", "1")
        to = hub.wait_for_node("R")["id"].split(".")
        wait_until(lambda: json.loads(run_gimnet(hub, "services", "A/B", "--json").out)[0]["subscribers"] == 1,
                   "the subscriber")
        data = bytes(8) + struct.pack("<IIBBH", 1, 1, 0, 0, 0) + b"whole"
        for dst, kind in ((int(to[0]) << 20 | int(to[1]), UNICAST), (group, GROUP)):
            piece = struct.pack("<III", kind + 1, 0, 20000) + bytes(8) + bytes(1000)
            provider.send(provider.frame(dst, piece, kind=kind, flags=FLAG_FRAGMENT | FLAG_KEYED))
            provider.send(provider.frame(dst, data, kind=kind, flags=FLAG_KEYED))
        for process in (recv, echo):
            self.assertEqual(process.wait(), 0, process.err)
            self.assertEqual((json.loads(process.out)["text"], json.loads(process.out)["lost"]), ("whole", 1))
            self.assertIn("gimnet: 1 message was lost: a part did not come, or did not fit the others\n", process.err)

    def test_send_stops_at_a_loss_although_its_input_goes_on(self):
        hub = Hub(self)
        receiver = start_recv(self, hub, "B", "-n", "1")
        sender = start_gimnet(self, hub, "send", "B", "--json", stdin=subprocess.PIPE)
        sender.popen.stdin.write(b"one\n")
        sender.popen.stdin.flush()
        self.assertEqual(receiver.wait(), 0)
        wait_until(lambda: not hub.nodes(), "B to leave")
        sender.popen.stdin.write(b"two\n")
        sender.popen.stdin.flush()
        self.assertEqual(sender.wait(), 1, "standard input is still open")
        self.assertEqual(sender.err, "gimnet: 1 of 2 messages were not acknowledged by B: the hub reports no_such_node: "
                                     "B has left; 1 was, and the rest of the input was not sent\n")
        self.assertEqual(json.loads(sender.out), {"sent": 2, "acknowledged": 1, "lost": 1, "waiting": 0})

    def test_send_stops_when_the_receiver_is_killed_in_the_middle(self):
        hub = Hub(self, "--limit", "grace_ms=1")
        receiver = start_recv(self, hub, "B")
        sender = start_gimnet(self, hub, "send", "B", stdin=subprocess.PIPE)
        stopping = threading.Event()

        def feed():
            try:
                while not stopping.is_set():
                    sender.popen.stdin.write(b"line\n" * 1000)
                    sender.popen.stdin.flush()
            except BrokenPipeError:
                pass
        feeding = threading.Thread(target=feed)
        feeding.start()
        self.addCleanup(feeding.join)
        self.addCleanup(stopping.set)
        wait_until(lambda: receiver.out_size > 50000, "ten thousand lines")
        receiver.signal(9)
        self.assertEqual(sender.wait(), 1, sender.err)
        self.assertIn("messages were not acknowledged by B: ", sender.err)
        self.assertIn(", and the rest of the input was not sent", sender.err)

    def test_send_ends_when_the_hub_goes(self):
        hub = Hub(self)
        receiver = start_recv(self, hub, "B")
        sender = start_gimnet(self, hub, "send", "B", stdin=subprocess.PIPE)
        sender.popen.stdin.write(b"first\n")
        sender.popen.stdin.flush()
        wait_until(lambda: receiver.out == b"first\n", "the first message")
        hub.process.signal(9)
        hub.process.wait()
        sender.feed(b"second\n")
        self.assertEqual(sender.wait(), 3, sender.err)
        self.assertIn("messages were acknowledged", sender.err)


class Types(unittest.TestCase):
    def test_types_are_the_applications_matter(self):
        hub = Hub(self)
        types = {"a/first": (0, 0xFFFFFFFF), "b/second": (0xDEADBEEF, 7)}
        for service, (kind, instance) in types.items():
            echo = start_gimnet(self, hub, "echo", service, "-n", "1", "--json")
            pub = start_gimnet(self, hub, "pub", service, "--wait", "1", "--type", str(kind), "--instance",
                               str(instance), stdin=subprocess.PIPE)
            listed = wait_until(lambda: json.loads(run_gimnet(hub, "--json", "services", service).out or "[]"),
                                "the service")
            self.assertEqual([(s["type"], s["instance"]) for s in listed], [(kind, instance)])
            pub.feed(b"of a type that no hub knows\n")
            self.assertEqual((pub.wait(), echo.wait()), (0, 0), pub.err + echo.err)
            message = json.loads(echo.out)
            self.assertEqual((message["type"], message["instance"], message["text"]),
                             (kind, instance, "of a type that no hub knows"))
        hub.expect_ledger(self, accepted=2, delivered=2)


if __name__ == "__main__":
    unittest.main()
